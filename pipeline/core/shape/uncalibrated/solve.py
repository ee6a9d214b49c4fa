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
from .joint import CUES, Joint
from .outline import Outline
from .pictures import Pictures
from .start import first_lights

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
    """

    joint: Joint
    objectives: tuple[float, ...]
    doubtful: list[Array]


def solve(pictures: Pictures, outline: Outline, bases: int, scatter: float) -> Work[Solution]:
    """Find lights and bases.

    Raises
    ------
    LightsphereError
        When the pictures leave nothing to start from.
    """
    starts = first_lights(pictures.gray, pictures.lit > 0, outline.dome)
    if not starts:
        raise LightsphereError("too few pixels are lit in most photographs; photograph with lamps nearer to the camera")
    total = len(starts) * STEPS + len(CUES) * STEPS_WITHOUT
    ends = []
    for number, lights in enumerate(starts):
        joint = yield from _begun(pictures, outline, lights, bases, scatter)
        yield from _descend(joint, pictures, STEPS, number * STEPS, total)
        ends.append((joint.objective(), joint))
    ends.sort(key=lambda end: end[0])
    best = ends[0][1]
    doubtful = [end.lights for objective, end in ends[1:] if objective < AS_GOOD * ends[0][0]]
    for number, cue in enumerate(sorted(CUES)):
        without = dataclasses.replace(best, believes=CUES - {cue})
        yield from _descend(without, pictures, STEPS_WITHOUT, len(starts) * STEPS + number * STEPS_WITHOUT, total)
        doubtful.append(without.lights)
    return Solution(best, tuple(objective for objective, _ in ends), doubtful)


def _descend(joint: Joint, pictures: Pictures, steps: int, before: int, total: int) -> Work[None]:
    """Minimise from where the state is; it is weighed in the end."""
    for done in range(steps):
        if done % REWEIGHED == 0:
            joint.weigh()
            if done >= SURFACE_FROM * STEPS or steps < STEPS:
                joint.believe_surface(pictures.mask, pictures.rays, pictures.pinhole)
        joint.step()
        yield Progress("lights", before + done + 1, total, "steps")
    joint.weigh()
    joint.believe_surface(pictures.mask, pictures.rays, pictures.pinhole)


def _begun(pictures: Pictures, outline: Outline, lights: Array, bases: int, scatter: float) -> Work[Joint]:
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
