"""Which level a group has: pictures of it as a white diffuse and as glossy surfaces, combined."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.inverse import DISTRIBUTIONS, FREE, LEVELS, MOST, SHARP, STEPS, Model, moved
from ...core.inverse.estimate import Fit, better, combined, newton, unexplained
from ...core.progress import Progress, Work
from .room import Room

Array = NDArray[np.float64]
SLOPES = (0.03, 0.06, 0.1, 0.16, 0.25, 0.4)
LIKE_MIRROR = 0.3  # of the diffuse model's mean square error: what a mirror explains that well has no wide lobe
SHARP_LEVELS = ("perfect-mirror", "mirror", "diffuse-specular")  # of one lobe
ANGLES = np.arange(0.0, 180.0, 30.0)
RATIO, WIDER = 4.0, 1.6  # at which angles are scanned, and factor between the slopes at which they are
SHAPES = ("alpha", "ratio", "angle")
LONGEST = {"alpha": 0.5, "ratio": 0.7, "angle": 25.0}  # of a step: logarithms, degrees
TAILED = 0.8  # of Beckmann's slope, where the descent to a distribution of longer tails begins
STEPS_DOWN, DAMPING, SETTLED = 5, 1e-3, 0.03
WORTH = 0.02**2  # mean square relative error that a richer level must take off
ENOUGH = 20_000  # samples on a group's pixels by which a picture of it is judged
SAMPLES = (2, 64)
FINAL = 4  # times as many by which the best of every level are compared
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

    The sharp picture of a small lamp is so noisy that its error may be anything. A perfect mirror is not among them: as
    long as its surroundings are wrong it may fit by chance, and nothing would move it any more.
    """
    told = [one for one in tried if FREE[one.model.level] and one.fit.surely_below <= tried[0].fit.surely_below]
    best = min((one.fit for one in told), key=lambda fit: fit.surely_below)
    return next(one for one in told if not better(one.fit, best, WORTH))


