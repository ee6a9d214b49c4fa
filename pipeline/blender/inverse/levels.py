"""Which level a group has: pictures of it as a white diffuse and as glossy surfaces, combined."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.inverse import DISTRIBUTIONS, FREE, GGX, LEVELS, MOST, SHARP, STEPS, Model, moved
from ...core.inverse.estimate import Fit, better, combined, newton, unexplained
from ...core.progress import Progress, Work
from .room import Room

Array = NDArray[np.float64]
Parts = tuple[list[Array], Array]  # pictures that are combined, and one beside them
SLOPES = (0.03, 0.06, 0.1, 0.16, 0.25, 0.4)
PLASTIC_SLOPES = (0.05, 0.2)  # a plastic's pictures take twice as many renders
LIKE_MIRROR = 0.3  # of the diffuse model's mean square error: what a mirror explains that well has no wide lobe
SHARP_LEVELS = ("perfect-mirror", "mirror", "diffuse-specular")  # of one lobe
ANGLES = tuple(np.arange(0.0, 180.0, 30.0))
RATIO, WIDER = 4.0, 1.6  # at which angles are scanned, and factor between the slopes at which they are
SHAPES = ("alpha", "ratio", "angle")
LONGEST = {"alpha": 0.5, "ratio": 0.7, "angle": 25.0}  # of a step: logarithms, degrees
TAILED = 0.8  # of Beckmann's slope, where the descent to a distribution of longer tails begins
STEPS_DOWN, DAMPING, SETTLED = 12, 1e-3, 0.03
WORTH = 0.02**2  # mean square relative error that a richer level must take off
NOISY = 4.0  # times what the best's error is surely below: what may be worse than that is too noisy to be chosen
PROMISING = 0.06**2  # mean square relative error of a plastic below which it may explain as much as more parameters do
ENOUGH = 20_000  # samples on a group's pixels by which a picture of it is judged
SAMPLES = (2, 64)
PERFECT = 0.97  # reflectance of a mirror above which it is perfect
FINAL = 4  # times as many by which the best of every level are compared, and again while noise decides between them
DECIDED = 16  # times as many at most, and as many times closer
AGAIN = 10_000  # seeds apart
HALF = 0.5  # reflectance of the pictures that are combined
WHITE = Model("diffuse", np.full(3, HALF), np.zeros(3))


@dataclass(frozen=True)
class Tried:
    """A model of a group and what it explains."""

    model: Model
    fit: Fit

    def as_json(self) -> dict[str, Any]:
        """Return the level, the relative error it leaves, and what that is surely below, for all noise."""
        error, most = (float(np.sqrt(max(value, 0.0))) for value in (self.fit.error, self.fit.surely_below))
        return {"level": self.model.level, "error": error, "surely_below": most}


def simplest(tried: list[Tried]) -> Tried:
    """Return the simplest model that explains a group as well as any, of those that surely do so as well as diffuse.

    The sharp picture of a small lamp is so noisy that its error may be anything: what may be far worse than the best is
    not chosen. A perfect mirror is not among them: as long as its surroundings are wrong it may fit by chance, and
    nothing would move it any more.
    """
    told = [one for one in tried if FREE[one.model.level] and one.fit.surely_below <= tried[0].fit.surely_below]
    best = min((one.fit for one in told), key=lambda fit: fit.surely_below)
    sure = [one for one in told if one.fit.surely_below <= NOISY * max(best.surely_below, WORTH)]
    return next(one for one in sure if not better(one.fit, best, WORTH))


def undecided(tried: list[Tried]) -> list[str]:
    """Return the simplest model's level with those that would be preferred to it, were they as good as they look."""
    chosen = simplest(tried)
    rivals = [one for one in tried if FREE[one.model.level] and chosen.fit.error - one.fit.error > WORTH]
    return [one.model.level for one in (chosen, *rivals)] if rivals else []


def perfected(model: Model) -> Model:
    """Return a mirror that reflects all light as far as can be told as a perfect one, and any other model as it is."""
    if model.level != "mirror" or model.specular.min() <= PERFECT:
        return model
    return dataclasses.replace(model, level="perfect-mirror", specular=np.ones(3))


