"""A descent: from first lights to bases and normals that explain the pictures with them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from ...progress import Progress, Work, retold
from ..photometric.sight import Sight
from ..photometric.start import begin, clusters
from . import lobes
from .joint import Joint
from .known import Known
from .outline import Outline
from .pictures import Pictures, surface_points

Array = NDArray[np.float64]

MIXED = 0.02  # share that every basis has of every pixel at first
MOST = {"rough": 6, "fine": 24, "look": 5}  # weighings of the values in the phases of a descent, at most
SETTLED = 0.0005  # relative fall of the objective between two weighings that is none, twice in a row
EXPLAINED = 1e-3  # cost of a value below which none has to fall: it is off by 3 % of what it may be
REWEIGHED = 5  # steps between two weighings of the values


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
    """

    pictures: Pictures
    outline: Outline
    bases: int
    scatter: float
    known: Known
    proxy: Array
    near: bool


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


def descend(joint: Joint, problem: Problem, phase: str) -> Work[tuple[float, ...]]:
    """Minimise from where the state is until it settles, and return the objective every few steps.

    In the rough phase normals are too wrong yet to tell of a surface; the look is a short fine phase. Under near lights
    the surface is put where the normals say before every weighing. The state is weighed in the end.
    """
    pictures, course = problem.pictures, list[float]()
    least = EXPLAINED * float(joint.lit.sum())
    while len(course) < MOST[phase] and not _settled(course, least):
        if joint.near:
            joint.place(surface_points(pictures, joint.normals))
        joint.weigh()
        if phase != "rough":
            joint.believe(pictures.mask, pictures.rays, pictures.pinhole)
        course.append(joint.objective())
        for _ in range(REWEIGHED):
            joint.step()
        yield Progress("lights", len(course), MOST[phase], "weighings")
    joint.weigh()
    joint.believe(pictures.mask, pictures.rays, pictures.pinhole)
    return (*course, joint.objective())


def _settled(course: Sequence[float], least: float) -> bool:
    """Return whether the objective hardly fell, twice in a row, or hardly by what would be nothing to it."""
    falls = [(before - after) / (before + least) for before, after in pairwise(course[-3:])]
    return len(falls) == 2 and max(falls) < SETTLED


def bring_near(joint: Joint, pictures: Pictures, away: float) -> None:
    """Make the distances of distant lights unknowns, the reach of the object over them some number at first."""
    joint.place(surface_points(pictures, joint.normals))
    joint.lights = np.hstack([joint.lights, np.full((len(joint.lights), 1), away / joint.reach)])


def begun(problem: Problem, attempt: Attempt) -> Work[Joint]:
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
        bring_near(joint, pictures, attempt.away)
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
