"""The search: diffuse everywhere, then for every group the simplest level that explains it, then all together."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.inverse import (
    COLOURED,
    DISTRIBUTIONS,
    FREE,
    LEVELS,
    POWER,
    InverseSettings,
    Model,
    known_reflectances,
    moved,
    uncertainty,
)
from ...core.inverse.estimate import noiseless_rmse
from ...core.inverse.photograph import Photograph
from ...core.inverse.radiosity import corrections
from ...core.progress import Progress, Work, retold
from .evidence import Evidence, worse
from .found import Found
from .groups import place_of
from .lamps import found_lamps, listed_lamps, start_lamps
from .levels import ANGLES, ENOUGH, Tried, examined, perfected, simplest
from .paint import paint
from .room import Room, State
from .settle import settle
from .together import Gains, Unknown, derivatives, reflections, sizes, step, unknowns

Array = NDArray[np.float64]
DIFFUSE_SAMPLES = (4, 4, 8, 16)  # of the rounds that begin a search
ROUNDS, LEVEL_SAMPLES = 8, 16  # of looking for levels
LEVELS_END = 0.6  # share of the budget after which that ends: the last moves are of all groups, and give the error bars
WORST = 0.4  # of the largest error: groups above it are looked at before the others
WORTH = 0.03  # relative error of a group below which no richer level is looked for
LOBES_HELP, NO_HELP = 0.85, 0.95  # of the error of a diffuse group: what leaves more is not explained by lobes
COARSE = 0.15  # relative error that is left, above which what varies smoothly has a texture: else it may be the light's
FINE = 0.35  # share of what is left that varies over few pixels, above which what lobes do not help has a texture
LAST_ROUNDS, LAST_SAMPLES, LAST_DAMPING = 60, 32, 0.03  # of the moves of all groups together that end a search
LAST_CLOSER = 10  # times the samples of their derivatives, whose noise leads all steps the same wrong way
CLOSER = 4  # times the samples by which lobes are looked at again
SETTLE_END = 0.8  # share of the budget after which lobes settle no more
SETTLED_TURNS = 3  # of their reflectances' steps, as if they had turned so often
MOVED = 0.02  # reflectance by which lobes that are looked at again may differ
NOTED_SAMPLES = 8  # a pixel of both pictures by which a stage's error is written down
PICTURE_SAMPLES = 8  # of a picture that is denoised


class Search:
    """One search in a room for what a photograph shows.

    Parameters
    ----------
    room : Room
    photograph : Photograph
        Of the room's size.
    settings : InverseSettings

    Raises
    ------
    LightsphereError
        For known reflectances or unknown lamps that the room does not have.
    """

    distributions: tuple[str, ...] = DISTRIBUTIONS
    scanned: tuple[float, ...] = ANGLES  # beside the direction of brushing that the photograph tells
    untried: tuple[str, ...] = ()  # levels

    def __init__(self, room: Room, photograph: Photograph, settings: InverseSettings) -> None:
        self.room, self.settings = room, settings
        self.start = time.perf_counter()
        names = [group.name for group in room.groups]
        for name, rho in known_reflectances(settings.known).items():
            number = place_of(name, names, "known reflectance", "group")
            room.known[number] = rho
            room.show(number, Model("diffuse", rho, np.zeros(3)))
        room.free_lamps = listed_lamps(room, settings.unknown_lamps)
        self.evidence = Evidence(room, photograph)
        self.masks = self.evidence.masks
        self.patterned: set[int] = set()  # groups whose picture no lobe explains
        self.tried: list[list[dict[str, Any]]] = [[] for _ in names]
        self.costs = [{"renders": 0.0, "seconds": 0.0} for _ in names]  # of what was rendered for one group alone
        self.turned: dict[int, int] = {}  # how often the steps of groups that settled have turned
        self.deviations: dict[Unknown, list[float]] = {}
        self.seen = ["directly" if mask.any() else "not at all" for mask in self.masks]
        self.history: list[dict[str, Any]] = []
        self.condition: float | None = None  # of the last step of all groups together
        self.pictures: dict[str, Array] = {}
        self.kept: tuple[State, dict[Unknown, list[float]]] | None = None

    def run(self) -> Work[Found]:
        """Search until the uncertainty asked for or the budget is reached; yield seconds of the budget."""
        yield from self._begin()
        for _ in range(ROUNDS):
            if self._spent() > LEVELS_END:
                break
            if not (yield from self._levels()):
                break
            yield from self._refine("refine", rounds=4, samples=8, damping=0.1, end=LEVELS_END)
        while (yield from self._look_again()) and self._spent() < LEVELS_END:
            yield from self._refine("refine", rounds=4, samples=8, damping=0.1, end=LEVELS_END)
        yield from self._settle()
        yield from self._refine("refine", rounds=LAST_ROUNDS, samples=LAST_SAMPLES, damping=LAST_DAMPING, least=1)
        for number, model in enumerate(self.room.models):
            self._choose(number, perfected(model))
        self._keep()
        return self._found()

    def _begin(self) -> Work[None]:
        """Let every group be diffuse, under lamps as strong as that tells."""
        if self.room.free_lamps:
            start_lamps(self.evidence)
        yield from self._diffuse()
        if self.room.free_lamps:
            yield from self._refine("lamps", rounds=6, samples=8, damping=0.03, end=LEVELS_END)

    def stopped(self) -> Found | None:
        """Show what was known when an error was last written down, and return that; None where nothing was yet."""
        if self.kept is None:
            return None
        state, self.deviations = self.kept
        self.room.set(state)
        return self._found()

    def _found(self) -> Found:
        room = self.room
        spread = [self._deviation(number) for number in range(len(room.groups))]
        lamps = found_lamps(room, [self.deviations.get((n, POWER), [None])[0] for n in room.free_lamps])
        pixels = [int(mask.sum()) for mask in self.masks]
        return Found(room.models, spread, self.seen, pixels, self.tried, self.costs, lamps, self.history, self.pictures)

    def _diffuse(self) -> Work[None]:
        """Let every group be diffuse: see :mod:`pipeline.core.inverse.radiosity`."""
        evidence, room = self.evidence, self.room
        seen = [number for number, mask in enumerate(self.masks) if mask.any() and number not in room.known]
        for samples in DIFFUSE_SAMPLES:
            shown = evidence.render(samples)
            ratios = np.array([evidence.ratio(shown, number) for number in seen]).reshape(-1, 3)
            factors = corrections(evidence.gains(shown, seen, samples), ratios)
            for number, factor in zip(seen, factors, strict=True):
                room.show(number, moved(room.models[number], "diffuse", np.log(factor)))
            yield self._step("diffuse")
        self.room.count_bounces()
        self._note("diffuse", self.evidence.residuals(NOTED_SAMPLES))
        self._picture("diffuse")

    def _levels(self) -> Work[bool]:
        """Look for a level for every group whose picture is not explained; return whether one changed.

        What no level explains has a texture; that is said of one group at a time, of the one that is explained least,
        and not before all other groups have their level, unless it is a fine pattern that lobes do nothing for: what is
        wrong elsewhere shows in reflections.
        """
        evidence = self.evidence
        residuals = evidence.residuals(LEVEL_SAMPLES, ENOUGH)
        errors = evidence.errors(residuals)
        waiting, changed = sorted(self.patterned), False
        for number in self._open(errors):
            if self._spent() > LEVELS_END:
                break
            before = self.room.models[number].level
            best = yield from self._examined(number)
            if before == "texture" and self._left(number) > WORTH:
                self._paint(number)
                continue
            self._choose_better(number, best)
            changed |= best.level != before
            if self._help(number) >= LOBES_HELP and self.room.layers[number] and self.settings.levels == "all":
                self.patterned.add(number)
        fine = {number: evidence.fine_share(residuals, number) > FINE for number in self.patterned}
        plain = [number for number, is_fine in fine.items() if is_fine and self._help(number) > NO_HELP]
        still = [number for number in waiting if errors[number] > (WORTH if fine[number] else COARSE)]
        if chosen := sorted(plain if changed else still, key=self._left)[-1:]:
            self._paint(chosen[0])
            self.patterned.clear()  # the others may look otherwise now
            changed = True
        self._note("levels", self.evidence.residuals(NOTED_SAMPLES))
        self._picture("levels")
        return changed or len(self.patterned) > len(waiting)  # one that waits now is heard in the next round

    def _open(self, errors: list[float]) -> list[int]:
        """Return the groups whose error asks for another level, the worst first."""
        settled = self.patterned | set(self.room.known)
        left = [0.0 if number in settled else error for number, error in enumerate(errors)]
        return [number for number in map(int, np.argsort(left)[::-1]) if left[number] > max(WORTH, WORST * max(left))]

    def _look_again(self) -> Work[bool]:
        """Look at lobes and textures again with the surroundings as they are now: the wrong ones bent them before.

        Return whether a level changed, or a reflectance by more than MOVED: what it lights may look otherwise then.
        """
        before = list(self.room.models)
        levels = [model.level for model in before]
        textured = [number for number, level in enumerate(levels) if level == "texture"]
        for number in textured:  # what lobes reflect
            self._paint(number)
        glossy = [number for number, level in enumerate(levels) if level not in ("diffuse", "texture")]
        for number in sorted(glossy, key=self._help, reverse=True):  # the least sure levels first
            if self._spent() < LEVELS_END:
                best = yield from self._examined(number, closer=CLOSER)
                self._choose_better(number, best)
        for number in textured:
            if self._spent() < LEVELS_END:
                yield from self._paint_if_needed(number)
        by = [np.abs(now.specular - old.specular).max() for now, old in zip(self.room.models, before, strict=True)]
        return levels != [model.level for model in self.room.models] or max(by) > MOVED

    def _settle(self) -> Work[None]:
        """Let the shapes of lobes settle by many samples, those that the fewest pixels show first."""
        glossy = [number for number, model in enumerate(self.room.models) if "alpha" in FREE[model.level]]
        for number in sorted(glossy, key=lambda n: int(self.masks[n].sum())):
            work, before = settle(self.evidence, number), self.room.models[number]
            with self.room.counted(self.costs[number]), contextlib.closing(work):
                while self._spent() < SETTLE_END and next(work, None):
                    yield self._step("settle")
            if self.room.models[number] is not before:
                self.turned[number] = SETTLED_TURNS

    def _choose_better(self, number: int, model: Model) -> None:
        """Choose a model unless what its level leaves free is told better by all groups together, or by their ratio."""
        before = self.room.models[number].level
        if model.level != before or "alpha" in FREE[before]:
            self._choose(number, model)

    def _choose(self, number: int, model: Model) -> None:
        """Let a group have a model; deviations of what that does not have are forgotten."""
        self.room.show(number, model)
        kept = (POWER, *(FREE[model.level] if model.level != "texture" else ()))
        self.deviations = {(n, kind): sd for (n, kind), sd in self.deviations.items() if n != number or kind in kept}

    def _examined(
        self,
        number: int,
        choose: Callable[[list[Tried]], Tried] = simplest,
        most: str = "anisotropic",
        denoised: bool = False,
        closer: int = 1,
    ) -> Work[Model]:
        """Return the best model of a group without a texture; of denoised pictures one seed tells all."""
        evidence = self.evidence
        seed = evidence.next_seed()
        seeds = seed, seed if denoised else evidence.next_seed()
        if self.settings.levels != "all":
            most = min(most, self.settings.levels, key=LEVELS.index)
        levels = [level for level in LEVELS[: LEVELS.index(most) + 1] if level not in self.untried]
        self.room.paint(number, None)
        mask, weight, photograph = self.masks[number], evidence.weight, evidence.photograph
        angle = evidence.brushing(number)
        angles = ANGLES if angle is None else (*self.scanned, angle)
        rest = (choose, denoised, closer, self.distributions, angles)
        work = examined(self.room, number, mask, photograph, weight, levels, seeds, *rest)
        told = partial(self._step, f"levels of {self.room.groups[number].name}")
        with self.room.counted(self.costs[number]):
            model, self.tried[number] = yield from retold(work, told)
        return model

    def _left(self, number: int) -> float:
        """Return the relative error that the best lobe leaves of a group."""
        return float(min(self.tried[number], key=lambda one: one["surely_below"])["error"])

    def _help(self, number: int) -> float:
        """Return what share of a diffuse group's error the best lobe leaves."""
        return self._left(number) / max(self.tried[number][0]["error"], 1e-12)

    def _paint(self, number: int) -> None:
        """Give a group's pixels the texture that they show; it leaves no error by its making."""
        if all(one["level"] != "texture" for one in self.tried[number]):
            self.tried[number].append({"level": "texture", "error": 0.0, "surely_below": 0.0})
        self._choose(number, Model("texture", np.ones(3), np.zeros(3)))
        with self.room.counted(self.costs[number]):
            paint(self.evidence, number)

    def _paint_if_needed(self, number: int) -> Work[None]:
        """Paint a texture anew with the surroundings as they are now, unless one reflectance explains the group now."""
        plain = yield from self._examined(number, most="diffuse")
        if self._left(number) > WORTH:
            self._paint(number)
        else:
            self._choose(number, plain)

    def _refine(
        self, stage: str, rounds: int, samples: int, damping: float, end: float = 1.0, least: int = 0
    ) -> Work[None]:
        """Let all reflectances of all groups move together: Gauss-Newton, the derivatives by renders of the same seed.

        The shapes of lobes stay: the picture is no straight function of them. They are moved by searches, and are among
        the unknowns here where error bars of all are stated.
        A step that more than doubles the least error is taken back, the next is shorter. A parameter whose step changes
        its sign goes in shorter steps from then on (Kesten 1958), so that it settles in the mean of what noise makes of
        it.
        """
        if self._spent() > end and not least:
            return
        evidence, wanted = self.evidence, unknowns(self.room, shapes=least > 0)
        if not wanted:  # all is known, or a texture
            return
        free = [place for place, (_, kind) in enumerate(wanted) if kind in (*COLOURED, POWER)]
        closer, enough = (LAST_CLOSER, ENOUGH) if least else (1, 0)
        measured = yield from retold(derivatives(evidence, wanted, closer), partial(self._step, "derivatives"))
        there, mirrored = sizes(self.room, wanted), reflections(evidence, wanted, measured)
        best: tuple[tuple[float, float], State, Array] | None = None
        damped = damping
        moving = [wanted[place] for place in free]
        gains = Gains(moving, self.turned)
        lasted: list[float] = []  # of rounds, as shares of the budget
        for turn in range(rounds):
            begun = self._spent()
            if begun + np.median(lasted[-3:] or [0.0]) > end and turn >= least:  # whatever disturbed a single one
                break
            residuals = evidence.residuals(samples, enough, mirrored)
            error = evidence.error(residuals)
            if best is not None and worse(error, best[0]):
                self.room.set(best[1])
                residuals, damped = best[2], 10 * damped
            else:
                damped = max(damping, damped / 10)
                if best is None or error < best[0]:
                    best = error, self.room.state(), residuals
            slopes = measured * (sizes(self.room, wanted) / there)[:, None, None]
            moves, spread, untold, self.condition = step(evidence, moving, slopes[:, free], residuals, damped)
            if len(free) < len(wanted) or damped > damping:  # what holds steps back makes nothing surer
                _, spread, _, self.condition = step(evidence, wanted, slopes, residuals, damping)
            self.deviations |= {unknown: sd.tolist() for unknown, sd in zip(wanted, spread, strict=True)}
            for place, gain, by in zip(free, gains.of(moves), moves, strict=True):
                self.room.move(*wanted[place], gain * by)
                self.deviations[wanted[place]] = (np.sqrt(gain) * spread[place]).tolist()
            self._look(moving, untold)
            self._note(stage, residuals)
            yield self._step(stage)
            lasted.append(self._spent() - begun)
            if min(n.min() for n in gains.turns) >= 2 and self.uncertainty() < self.settings.target / 100:
                break
        if best is not None and worse(evidence.error(evidence.residuals(samples)), best[0]):  # the last step, too
            self.room.set(best[1])
            self._keep()
        if self.room.free_lamps:
            for number, model in enumerate(self.room.models):
                if model.level == "texture":  # under the light as it is now
                    paint(evidence, number)
            self._keep()
        self._picture(stage)

    def _look(self, wanted: list[Unknown], untold: set[int]) -> None:
        """Say of groups that no pixel shows whether reflections tell of them."""
        for number in {number for number, kind in wanted if kind != POWER}:
            if self.seen[number] != "directly":
                self.seen[number] = "not at all" if number in untold else "in reflections"

    def _picture(self, stage: str) -> None:
        """Keep what the room looks like, for the eye."""
        samples = self.evidence.samples(PICTURE_SAMPLES)
        self.pictures[stage] = self.room.render(samples, self.evidence.next_seed(), denoised=True)

    def uncertainty(self, only_seen: bool = False) -> float:
        """Return the largest relative deviation of the reflectances, of what the picture tells of, or shows itself."""
        told = ("directly",) if only_seen else ("directly", "in reflections")
        counted = [number for number, word in enumerate(self.seen) if word in told]
        return max(
            (uncertainty(self.room.models[n].as_json() | {"deviation": self._deviation(n)}) for n in counted),
            default=0.0,
        )

    def _deviation(self, number: int) -> dict[str, list[float]]:
        """Return the deviations of a group's parameters."""
        return {kind: sd for (n, kind), sd in self.deviations.items() if n == number and kind != POWER}

    def _spent(self) -> float:
        """Return what share of the budget is spent."""
        return (time.perf_counter() - self.start) / self.settings.budget

    def _step(self, stage: str, _: Progress | None = None) -> Progress:
        return Progress(stage, min(self._spent(), 1.0) * self.settings.budget, self.settings.budget, "s")

    def _note(self, stage: str, residuals: Array) -> None:
        """Write down how well the photograph is explained now, and what is known."""
        seconds = time.perf_counter() - self.start
        evidence = self.evidence
        error = noiseless_rmse(residuals, evidence.photograph, evidence.weight[..., 0] > 0)
        diffuse = {group.name: m.diffuse.tolist() for group, m in zip(self.room.groups, self.room.models, strict=True)}
        noted = {"stage": stage, "seconds": seconds, "error": error, "condition": self.condition, "diffuse": diffuse}
        self.history.append(noted)
        self._keep()

    def _keep(self) -> None:
        self.kept = self.room.state(), dict(self.deviations)