def examined(
    room: Room,
    number: int,
    mask: NDArray[np.bool_],
    photograph: Array,
    weight: Array,
    levels: Sequence[str],
    seeds: tuple[int, int],
    choose: Callable[[list[Tried]], Tried] = simplest,
    denoised: bool = False,
    closer: int = 1,
    distributions: Sequence[str] = DISTRIBUTIONS,
    angles: Sequence[float] = ANGLES,
) -> Work[tuple[Model, list[dict[str, Any]]]]:
    """Return the model of a group that is chosen of the best of every level, and what was tried, diffuse first.

    The lobe that the group has is among those that are tried.
    The group's own pixels are linear in its reflectances as long as the light that reaches it stays as it is. The best
    of every level are rendered anew with more samples before they are moved or compared: of many that noise makes
    differ, the one that won looks better than it is. Where noise leaves open which is preferred they are rendered with
    still more.

    Parameters
    ----------
    room : Room
    number : int
        Of the group.
    mask : (H, W) bool
        Its pixels.
    photograph, weight : (H, W, 3) float64
    levels : sequence of str
        That are tried, of LEVELS.
    seeds : (int, int)
        Of the renders; two that are the same give least squares.
    choose : callable
        From the best of every level, the simplest first.
    denoised : bool
        Whether pictures are; noise is then no longer independent of the seed.
    closer : int
        Times the samples by which lobes are moved and levels compared.
    distributions : sequence of str
        Of slopes that a lobe may have: the first, or another that explains more.
    angles : sequence of float
        From the texture's U to a brushing that is tried [degrees].
    """
    group = _Group(room, number, mask, photograph[mask], weight[mask], seeds, denoised)
    lobes = yield from _lobes(group, room.models[number], levels, closer, distributions, angles)
    times = FINAL
    tried = yield from _compared(group.anew(times, times), lobes)
    while (rivals := undecided(tried)) and times < DECIDED * closer:
        times *= FINAL
        compared = yield from _compared(group.anew(times, times), {one: lobes[one] for one in rivals if one in lobes})
        seen = {one.model.level: one for one in compared}
        tried = [seen.get(one.model.level, one) for one in tried]
    return choose(tried).model, [one.as_json() for one in tried]


def _lobes(
    group: _Group, now: Model, levels: Sequence[str], closer: int, distributions: Sequence[str], angles: Sequence[float]
) -> Work[dict[str, Model]]:
    """Return the lobe of every level that has one and may explain a group, which shows a model now."""
    lobes = {level: _glossy(SHARP) for level in SHARP_LEVELS if level in levels}
    if "isotropic" not in levels and "plastic" not in levels:
        return lobes
    known = [_glossy(now.alpha, now.ratio, now.angle)] if "alpha" in FREE[now.level] else []
    brushings = [one for one in known if one.ratio > 1]
    is_brushed = bool(brushings)
    plain, sharp = group.fitted([group.diffuse]), group.explained(_glossy(SHARP))
    slopes = SLOPES if sharp.surely_below > LIKE_MIRROR * plain.error else SLOPES[:2]
    best, fit = yield from group.best([*map(_glossy, slopes), *(one for one in known if one.ratio == 1)])
    has_lobe = better(plain, fit, WORTH) and fit.surely_below < sharp.surely_below
    if has_lobe and is_brushed:  # the isotropic lobe is only to be compared
        best, fit = yield from group.anew(1, 1).shaped(best, ("alpha",), distributions[:1])
    elif has_lobe:
        best, fit = yield from group.anew(1, closer).shaped(best, ("alpha",), distributions)
    if "plastic" in levels:
        left = min(fit.surely_below, sharp.surely_below)
        alphas = {*PLASTIC_SLOPES, now.alpha if now.level == "plastic" else best.alpha}
        start, start_fit = yield from group.best(map(_plastic, sorted(alphas)))
        if start_fit.error < max(left, PROMISING):
            lobes["plastic"], _ = yield from group.anew(3, closer).descended(start, ("alpha",))
    if "isotropic" in levels:
        lobes["isotropic"] = best
    if has_lobe:  # as wide as the wider slope of a brushing
        between = [best.alpha / by for by in (WIDER**2, WIDER, 1.0)]
        brushings += [_glossy(alpha, RATIO, float(angle)) for alpha in between for angle in angles]
    if "anisotropic" in levels and brushings:
        brushed, found = yield from group.best(brushings)
        if is_brushed or better(fit, found, WORTH):  # what it has is not given up by the noise of a first look
            lobes["anisotropic"], _ = yield from group.anew(1, closer).shaped(brushed, SHAPES, distributions)
    return lobes


