"""Lights and bases from the pictures of a few thousand pixels: several starts, the best end."""

from __future__ import annotations

import dataclasses
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
from .pictures import Pictures
from .start import first_lights, towards_known

Array = NDArray[np.float64]

MIXED = 0.02  # share that every basis has of every pixel at first
STEPS = 60  # of the joint minimisation
REWEIGHED = 5  # every so many steps the values are weighed anew
SURFACE_FROM = 0.5  # of the steps; before, normals are too wrong to tell of a surface
STEPS_WITHOUT = 30  # from the best end, without one of the cues
AS_GOOD = 1.1  # times the best objective: such an end is nearly as good


@dataclass(frozen=True)
class Solution:
    """The best end, and how far others lie from it.

    Parameters
    ----------
    joint : Joint
    objectives : tuple of float
        Of every start, the best first.
    doubtful : list of (L, 3) float64
        Lights that are nearly as good: where other starts ended, and where it goes without one of the cues.
    course : tuple of float
        The best one's objective every :data:`REWEIGHED` steps, and at its end.
    """

    joint: Joint
    objectives: tuple[float, ...]
    doubtful: list[Array]
    course: tuple[float, ...]


def solve(
    pictures: Pictures, outline: Outline, bases: int, scatter: float, known: Known, proxy: Array, together: bool = True
) -> Work[Solution]:
    """Find lights and bases.

    Parameters
    ----------
    pictures : Pictures
    outline : Outline
    bases : int
    scatter : float
        Standard deviation of the logarithm of the lights' strengths.
    known : Known
    proxy : (P, 3) float64
        Normals of a rough mesh, NaN where not known.
    together : bool
        Whether all unknowns move at once, or pixels, lights and bases in turn.

    Raises
    ------
    LightsphereError
        When the pictures leave nothing to start from.
    """
    guess = np.where(np.isfinite(proxy).all(axis=1, keepdims=True), proxy, outline.dome)
    starts = first_lights(pictures.gray, pictures.lit > 0, guess)
    if len(known.lights):
        starts = [towards_known(lights, known.lights, known.directions) for lights in starts]
    if not starts:
        raise LightsphereError("too few pixels are lit in most photographs; photograph with lamps nearer to the camera")
    left_out = sorted(known.cues - {"highlights"})
    total = len(starts) * STEPS + len(left_out) * STEPS_WITHOUT
    ends = []
    for number, lights in enumerate(starts):
        joint = yield from _begun(pictures, outline, lights, bases, scatter, known, proxy)
        course = yield from _descend(joint, pictures, STEPS, number * STEPS, total, together)
        ends.append((course, joint))
    ends.sort(key=lambda end: end[0][-1])
    (course, best), least = ends[0], ends[0][0][-1]
    doubtful = [end.lights for other, end in ends[1:] if other[-1] < AS_GOOD * least]
    for number, cue in enumerate(left_out):
        without = dataclasses.replace(best, known=dataclasses.replace(known, cues=known.cues - {cue}))
        before = len(starts) * STEPS + number * STEPS_WITHOUT
        yield from _descend(without, pictures, STEPS_WITHOUT, before, total, together)
        doubtful.append(without.lights)
    return Solution(best, tuple(other[-1] for other, _ in ends), doubtful, tuple(course))


def _descend(
    joint: Joint, pictures: Pictures, steps: int, before: int, total: int, together: bool
) -> Work[list[float]]:
    """Minimise from where the state is, and return the objective every few steps; the state is weighed in the end."""
    course = []
    for done in range(steps):
        if done % REWEIGHED == 0:
            joint.weigh()
            if done >= SURFACE_FROM * STEPS or steps < STEPS:
                joint.believe_surface(pictures.mask, pictures.rays, pictures.pinhole)
            course.append(joint.objective())
        joint.step(frozenset(PARTS_OF_A_STEP if together else PARTS_OF_A_STEP[done % 3 : done % 3 + 1]))
        yield Progress("lights", before + done + 1, total, "steps")
    joint.weigh()
    joint.believe_surface(pictures.mask, pictures.rays, pictures.pinhole)
    return [*course, joint.objective()]


def _begun(
    pictures: Pictures, outline: Outline, lights: Array, bases: int, scatter: float, known: Known, proxy: Array
) -> Work[Joint]:
    """Return the state with each pixel fitted by itself under the first lights, and bases of the pixels alike."""
    strength = np.linalg.norm(lights, axis=1, keepdims=True)
    values = (pictures.values / strength).astype(np.float32)
    views = pictures.views
    sight = Sight(
        values, pictures.usable.astype(np.float32), np.ascontiguousarray(lights / strength), False,
        np.zeros_like(views), views,
    )  # fmt: skip
    start = yield from retold(begin(sight), lambda step: dataclasses.replace(step, stage="pixels"))
    owner = clusters(start.features, bases)
    count = int(owner.max(initial=0)) + 1
    weights = np.repeat(MIXED * start.albedo[:, None], count, axis=1)
    weights[np.arange(len(owner)), owner] += start.albedo
    coefficients = np.stack([_fitted(pictures, owner == k, start.normals, weights[:, k], lights) for k in range(count)])
    return Joint(
        pictures.values,
        pictures.lit,
        pictures.usual,
        pictures.noise,
        views,
        outline,
        start.normals.copy(),
        weights,
        lights,
        coefficients,
        scatter,
        known,
        proxy,
    )


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
