"""Lights and bases from the pictures of a few thousand pixels: several starts, the best end."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from ...errors import LightsphereError
from ...progress import Progress, Work, retold
from ..photometric.sight import Sight
from ..photometric.start import begin, clusters
from . import lobes
from .joint import PARTS_OF_A_STEP, Joint
from .known import Known
from .outline import Outline
from .pictures import Pictures, surface_points
from .start import first_lights, towards_known

Array = NDArray[np.float64]

MIXED = 0.02  # share that every basis has of every pixel at first
MOST = (6, 24, 5)  # weighings of the values in the phases of a descent, at most
SETTLED = 0.0005  # relative fall of the objective between two weighings that is none, twice in a row
HOPELESS = 3.0  # times the best objective: such a start is given up
REWEIGHED = 5  # steps between two weighings of the values
LONGEST = sum(MOST) * REWEIGHED  # steps of a descent, at most
AS_GOOD = 1.1  # times the best objective: such an end is nearly as good
BROUGHT = (0.4, 0.15)  # reach of the object over the distance that near lights have at first


@dataclass(frozen=True)
class Solution:
    """The best end, and how far others lie from it.

    Parameters
    ----------
    joint : Joint
    objectives : tuple of float
        Of every start, the best first.
    doubtful : list of (L, N) float64
        Lights that are nearly as good: where other starts ended, and where it goes without one of the cues.
    course : tuple of float
        The best one's objective every :data:`REWEIGHED` steps, and at its end.
    nearer : float
        What is left of the objective of distant lights after a short look at near ones; 1 where they are near.
    """

    joint: Joint
    objectives: tuple[float, ...]
    doubtful: list[Array]
    course: tuple[float, ...]
    nearer: float


@dataclass(frozen=True)
class Problem:
    """What lights and bases are sought for.

    Parameters
    ----------
    pictures : Pictures
    outline : Outline
    bases : int
        The most that are told apart.
    scatter : float
        Standard deviation of the logarithm of the lights' strengths.
    known : Known
    proxy : (P, 3) float64
        Normals of a rough mesh, NaN where not known.
    near : bool
        Whether lights stand so near that the object's points see them in other directions.
    together : bool
        Whether all unknowns move at once, or pixels, lights and bases in turn.
    """

    pictures: Pictures
    outline: Outline
    bases: int
    scatter: float
    known: Known
    proxy: Array
    near: bool
    together: bool


@dataclass(frozen=True)
class Attempt:
    """Where a descent begins.

    Parameters
    ----------
    lights : (L, 3) float64
    known : Known
    normals : (P, 3) float64, optional
        Left out where each pixel's own fit under these lights tells them.
    away : float
        Reach of the object over the lights' distance; 0 for distant lights.
    """

    lights: Array
    known: Known
    normals: Array | None = None
    away: float = 0.0


def solve(problem: Problem) -> Work[Solution]:
    """Find lights and bases from every start, and once more as if all were matt: lobes can lead astray where it is.

    Raises
    ------
    LightsphereError
        When the pictures leave nothing to start from.
    """
    known, pictures = problem.known, problem.pictures
    guess = np.where(np.isfinite(problem.proxy).all(axis=1, keepdims=True), problem.proxy, problem.outline.dome)
    starts = first_lights(pictures.gray, pictures.lit > 0, guess)
    if len(known.lights):
        starts = [towards_known(lights, known.lights, known.directions) for lights in starts]
    if not starts:
        raise LightsphereError("too few pixels are lit in most photographs; photograph with lamps nearer to the camera")
    attempts = _attempts(problem, starts, guess)
    total = (len(attempts) + len(known.cues) + 1) * LONGEST
    ends: list[tuple[list[float], Joint]] = []
    for number, attempt in enumerate(attempts):
        joint = yield from _begun(problem, attempt)
        best = min((course[-1] for course, _ in ends), default=np.inf)
        descent = _descend(joint, problem, (0, 1), best)
        course = yield from _counted(descent, number * LONGEST, total)
        ends.append((course, joint))
    ends.sort(key=lambda end: end[0][-1])
    course, least = ends[0]
    doubtful = [end.lights for other, end in ends[1:] if other[-1] < AS_GOOD * course[-1]]
    for number, cue in enumerate(sorted(least.known.cues - {"highlights"}), start=len(attempts)):
        without = dataclasses.replace(least, known=least.known.without(cue))
        yield from _counted(_descend(without, problem, (1,)), number * LONGEST, total)
        doubtful.append(without.lights)
    nearer = 1.0
    if not problem.near:
        closer = dataclasses.replace(least)
        _bring_near(closer, pictures, BROUGHT[-1])
        look = yield from _counted(_descend(closer, problem, (2,)), total - LONGEST, total)
        nearer = look[-1] / course[-1]
    return Solution(least, tuple(other[-1] for other, _ in ends), doubtful, tuple(course), nearer)


def _bring_near(joint: Joint, pictures: Pictures, away: float) -> None:
    """Make the distances of distant lights unknowns, the reach of the object over them some number at first."""
    joint.place(surface_points(pictures, joint.normals))
    joint.lights = np.hstack([joint.lights, np.full((len(joint.lights), 1), away / joint.reach)])


def _attempts(problem: Problem, starts: Sequence[Array], guess: Array) -> list[Attempt]:
    """Return what is tried. Equal strengths at the object are none of near lights, whose falloff looks like shape."""
    known = problem.known
    if problem.near:
        normals = (None, guess)
        attempts = [Attempt(starts[0], known, start, away) for start in normals for away in BROUGHT]
    else:
        attempts = [Attempt(lights, known) for lights in starts]
    if "highlights" in known.cues:
        attempts.append(dataclasses.replace(attempts[0], known=known.without("highlights")))
    return attempts


def _counted(work: Work[list[float]], before: int, total: int) -> Work[list[float]]:
    """Return work whose steps count among all."""
    return (yield from retold(work, lambda step: Progress("lights", before + step.done, total, "steps")))


def _descend(joint: Joint, problem: Problem, phases: tuple[int, ...], best: float = np.inf) -> Work[list[float]]:
    """Minimise from where the state is until it settles, and return the objective every few steps.

    In phase 0 normals are too wrong yet to tell of a surface, in phase 1 they do, phase 2 is a short look. Under near
    lights the surface is put where the normals say before every weighing. A descent that is far above the best
    objective known so far, when it has settled once, is given up. The state is weighed in the end.
    """
    pictures, course, done = problem.pictures, list[float](), 0
    for phase in phases:
        before = len(course)
        while len(course) < before + MOST[phase] and not _settled(course[before:]):
            if joint.near:
                joint.place(surface_points(pictures, joint.normals))
            joint.weigh()
            if phase:
                joint.believe_surface(pictures.mask, pictures.rays, pictures.pinhole)
            course.append(joint.objective())
            for _ in range(REWEIGHED):
                moving = PARTS_OF_A_STEP if problem.together else PARTS_OF_A_STEP[done % 3 : done % 3 + 1]
                joint.step(frozenset(moving))
                done += 1
                yield Progress("lights", done, LONGEST, "steps")
        if course[-1] > HOPELESS * best:
            break
    joint.weigh()
    joint.believe_surface(pictures.mask, pictures.rays, pictures.pinhole)
    return [*course, joint.objective()]


def _settled(course: Sequence[float]) -> bool:
    """Return whether the objective hardly fell, twice in a row."""
    return len(course) > 2 and min(course[-1] / course[-2], course[-2] / course[-3]) > 1.0 - SETTLED


def _begun(problem: Problem, attempt: Attempt) -> Work[Joint]:
    """Return the state with each pixel fitted by itself under the first lights, and bases of the pixels alike."""
    pictures, lights = problem.pictures, attempt.lights
    strength = np.linalg.norm(lights, axis=1, keepdims=True)
    values = (pictures.values / strength).astype(np.float32)
    views = pictures.views
    sight = Sight(
        values, pictures.usable.astype(np.float32), np.ascontiguousarray(lights / strength), False,
        np.zeros_like(views), views,
    )  # fmt: skip
    start = yield from retold(begin(sight), lambda step: dataclasses.replace(step, stage="pixels"))
    owner = clusters(start.features, problem.bases)
    count = int(owner.max(initial=0)) + 1
    weights = np.repeat(MIXED * start.albedo[:, None], count, axis=1)
    weights[np.arange(len(owner)), owner] += start.albedo
    coefficients = np.stack([_fitted(pictures, owner == k, start.normals, weights[:, k], lights) for k in range(count)])
    joint = Joint(
        pictures.values,
        pictures.lit,
        pictures.usual,
        pictures.noise,
        views,
        problem.outline,
        (start.normals if attempt.normals is None else attempt.normals).copy(),
        weights,
        lights,
        coefficients,
        problem.scatter,
        attempt.known,
        problem.proxy,
    )
    if attempt.away:
        _bring_near(joint, pictures, attempt.away)
    return joint


def _fitted(pictures: Pictures, own: NDArray[np.bool_], normals: Array, weight: Array, lights: Array) -> Array:
    """Return the coefficients (J, 3) >= 0 of one basis from the pixels that are its own."""
    normal, view = normals[own], pictures.views[own]
    facing = normal @ lights.T
    direction = lights / np.linalg.norm(lights, axis=1, keepdims=True)
    half = direction + view[:, None]
    half /= np.linalg.norm(half, axis=2, keepdims=True)
    cos_h = np.minimum(np.einsum("plk,pk->pl", half, normal), 1.0)
    cos_o = np.broadcast_to(np.maximum((normal * view).sum(axis=1), lobes.LEAST_FACING)[:, None], cos_h.shape)
    seen = (pictures.lit[own] > 0) & (facing > 0)
    trust = 1.0 / np.maximum(pictures.gray[own], pictures.usual[own, None])[seen]
    functions = lobes.evaluated(cos_h[seen], np.maximum(normal @ direction.T, lobes.LEAST_FACING)[seen], cos_o[seen])
    functions *= (facing * weight[own, None])[seen][:, None] * trust[:, None]
    if not len(functions):
        return np.eye(lobes.COUNT)[:, :1].repeat(3, axis=1)
    targets = pictures.values[own][seen] * trust[:, None]
    return np.asarray(np.stack([nnls(functions, targets[:, colour])[0] for colour in range(3)], axis=1))