def examined(
    room: Room,
    number: int,
    mask: NDArray[np.bool_],
    photograph: Array,
    weight: Array,
    most: str,
    seeds: tuple[int, int],
    choose: Callable[[list[Tried]], Tried] = simplest,
    denoised: bool = False,
    closer: int = 1,
    distributions: Sequence[str] = DISTRIBUTIONS,
) -> Work[tuple[Model, list[dict[str, Any]]]]:
    """Return the model of a group that is chosen of the best of every level, and what was tried, diffuse first.

    The lobe that the group has is among those that are tried.
    The group's own pixels are linear in its reflectances as long as the light that reaches it stays as it is. The best
    of every level are rendered anew with more samples before they are moved or compared: of many that noise makes
    differ, the one that won looks better than it is.

    Parameters
    ----------
    room : Room
    number : int
        Of the group.
    mask : (H, W) bool
        Its pixels.
    photograph, weight : (H, W, 3) float64
    most : str
        The richest of LEVELS that is tried.
    seeds : (int, int)
        Of the renders; two that are the same give least squares.
    choose : callable
        From the best of every level, the simplest first.
    denoised : bool
        Whether pictures are; noise is then no longer independent of the seed.
    closer : int
        Times the samples by which lobes are moved.
    distributions : sequence of str
        Of slopes that a lobe may have: the first, or another that explains more.
    """
    group = _Group(room, number, mask, photograph[mask], weight[mask], seeds, denoised)
    levels = LEVELS[: LEVELS.index(most) + 1]
    diffuse = group.shown(WHITE)
    lobes: dict[str, Model] = {level: _glossy(SHARP) for level in SHARP_LEVELS if level in levels}
    if "isotropic" in levels:
        now = room.models[number]
        known = [_glossy(now.alpha, now.ratio, now.angle)] if "alpha" in FREE[now.level] else []
        plain, sharp = group.fitted(diffuse), group.fitted(diffuse, group.shown(_glossy(SHARP)))
        slopes = SLOPES if sharp.surely_below > LIKE_MIRROR * plain.error else SLOPES[:2]
        best, fit = yield from group.best(diffuse, [*map(_glossy, slopes), *(one for one in known if one.ratio == 1)])
        has_lobe = better(plain, fit, WORTH) and fit.surely_below < sharp.surely_below
        if has_lobe:
            best, fit = yield from group.anew(1, closer).shaped(best, ("alpha",), distributions)
        lobes["isotropic"] = best
        trials = [one for one in known if one.ratio > 1]
        if has_lobe:
            wide = [best.alpha * by for by in (1 / WIDER, 1.0, WIDER)]
            trials += [_glossy(alpha, RATIO, float(angle)) for alpha in wide for angle in ANGLES]
        if "anisotropic" in levels and trials:
            brushed, found = yield from group.best(diffuse, trials)
            if better(fit, found, WORTH):
                lobes["anisotropic"], _ = yield from group.anew(1, closer).shaped(brushed, SHAPES, distributions)
    group = group.anew(2, FINAL)
    diffuse = group.shown(WHITE)
    fit = group.fitted(diffuse)
    tried = [Tried(Model("diffuse", _within(fit.factors[0]), np.zeros(3)), fit)]
    mirrored = group.shown(_glossy(SHARP)) if lobes else diffuse
    for level, lobe in lobes.items():
        shown = mirrored if level in SHARP_LEVELS else group.shown(lobe)
        rho_d, rho_s = np.zeros(3), np.ones(3)
        if level == "perfect-mirror":
            fit = group.judged(shown)
        elif level == "mirror":
            fit = group.fitted(shown)
            rho_s = _within(fit.factors[0])
        else:
            fit = group.fitted(diffuse, shown)
            rho_d, rho_s = map(_within, fit.factors)
        tried.append(Tried(dataclasses.replace(lobe, level=level, diffuse=rho_d, specular=rho_s), fit))
        yield Progress("levels", 1, 2)
    return choose(tried).model, [one.as_json() for one in tried]


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

    def shown(self, model: Model) -> Array:
        """Return pictures (2, P, 3) of a model, as they are at reflectance 1."""
        samples = self.times * int(np.clip(ENOUGH / self.mask.sum(), *SAMPLES))
        with self.room.trying(self.number, model):
            shown = {s: self.room.pixels(self.mask, samples, s, True, self.denoised) for s in set(self.seeds)}
        return np.stack([shown[seed] for seed in self.seeds]) / HALF

    def anew(self, number: int, times: int) -> _Group:
        """Return the same with other seeds and so many times the samples."""
        return dataclasses.replace(self, seeds=tuple(seed + number * AGAIN for seed in self.seeds), times=times)

    def fitted(self, *bases: Array) -> Fit:
        return combined(np.stack(bases, axis=1), self.photograph, self.weight)

    def judged(self, shown: Array) -> Fit:
        """Return what pictures explain as they are."""
        return Fit(np.ones((1, 3)), *unexplained(self.photograph - shown, self.weight))

    def best(self, diffuse: Array, lobes: Iterable[Model]) -> Work[tuple[Model, Fit]]:
        """Return the lobe that explains most beside a diffuse part."""
        tried = []
        for lobe in lobes:
            tried.append((lobe, self.fitted(diffuse, self.shown(lobe))))
            yield Progress("levels", 1, 2)
        return min(tried, key=lambda pair: pair[1].surely_below)

    def shaped(self, lobe: Model, kinds: Sequence[str], distributions: Sequence[str]) -> Work[tuple[Model, Fit]]:
        """Return the lobe that is descended to from one, of the first distribution that no later one surely beats."""
        best, least = yield from self.descended(dataclasses.replace(lobe, distribution=distributions[0]), kinds)
        for distribution in distributions[1:]:
            start = dataclasses.replace(best, distribution=distribution, alpha=TAILED * best.alpha)
            found, fit = yield from self.descended(start, kinds)
            if better(least, fit, 0.0):
                best, least = found, fit
        return best, least

    def descended(self, lobe: Model, kinds: Sequence[str]) -> Work[tuple[Model, Fit]]:
        """Return the lobe that steps of Gauss and Newton lead to, each taken only if it leaves less unexplained.

        Reflectances are solved for at every step. Seeds stay the same, so that the error is a smooth function of the
        lobe.
        """
        diffuse, picture = self.shown(WHITE), self.shown(lobe)
        fit, damping = self.fitted(diffuse, picture), DAMPING
        changes: list[Array] = []
        for _ in range(STEPS_DOWN):
            for kind in () if changes else kinds:
                changes.append((self.shown(moved(lobe, kind, STEPS[kind])) - picture) / STEPS[kind])
                yield Progress("levels", 1, 2)
            by = self._step(diffuse, picture, fit, changes, damping)
            shares = [value / LONGEST[kind] for kind, value in zip(kinds, by, strict=True)]
            if np.abs(shares).max() < SETTLED:
                break
            candidate = lobe
            for kind, share in zip(kinds, shares, strict=True):
                candidate = moved(candidate, kind, LONGEST[kind] * np.clip(share, -1, 1))
            there = self.shown(candidate)
            found = self.fitted(diffuse, there)
            if found.error < fit.error:
                lobe, picture, fit, damping, changes = candidate, there, found, damping / 10, []
            else:
                damping *= 30
        return lobe, fit

    def _step(self, diffuse: Array, picture: Array, fit: Fit, changes: list[Array], damping: float) -> Array:
        """Return the Gauss-Newton step of a lobe's shape beside that of both reflectances."""
        rho_d, rho_s = fit.factors
        columns = [
            one[..., colour : colour + 1] * np.eye(3)[colour] for one in (diffuse, picture) for colour in range(3)
        ]
        columns += [change * rho_s for change in changes]
        residuals = self.photograph - rho_d * diffuse - rho_s * picture
        jacobians = np.stack([column.reshape(2, -1) for column in columns], axis=1)
        step, _ = newton(jacobians, residuals.reshape(2, -1), self.weight.ravel(), damping, same_seeds=True)
        return step[6:]


def _glossy(alpha: float, ratio: float = 1.0, angle: float = 0.0) -> Model:
    return Model("anisotropic", np.zeros(3), np.full(3, HALF), alpha, ratio, angle)


def _within(reflectance: Array) -> Array:
    """Return what a reflectance can be: in a white box the light falls with it, and factors are above 1."""
    return np.minimum(reflectance, MOST)