def _compared(group: _Group, lobes: Mapping[str, Model]) -> Work[list[Tried]]:
    """Return the best model of every level, given the lobe of each, with what it explains: diffuse, then as LEVELS."""
    fit = group.fitted([group.diffuse])
    tried = [Tried(Model("diffuse", _within(fit.factors[0]), np.zeros(3)), fit)]
    mirrored = group.shown(_glossy(SHARP)) if lobes else group.diffuse
    for level in [level for level in LEVELS if level in lobes]:
        rho_d, rho_s = np.zeros(3), np.zeros(3)
        if level == "perfect-mirror":
            fit, rho_s = group.judged(mirrored), np.ones(3)
        elif level == "mirror":
            fit = group.fitted([mirrored])
            rho_s = _within(fit.factors[0])
        elif level == "plastic":
            fit = group.explained(lobes[level])
            rho_d = _within(fit.factors[0])
        else:
            shown = mirrored if level in SHARP_LEVELS else group.shown(lobes[level])
            fit = group.fitted([group.diffuse, shown])
            rho_d, rho_s = map(_within, fit.factors)
        tried.append(Tried(dataclasses.replace(lobes[level], level=level, diffuse=rho_d, specular=rho_s), fit))
        yield Progress("levels", 1, 2)
    return tried


