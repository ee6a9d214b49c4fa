"""Lights and bases from the pictures of a few thousand pixels: several starts, the best end."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import LightsphereError
from ...progress import Progress, Work, retold
from .descent import MOST, Attempt, Problem, begun, bring_near, descend
from .joint import Joint
from .shadows import unexplained
from .start import TOO_DARK, first_lights, towards_known

Array = NDArray[np.float64]

HOPELESS = 1.5  # times the best cost after the rough phase: such a start is given up
PLAIN = 0.9  # of its cost, at which an end without lobes counts: broad ones also explain some of a wrong relief
HOLLOW = 1.1  # times its cost, at which a hollow end counts: raised bodies are more common
AS_GOOD = 1.1  # times the best cost: such an end is nearly as good
BROUGHT = (0.4, 0.15)  # reach of the object over the distance that near lights have at first
CHECKED = ("outline", "strengths", "surface")  # cues without which the lights are looked at again


@dataclass(frozen=True)
class Solution:
    """The best end, and how far others lie from it.

    Parameters
    ----------
    joint : Joint
    costs : tuple of float
        Of every end, the best first.
    doubtful : list of (L, N) float64
        Lights that are nearly as good: where other starts ended, and where it goes without one of the cues.
    course : tuple of float
        The best one's objective at every weighing, and at its end.
    nearer : float
        What is left of the objective of distant lights after a short look at near ones; 1 where they are near.
    """

    joint: Joint
    costs: tuple[float, ...]
    doubtful: list[Array]
    course: tuple[float, ...]
    nearer: float


@dataclass(frozen=True)
class End:
    """Where a descent ended.

    Parameters
    ----------
    joint : Joint
    course : tuple of float
        Its objective at every weighing.
    dark : float
        What :func:`.shadows.unexplained` says; 0 where shadows are not believed.
    """

    joint: Joint
    course: tuple[float, ...]
    dark: float

    @property
    def cost(self) -> float:
        """What ends are chosen by."""
        plain = PLAIN if "highlights" not in self.joint.known.cues else 1.0
        return plain * (HOLLOW if self.joint.hollow else 1.0) * (self.course[-1] + self.dark)


def solve(problem: Problem, before: Joint | None = None) -> Work[Solution]:
    """Find lights and bases from every start, and once more as if all were matt: lobes can lead astray where it is.

    Or begin with what was found before, of nearly the same pictures.

    Raises
    ------
    LightsphereError
        When the pictures leave nothing to start from.
    """
    if before is None:
        ends = yield from _ends(problem, _attempts(problem))
    else:
        ends = [(yield from _again(problem, before))]
    best = ends[0]
    doubtful = [end.joint.lights for end in ends[1:] if end.cost < AS_GOOD * best.cost]
    checks = [cue for cue in CHECKED if cue in best.joint.known.cues]
    total = len(checks) * MOST["fine"] + MOST["look"]
    for number, cue in enumerate(checks):
        without = dataclasses.replace(best.joint, known=best.joint.known.without(cue))
        yield from _counted(descend(without, problem, "fine"), "checks", number * MOST["fine"], total)
        doubtful.append(without.lights)
    nearer = 1.0
    if not problem.near:
        closer = dataclasses.replace(best.joint)
        bring_near(closer, problem.pictures, BROUGHT[-1])
        look = yield from _counted(descend(closer, problem, "look"), "checks", total - MOST["look"], total)
        nearer = look[-1] / best.course[-1]
    return Solution(best.joint, tuple(end.cost for end in ends), doubtful, best.course, nearer)


def _attempts(problem: Problem) -> list[Attempt]:
    """Return what is tried. Equal strengths at the object are none of near lights, whose falloff looks like shape."""
    known, pictures = problem.known, problem.pictures
    guess = np.where(np.isfinite(problem.proxy).all(axis=1, keepdims=True), problem.proxy, problem.outline.dome)
    starts = first_lights(pictures, guess)
    if len(known.lights):
        starts = [towards_known(lights, known.lights, known.directions) for lights in starts]
    if not starts:
        raise LightsphereError(TOO_DARK)
    if not problem.near:
        return [Attempt(lights, known) for lights in starts]
    return [Attempt(starts[0], known, start, away) for start in (None, guess) for away in BROUGHT]


def _ends(problem: Problem, attempts: Sequence[Attempt]) -> Work[list[End]]:
    """Return where descents end, the best first: rough ones from every start, finer ones from where that promises.

    The best is tried again as its twin, convex for concave, and the better of both without highlights.
    """
    total, ends = (len(attempts) + 2) * (MOST["rough"] + MOST["fine"]), list[End]()

    def rough(joint: Joint) -> Work[None]:
        work = descend(joint, problem, "rough")
        course = yield from _counted(work, "lights", len(ends) * MOST["rough"], total)
        ends.append(End(joint, course, _dark(problem, joint)))

    for attempt in attempts:
        yield from rough((yield from begun(problem, attempt)))
    best, attempt = min(zip(ends, attempts, strict=True), key=lambda pair: pair[0].cost)
    yield from rough(best.joint.twin())
    if "highlights" in problem.known.cues:
        best = min(ends, key=lambda end: end.cost)
        known = problem.known.without("highlights")
        matt = Attempt(best.joint.vectors, known, best.joint.normals, attempt.away)
        yield from rough((yield from begun(problem, matt)))
    done, least = len(ends) * MOST["rough"], min(end.cost for end in ends)
    ends = sorted((end for end in ends if end.cost <= HOPELESS * least), key=lambda end: end.cost)
    total, fine = done + len(ends) * MOST["fine"], list[End]()
    for number, end in enumerate(ends):
        work = descend(end.joint, problem, "fine")
        course = yield from _counted(work, "lights", done + number * MOST["fine"], total)
        fine.append(End(end.joint, end.course[:-1] + course, _dark(problem, end.joint)))
    return sorted(fine, key=lambda end: end.cost)


def _again(problem: Problem, before: Joint) -> Work[End]:
    pictures = problem.pictures
    joint = dataclasses.replace(
        before, values=pictures.values, lit=pictures.lit, usual=pictures.usual, noise=pictures.noise
    )
    course = yield from _counted(descend(joint, problem, "fine"), "lights", 0, MOST["fine"])
    return End(joint, course, _dark(problem, joint))


def _dark(problem: Problem, joint: Joint) -> float:
    return unexplained(problem.pictures, joint) if "shadows" in problem.known.cues else 0.0


def _counted(work: Work[tuple[float, ...]], stage: str, before: int, total: int) -> Work[tuple[float, ...]]:
    """Return work whose weighings count among all of a stage."""
    return (yield from retold(work, lambda step: Progress(stage, before + step.done, total, "weighings")))
