"""The search: diffuse everywhere, then for every group the simplest level that explains it, then all together."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.inverse import COLOURED, FREE, LEVELS, STEPS, InverseSettings, Model, grey, moved
from ...core.inverse.estimate import newton, unexplained
from ...core.inverse.photograph import Photograph, inner, weights
from ...core.inverse.texture import reflectance_map
from ...core.progress import Progress, Work, retold
from .levels import ENOUGH, examined
from .room import Room

Array = NDArray[np.float64]
RATIO_ROUNDS, MOST_RATIO_ROUNDS = 4, 8  # more where light bounces long
LARGE, TELLING = 0.3, 0.05  # logarithms of moves of reflectances, by which a gain of all, and of one is measured
OVERSHOOT, MOST_GAIN = 2.0, 50.0
ROUNDS = 6  # of looking for levels
WORST = 0.4  # of the largest error: groups above it are looked at before the others
WORTH = 0.03  # relative error of a group below which no richer level is looked for
LOBES_HELP = 0.85  # of the error of a diffuse group: what leaves more is not explained by lobes
LEVEL_SAMPLES, MOST_SAMPLES = 16, 128
USUAL = 160 * 120  # pixels for which numbers of samples are stated
STEADY = 4.0  # standard deviations above which an error is not noise
DERIVATIVE_SAMPLES, DERIVATIVE_ENOUGH = 2, 6000  # a pixel of the whole picture; on a group's own pixels
FEWEST = 6  # pixels without which a group's own are not judged
UNSEEN = 1e-3  # share of the largest derivative below which nothing in the picture tells of a group
LONGEST = 0.7  # of a step: a factor of two
MOST_CHANGE = 2.0  # of a pixel by the logarithm of a parameter, in radiances about it


@dataclass
class Found:
    """What the search ended with.

    Parameters
    ----------
    models : list of Model
    deviations : list of dict
        Standard deviation of each kind of parameter that render noise causes: relative, of angles in degrees.
    seen : list of str
        ``"directly"``, ``"in reflections"`` or ``"not at all"``.
    pixels : list of int
        Pixels that show the group and are trusted.
    tried : list of list of dict
        Levels that were tried, each with its relative error.
    history : list of dict
        After every stage: ``stage``, ``seconds``, ``error`` (relative, render noise taken off).
    """

    models: list[Model]
    deviations: list[dict[str, Any]]
    seen: list[str]
    pixels: list[int]
    tried: list[list[dict[str, Any]]]
    history: list[dict[str, Any]] = field(default_factory=list)


class Search:
    """One search in a room for what a photograph shows.

    Parameters
    ----------
    room : Room
    photograph : Photograph
        Of the room's size.
    settings : InverseSettings
    """

    def __init__(self, room: Room, photograph: Photograph, settings: InverseSettings) -> None:
        self.room, self.settings = room, settings
        self.start = time.perf_counter()
        self.photograph = photograph.pixels
        self.index, self.uv = room.layers_of_pixels()
        trusted = photograph.trusted & (self.index >= 0)
        kept = trusted & inner(self.index)
        count = len(room.groups)
        for number in range(count):  # a group that is all edge keeps its pixels
            if (kept & (self.index == number)).sum() < FEWEST:
                kept |= trusted & (self.index == number)
        self.masks = [kept & (self.index == number) for number in range(count)]
        self.weight = weights(self.photograph) * kept[..., None]
        self.seed = 0
        self.patterned: set[int] = set()  # groups whose picture no lobe explains
        self.tried: list[list[dict[str, Any]]] = [[] for _ in range(count)]
        self.deviations: list[dict[str, Any]] = [{} for _ in range(count)]
        self.seen = ["directly" if mask.any() else "not at all" for mask in self.masks]
        self.history: list[dict[str, Any]] = []

    def run(self) -> Work[Found]:
        """Search until the uncertainty asked for or the budget is reached.

        Yields
        ------
        Progress in seconds of the budget.
        """
        yield from self._diffuse()
        for turn in range(ROUNDS):
            changed = yield from self._levels()
            if not changed and turn:
                break
            yield from self._refine(rounds=4, samples=8, damping=0.1)
        for number, model in enumerate(self.room.models):
            if model.level == "texture":
                self._paint(number)
        yield from self._refine(rounds=15, samples=32, damping=0.03)
        pixels = [int(mask.sum()) for mask in self.masks]
        return Found(self.room.models, self.deviations, self.seen, pixels, self.tried, self.history)

    def _diffuse(self) -> Work[None]:
        """Let every group be diffuse; correct each by the ratio of photograph and render (Boivin 2001, equation 4).

        Where light bounces long, the picture grows faster than the reflectance and the ratio overshoots. Once a large
        correction of all groups together was seen to do so, each is divided by the gain that its last one had, measured
        in logarithms.
        """
        seen = [number for number, mask in enumerate(self.masks) if mask.any()]
        pixels = np.array([self.masks[number].sum() for number in seen]).reshape(-1, 1)
        before, moves, gains = (np.zeros((len(seen), 3)) for _ in range(3))
        gains += 1
        overshoots = False
        for turn in range(MOST_RATIO_ROUNDS):
            shown = self._render(4)
            missing = np.log([self._ratio(shown, number) for number in seen]).reshape(-1, 3)
            power = float((pixels * moves**2).sum())
            gain = float((pixels * moves * (before - missing)).sum()) / max(power, 1e-30)
            overshoots |= power > LARGE**2 * moves.shape[1] * pixels.sum() and gain > OVERSHOOT
            if overshoots:
                told = np.abs(moves) > TELLING
                own = np.clip((before - missing) / np.where(told, moves, 1.0), 1.0, MOST_GAIN)
                gains = np.where(told, own, gains)
            for place, number in enumerate(seen):
                old = self.room.models[number]
                self.room.show(number, moved(old, "diffuse", missing[place] / gains[place]))
                moves[place] = np.log(self.room.models[number].diffuse / old.diffuse)
            before = missing
            yield self._step("diffuse")
            if turn + 1 >= RATIO_ROUNDS and not overshoots:
                break
        self.room.count_bounces()
        self._note("diffuse", self._residuals(8))

    def _ratio(self, shown: Array, number: int) -> Array:
        """Return what a group's pixels in a render are to be multiplied by to be the photograph's, (3,)."""
        mask = self.masks[number]
        part, w = shown[mask], self.weight[mask]
        ratio = (w * part * self.photograph[mask]).sum(axis=0) / np.maximum((w * part**2).sum(axis=0), 1e-30)
        return np.asarray(np.maximum(ratio, 1e-3))

    def _levels(self) -> Work[bool]:
        """Look for a level for every group whose picture is not explained; return whether one changed.

        What no level explains has a texture; that is not said before all other groups have their level, for what is
        wrong elsewhere shows in reflections.
        """
        residuals = self._even_residuals()
        errors = [self._unexplained(residuals, number) for number in range(len(self.masks))]
        waiting = sorted(self.patterned)
        open_errors = [0.0 if number in self.patterned else error for number, error in enumerate(errors)]
        changed = False
        for number in map(int, np.argsort(open_errors)[::-1]):
            if open_errors[number] <= max(WORTH, WORST * max(open_errors)) or self._out_of_time():
                continue
            before = self.room.models[number].level
            best, lobes_help = yield from self._examined(number)
            self.room.show(number, best)
            kept = FREE[best.level]
            self.deviations[number] = {k: sd for k, sd in self.deviations[number].items() if k in kept}
            changed |= best.level != before
            if not lobes_help and before != "texture" and self.room.layers[number] and self.settings.levels == "all":
                self.patterned.add(number)
        if not changed:
            for number in sorted(waiting, key=self._help)[-1:]:  # the one that lobes help least
                self.tried[number].append({"level": "texture", "error": 0.0})
                self.room.show(number, Model("texture", np.ones(3), np.zeros(3)))
                self.deviations[number] = {}
                self._paint(number)
            self.patterned.clear()  # the others may look otherwise now
            changed = bool(waiting)
        self._note("levels", self._residuals(8))
        return changed

    def _examined(self, number: int) -> Work[tuple[Model, bool]]:
        """Return the best model of a group without a texture, and whether any lobe explains what diffuse does not."""
        mask = self.masks[number]
        most = LEVELS.index("anisotropic" if self.settings.levels == "all" else self.settings.levels)
        self.room.paint(number, None)
        work = examined(self.room, number, mask, self.photograph, self.weight, most, self._next_seed())
        words = f"levels of {self.room.groups[number].name}"
        model, self.tried[number] = yield from retold(work, lambda _: self._step(words))
        return model, self._help(number) < LOBES_HELP

    def _help(self, number: int) -> float:
        """Return what share of a diffuse group's error the best lobe leaves."""
        tried = self.tried[number]
        return float(min(one["error"] for one in tried) / max(tried[0]["error"], 1e-12))

    def _paint(self, number: int) -> None:
        """Divide the photograph by what a white surface there would show, and keep that as the group's texture."""
        mask = self.masks[number]
        with self.room.trying(number, grey()):
            self.room.paint(number, None)
            white = np.mean([self._render(32) for _ in range(2)], axis=0) / 0.5
        whole = self.index == number
        texture = reflectance_map(self.photograph, white, mask, whole, self.uv)
        self.room.paint(number, texture)

    def _refine(self, rounds: int, samples: int, damping: float) -> Work[None]:
        """Let all parameters of all groups move together: Gauss-Newton, the derivatives by renders of the same seed.

        A step that more than doubles the error is taken back, the next is shorter. A parameter whose step changes its
        sign goes in shorter steps from then on (Kesten 1958), so that it settles in the mean of what noise makes of it.
        """
        kinds = [
            (number, kind)
            for number, model in enumerate(self.room.models)
            for kind in FREE[model.level]
            if not (model.level == "texture" and kind == "diffuse")
        ]
        derivatives = yield from self._derivatives(kinds)
        best: tuple[float, list[Model], Array] | None = None
        turns: list[Array] = [np.zeros(3 if kind in COLOURED else 1) for _, kind in kinds]
        last = [np.zeros_like(one) for one in turns]
        for _ in range(rounds):
            if self._out_of_time():
                break
            residuals = self._residuals(samples)
            error, noise = self._error(residuals)
            if best is not None and error > 2 * best[0] + STEADY * noise:
                self._show_all(best[1])
                residuals, damping = best[2], 10 * damping
            else:
                best = error, list(self.room.models), residuals
            step, deviation = self._newton(kinds, derivatives, residuals, damping)
            turns = [n + (by * before < 0) for n, by, before in zip(turns, step, last, strict=True)]
            gains, last = [1 / (1 + n) for n in turns], step
            moves = [gain * by for gain, by in zip(gains, step, strict=True)]
            self._apply(kinds, moves, [np.sqrt(gain) * sd for gain, sd in zip(gains, deviation, strict=True)])
            self._note("refine", residuals)
            yield self._step("refine")
            if min(n.min() for n in turns) >= 2 and self._uncertainty() < self.settings.target / 100:
                break

    def _error(self, residuals: Array) -> tuple[float, float]:
        """Return the mean square relative error, and its standard deviation by noise."""
        used = self.weight[..., 0] > 0
        return unexplained(residuals[:, used], self.weight[used])

    def _uncertainty(self) -> float:
        """Return the largest relative deviation of the reflectances."""
        parts = [d[kind] for d in self.deviations for kind in COLOURED if kind in d]
        return max((max(part) for part in parts), default=0.0)

    def _show_all(self, models: Sequence[Model]) -> None:
        for number, model in enumerate(models):
            self.room.show(number, model)

    def _derivatives(self, kinds: Sequence[tuple[int, str]]) -> Work[Array]:
        """Return the change of the picture by every kind of parameter, by two seeds: (2, N, H, W, 3).

        A group's own pixels are rendered with as many samples as they need. What its diffuse reflectance changes
        elsewhere is seen in the whole picture; what its lobe changes elsewhere is left out, which slows the search.
        """
        self.room.count_bounces()
        seeds = [self._next_seed() for _ in range(2)]
        each = self._samples(DERIVATIVE_SAMPLES)
        whole = [self.room.render(each, seed, True) for seed in seeds]
        # any instrument will do, and one without fireflies does best; no parameter changes more than this
        bound = MOST_CHANGE * np.sqrt(1 / np.maximum(weights(self.photograph), 1e-30))
        found = np.zeros((2, len(kinds), *self.photograph.shape))
        own: dict[int, list[Array]] = {}
        for place, (number, kind) in enumerate(kinds):
            model, mask = self.room.models[number], self.masks[number]
            by = STEPS[kind] * (-1.0 if kind in COLOURED and getattr(model, kind).max() > 0.8 else 1.0)
            changed = moved(model, kind, by)
            if kind == "diffuse" or not mask.any():
                with self.room.trying(number, changed):
                    for s, seed in enumerate(seeds):
                        found[s, place] = (self.room.render(each, seed, True) - whole[s]) / by
            if mask.any():
                samples = int(np.clip(DERIVATIVE_ENOUGH / mask.sum(), 1, 64))
                if number not in own:
                    own[number] = [self.room.pixels(mask, samples, seed, True) for seed in seeds]
                with self.room.trying(number, changed):
                    for s, seed in enumerate(seeds):
                        change = self.room.pixels(mask, samples, seed, True) - own[number][s]
                        found[s, place][mask] = change / by
            yield self._step("derivatives")
        return np.clip(found, -bound, bound)

    def _newton(
        self, kinds: Sequence[tuple[int, str]], derivatives: Array, residuals: Array, damping: float
    ) -> tuple[list[Array], list[Array]]:
        """Return the step of every kind and its deviation, (3,) of reflectances, (1,) of what all colours share."""
        columns, owner = [], []
        for place, (_, kind) in enumerate(kinds):
            coloured = kind in COLOURED
            for colour in range(3 if coloured else 1):
                column = np.zeros_like(derivatives[:, place])
                chosen = slice(colour, colour + 1) if coloured else slice(None)
                column[..., chosen] = derivatives[:, place][..., chosen]
                columns.append(column.reshape(2, -1))
                owner.append(place)
        used = self.weight.ravel() > 0
        jacobians = np.stack(columns, axis=1)[:, :, used]
        step, deviation = newton(jacobians, residuals.reshape(2, -1)[:, used], self.weight.ravel()[used], damping)
        power = (jacobians[0] * jacobians[1] * self.weight.ravel()[used]).sum(axis=1)
        for place, (number, kind) in enumerate(kinds):
            if kind == FREE[self.room.models[number].level][0] and self.seen[number] != "directly":
                told = power[np.array(owner) == place].max() > UNSEEN**2 * power.max()
                self.seen[number] = "in reflections" if told else "not at all"
        parts = [np.array(owner) == place for place in range(len(kinds))]
        return [step[part] for part in parts], [deviation[part] for part in parts]

    def _apply(self, kinds: Sequence[tuple[int, str]], step: list[Array], deviation: list[Array]) -> None:
        for (number, kind), by, spread in zip(kinds, step, deviation, strict=True):
            longest = LONGEST if kind != "angle" else 30.0
            self.room.show(number, moved(self.room.models[number], kind, np.clip(by, -longest, longest)))
            self.deviations[number][kind] = spread.tolist()

    def _residuals(self, samples: int) -> Array:
        """Return photograph less render by two seeds, (2, H, W, 3)."""
        return self.photograph - np.stack([self._render(samples) for _ in range(2)])

    def _even_residuals(self) -> Array:
        """Return the same, but groups of few pixels get more samples, so that all are judged alike."""
        residuals = self._residuals(LEVEL_SAMPLES)
        for mask in self.masks:
            samples = min(round(ENOUGH / max(mask.sum(), 1)), MOST_SAMPLES)
            if mask.any() and samples > self._samples(LEVEL_SAMPLES):
                for own in residuals:
                    own[mask] = self.photograph[mask] - self.room.pixels(mask, samples, self._next_seed())
        return residuals

    def _unexplained(self, residuals: Array, number: int) -> float:
        """Return the relative error of a group with render noise taken off, 0 where it is within noise."""
        mask = self.masks[number]
        if not mask.any():
            return 0.0
        mean, noise = unexplained(residuals[:, mask], self.weight[mask])
        return float(np.sqrt(mean)) if mean > STEADY * noise else 0.0

    def _render(self, samples: int) -> Array:
        return self.room.render(self._samples(samples), self._next_seed())

    def _samples(self, samples: int) -> int:
        """Return samples a pixel that make a small picture as certain as one of USUAL pixels."""
        return max(samples, round(samples * USUAL / self.masks[0].size))

    def _next_seed(self) -> int:
        self.seed += 1
        return self.seed

    def _out_of_time(self) -> bool:
        return time.perf_counter() - self.start > self.settings.budget

    def _step(self, stage: str) -> Progress:
        return Progress(stage, min(time.perf_counter() - self.start, self.settings.budget), self.settings.budget, "s")

    def _note(self, stage: str, residuals: Array) -> None:
        """Write down how well the photograph is explained now."""
        products = (residuals[0] * residuals[1])[self.weight > 0]
        power = float((self.photograph[self.weight > 0] ** 2).mean())
        error = float(np.sqrt(max(products.mean(), 0.0) / power))
        seconds = time.perf_counter() - self.start
        self.history.append({"stage": stage, "seconds": seconds, "error": error})