@dataclass(frozen=True)
class _Group:
    """A group's pixels in the photograph, and rendered with models of it."""

    room: Room
    number: int
    mask: NDArray[np.bool_]
    photograph: Array
    weight: Array
    seeds: tuple[int, int]
    denoised: bool
    times: int = 1

    @cached_property
    def diffuse(self) -> Array:
        """Pictures (2, P, 3) of a white diffuse surface."""
        return self.shown(WHITE)

    def shown(self, model: Model) -> Array:
        """Return pictures (2, P, 3) of a model, as they are at reflectance 1."""
        return self._rendered(model) / HALF

    def _rendered(self, model: Model) -> Array:
        samples = self.times * int(np.clip(ENOUGH / self.mask.sum(), *SAMPLES))
        with self.room.trying(self.number, model):
            shown = {s: self.room.pixels(self.mask, samples, s, True, self.denoised) for s in set(self.seeds)}
        return np.stack([shown[seed] for seed in self.seeds])

    def parts(self, lobe: Model) -> Parts:
        """Return the pictures (2, P, 3) that a model of a lobe's shape combines, and what it shows beside them."""
        if lobe.level != "plastic":
            return [self.diffuse, self.shown(lobe)], np.zeros_like(self.diffuse)
        coat = self._rendered(dataclasses.replace(lobe, diffuse=np.zeros(3)))
        return [(self._rendered(lobe) - coat) / HALF], coat

    def anew(self, number: int, times: int) -> _Group:
        """Return the same with other seeds and so many times the samples."""
        return dataclasses.replace(self, seeds=tuple(seed + number * AGAIN for seed in self.seeds), times=times)

    def fitted(self, bases: Sequence[Array], beside: Array | float = 0.0) -> Fit:
        """Fit pictures, and another that is as it is, to the photograph."""
        return combined(np.stack(bases, axis=1), self.photograph - beside, self.weight)

    def explained(self, lobe: Model) -> Fit:
        """Return what models of a lobe's shape explain."""
        return self.fitted(*self.parts(lobe))

    def judged(self, shown: Array) -> Fit:
        """Return what pictures explain as they are."""
        return Fit(np.ones((1, 3)), *unexplained(self.photograph - shown, self.weight))

    def best(self, lobes: Iterable[Model]) -> Work[tuple[Model, Fit]]:
        """Return the lobe that explains most beside a diffuse part."""
        tried = []
        for lobe in lobes:
            tried.append((lobe, self.explained(lobe)))
            yield Progress("levels", 1, 2)
        return min(tried, key=lambda pair: pair[1].surely_below)

    def shaped(self, lobe: Model, kinds: Sequence[str], distributions: Sequence[str]) -> Work[tuple[Model, Fit]]:
        """Return the lobe that is descended to from one, of the first distribution that no later one surely beats."""
        best, least = yield from self.descended(dataclasses.replace(lobe, distribution=distributions[0]), kinds)
        for distribution in distributions[1:]:
            start = dataclasses.replace(best, distribution=distribution, alpha=TAILED * best.alpha)
            if better(self.explained(start), least, 0.0):  # surely farther off
                continue
            found, fit = yield from self.descended(start, kinds)
            if better(least, fit, 0.0):
                best, least = found, fit
        return best, least

    def descended(self, lobe: Model, kinds: Sequence[str]) -> Work[tuple[Model, Fit]]:
        """Return the lobe that steps of Gauss and Newton lead to, each taken only if it leaves less unexplained.

        Reflectances are solved for at every step. Seeds stay the same, so that the error is a smooth function of the
        lobe.
        """
        parts = self.parts(lobe)
        fit, damping = self.fitted(*parts), DAMPING
        changes: list[Array] = []
        for _ in range(STEPS_DOWN):
            for kind in () if changes else kinds:
                there = self.parts(moved(lobe, kind, STEPS[kind]))
                changes.append((_sum(there, fit.factors) - _sum(parts, fit.factors)) / STEPS[kind])
                yield Progress("levels", 1, 2)
            by = self._step(parts, fit, changes, damping)
            shares = [value / LONGEST[kind] for kind, value in zip(kinds, by, strict=True)]
            if np.abs(shares).max() < SETTLED:
                break
            candidate = lobe
            for kind, share in zip(kinds, shares, strict=True):
                candidate = moved(candidate, kind, LONGEST[kind] * np.clip(share, -1, 1))
            there = self.parts(candidate)
            found = self.fitted(*there)
            if found.error < fit.error:
                lobe, parts, fit, damping, changes = candidate, there, found, damping / 10, []
            else:
                damping *= 30
        return lobe, fit

    def _step(self, parts: Parts, fit: Fit, changes: list[Array], damping: float) -> Array:
        """Return the Gauss-Newton step of a lobe's shape beside that of the reflectances."""
        columns = [one[..., colour : colour + 1] * np.eye(3)[colour] for one in parts[0] for colour in range(3)]
        residuals = self.photograph - _sum(parts, fit.factors)
        jacobians = np.stack([column.reshape(2, -1) for column in (*columns, *changes)], axis=1)
        step, _ = newton(jacobians, residuals.reshape(2, -1), self.weight.ravel(), damping, same_seeds=True)
        return step[len(columns) :]


def _sum(parts: Parts, factors: Array) -> Array:
    """Return what pictures of reflectance 1 show at others, (2, P, 3), with what is shown beside them."""
    bases, beside = parts
    return np.asarray(beside + sum(factor * one for one, factor in zip(bases, factors, strict=True)))


def _plastic(alpha: float) -> Model:
    return Model("plastic", np.full(3, HALF), np.zeros(3), alpha, distribution=GGX)


def _glossy(alpha: float, ratio: float = 1.0, angle: float = 0.0) -> Model:
    return Model("anisotropic", np.zeros(3), np.full(3, HALF), alpha, ratio, angle)


def _within(reflectance: Array) -> Array:
    """Return what a reflectance can be: in a white box the light falls with it, and factors are above 1."""
    return np.minimum(reflectance, MOST)
