"""Where the alternation begins: albedo by the brightness's rank, lights by factorisation, their mean on the axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ....errors import LightsphereError
from ..certainty import SAID_EQUAL
from ..descent import Problem
from ..pictures import Pictures, surface_points
from ..start import ENOUGH, TOO_DARK, equally_strong, factorise, fitted_to, mean_strength_one, rows, towards_known
from .state import TINY, State
from .surface import triangulated

Array = NDArray[np.float64]

RANK = 0.9  # quantile of a pixel's lit values that tells its albedo
ROUNDS, WIDTH = 10, 0.1  # of fitting a pixel's normal, and the misfit over its usual value at which a value counts half
SMOOTHNESS = 1e-3  # of the surface
RIDGE = 1e-6  # of what nothing lights, over its usual value, towards the view
BRIGHTER = 1.5  # times what the normal shows: such a value is a highlight


def first_lights(problem: Problem) -> list[Array]:
    """Return the lights (L, 3) that the source begins with, and those under which a dome fits the values best.

    The values are divided by the albedo, which is the value of one rank among a pixel's lit ones, and factorised.

    Raises
    ------
    LightsphereError
        When too few pixels see enough lights.
    """
    pictures, lit = problem.pictures, problem.pictures.lit > 0
    kept = lit.sum(axis=1) >= ENOUGH * lit.shape[1]
    if kept.sum() < 3:
        raise LightsphereError(TOO_DARK)
    there = np.isfinite(problem.proxy).all(axis=1, keepdims=True)
    guess = np.where(there, problem.proxy, problem.outline.dome)[kept]
    scaled = pictures.gray[kept] / _ranked(pictures)[kept, None]
    lights, normals, _ = factorise(scaled, lit[kept])
    own = _on_the_axis(problem, *_told_apart(lights, normals, problem.scatter), guess)
    domed = lights @ np.linalg.lstsq(lights, fitted_to(scaled, lit[kept], guess), rcond=None)[0]
    sets, known = [own, domed], problem.known
    if len(known.lights):
        sets = [towards_known(one, known.lights, known.directions) for one in sets]
    return [mean_strength_one(one) for one in sets]


def begun(problem: Problem, vectors: Array) -> State:
    """Return the first state under some lights (L, 3), without materials."""
    pictures = problem.pictures
    pixels, shown = _normals(pictures, vectors)
    colour = (pictures.lit[..., None] * pictures.values).sum(axis=1)
    colour /= np.maximum(colour.mean(axis=1, keepdims=True), TINY)
    points = surface_points(pictures, pixels)
    length = ((points - pictures.rays[:, :3]) * pictures.rays[:, 3:]).sum(axis=1)
    strengths = np.linalg.norm(vectors, axis=1)
    held = np.isin(np.arange(len(vectors)), problem.known.lights)
    directions = vectors / strengths[:, None]
    directions[problem.known.lights] = problem.known.directions
    return State(
        pictures=pictures,
        surface=triangulated(pictures, SMOOTHNESS),
        highlights=np.where(pictures.gray > BRIGHTER * shown, pictures.lit, 0.0),
        scatter=problem.scatter,
        held=held,
        normals=pixels,
        albedo=_ranked(pictures)[:, None] * colour,
        unknown=np.log(length) if pictures.pinhole else length,
        directions=directions,
        strengths=strengths,
        weights=np.zeros((len(pixels), 0)),
        tints=np.zeros((0, 3)),
        widths=np.zeros(0),
    )


def _told_apart(lights: Array, normals: Array, scatter: float) -> tuple[Array, Array]:
    """Return factors as lights (L, 3) and normals (N, 3) but for a common rotation: normals are of unit length.

    Lights that are said to be equally strong tell the same better.
    """
    by_strength, by_albedo = equally_strong(lights), equally_strong(normals)
    if by_strength is not None and (scatter < SAID_EQUAL or by_albedo is None):
        return lights @ by_strength, normals @ np.linalg.inv(by_strength).T
    turned = np.eye(3) if by_albedo is None else by_albedo
    return lights @ np.linalg.inv(turned).T, normals @ turned


def _ranked(pictures: Pictures) -> Array:
    """Return the value (P,) of one rank among a pixel's lit ones, or its usual one where none is lit."""
    lit = pictures.lit > 0
    seen = np.sort(np.where(lit, pictures.gray, np.inf), axis=1)
    at = np.round(RANK * np.maximum(lit.sum(axis=1) - 1, 0)).astype(np.int64)
    value = np.take_along_axis(seen, at[:, None], axis=1)[:, 0]
    return np.where(np.isfinite(value), value, pictures.usual)


def _on_the_axis(problem: Problem, lights: Array, normals: Array, guess: Array) -> Array:
    """Return the lights turned so that their mean is on the optical axis.

    The turn about it, and whether all is a mirror image, are those with which known lights, or else the normals, are
    nearest to what is known or guessed of them.
    """
    mean = lights.mean(axis=0)
    mean /= np.linalg.norm(mean)
    basis = np.linalg.svd(mean[None])[2][[1, 2, 0]]
    basis[2] = mean
    lights, normals = lights @ basis.T, normals @ basis.T
    known = problem.known
    pairs = (lights[known.lights], known.directions) if len(known.lights) else (normals, guess)
    left, _, right = np.linalg.svd(pairs[0][:, :2].T @ pairs[1][:, :2])
    return np.hstack([lights[:, :2] @ left @ right, lights[:, 2:]])


def _normals(pictures: Pictures, lights: Array) -> tuple[Array, Array]:
    """Return each pixel's unit normal under the lights, and what it shows (P, L), without highlights."""
    weight = pictures.lit
    for _ in range(ROUNDS):
        vectors = rows(weight, lights, pictures.gray)
        shown = np.maximum(vectors @ lights.T, 0.0)
        weight = pictures.lit / (1.0 + ((pictures.gray - shown) / (WIDTH * pictures.usual[:, None])) ** 2) ** 2
    facing = (vectors * pictures.views).sum(axis=1, keepdims=True)
    vectors -= 2.0 * np.minimum(facing, 0.0) * pictures.views  # seen from the front
    vectors += RIDGE * pictures.usual[:, None] * pictures.views
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), TINY), shown
