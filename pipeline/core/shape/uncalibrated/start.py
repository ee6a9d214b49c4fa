"""First lights from the pictures alone: a factorisation of rank three, and ways of choosing its nine numbers.

On a matt surface the values are a product of pixels and lights, y = B S^T with B (P, 3) and S (L, 3) (Hayakawa 1994).
It is found without highlights and shadows, by reweighted alternating least squares. S is then known but for a
3 x 3 matrix. Either those lights are taken that fit a dome over the outline best, or the lights are taken to be equally
strong, which leaves a rotation (Hayakawa 1994): the one that turns normals to the dome's, or those that make them the
normals of one surface, be it a dome or a bowl.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .integrability import rotation
from .pictures import Pictures

Array = NDArray[np.float64]

ROUNDS = 60
WIDTHS = (0.3, 0.03)  # misfit over the usual value at which a value counts a quarter, first and last
ENOUGH = 2 / 3  # share of the lights that a pixel needs
BRIGHTEST = 2.0  # times the usual value, what is brighter counts as this bright at first
DOME_WIDTH = 0.3  # misfit [rad] at which a normal of the dome counts half
DOME_ROUNDS = 20
ALBEDOS = (0.2, 5.0)  # over the usual one
LEAST_SQUARE = 1e-3  # least over largest eigenvalue with which equal strengths fix a factor
STIFF = 1e-4  # weight of leaving all lights as they are where some are known
RIDGE = 1e-9
TOO_DARK = "too few pixels are lit in most photographs; photograph with lamps nearer to the camera"


def first_lights(pictures: Pictures, dome: Array) -> list[Array]:
    """Return some sets of lights (L, 3) to begin with, camera space, their strengths' geometric mean 1.

    Parameters
    ----------
    pictures : Pictures
    dome : (P, 3) float64
        Guessed normals.

    Returns
    -------
    list of (L, 3) float64
        First those that fit the dome. Empty where fewer than three pixels see enough lights.
    """
    values, lit = pictures.gray, pictures.lit > 0
    usual = np.nanmedian(np.where(lit, values, np.nan), axis=1, keepdims=True)
    kept = (lit.sum(axis=1) >= ENOUGH * lit.shape[1]) & (usual[:, 0] > 0)
    if kept.sum() < 3:
        return []
    scaled, lit, dome = values[kept] / usual[kept], lit[kept], dome[kept]
    lights, pixels, trust = factorise(scaled, lit)
    by_dome = fitted_to(scaled, lit, dome)
    sets = [lights @ np.linalg.lstsq(lights, by_dome, rcond=None)[0]]
    equal = equally_strong(lights)
    if equal is not None:
        lights, pixels = lights @ equal, pixels @ np.linalg.inv(equal).T
        normals = pixels / np.maximum(np.linalg.norm(pixels, axis=1, keepdims=True), RIDGE)
        sets.append(lights @ _turned_to(normals, trust.sum(axis=1), dome, lights, by_dome))
        mask = pictures.mask.copy()
        mask[mask] = kept
        turned = lights @ rotation(mask, pictures.rays[kept], normals, pictures.pinhole).T
        sets.append(turned * np.sign(np.median(turned[:, 2])))
    return [mean_strength_one(one) for one in sets]


def factorise(values: Array, lit: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Return S (L, 3), B (P, 3) and the final weights (P, L) of values (P, L) whose usual one is 1."""
    count = lit.shape[1]
    fullest = lit.sum(axis=1) >= min(count - 1, int(lit.sum(axis=1).max()))
    lights = np.linalg.svd(np.minimum(values[fullest], BRIGHTEST), full_matrices=False)[2][:3].T * np.sqrt(count / 3)
    weight = lit.astype(np.float64)
    for done in range(ROUNDS):
        width = WIDTHS[0] * (WIDTHS[1] / WIDTHS[0]) ** min(done / (0.6 * ROUNDS), 1.0)
        pixels = rows(weight, lights, values)
        weight = lit / (1.0 + ((values - pixels @ lights.T) / width) ** 2) ** 2
        lights = rows(weight.T, pixels, values.T)
        lights = np.linalg.svd(lights, full_matrices=False)[0] * np.sqrt(count / 3)
    return lights, rows(weight, lights, values), weight


def fitted_to(values: Array, lit: NDArray[np.bool_], normals: Array) -> Array:
    """Return the lights (L, 3) under which a matt surface of given normals is nearest to the values."""
    albedo, weight = np.ones(len(normals)), lit.astype(np.float64)
    lights = np.zeros((lit.shape[1], 3))
    for _ in range(DOME_ROUNDS):
        lights = rows(weight.T, normals * albedo[:, None], values.T)
        lit_by = np.maximum(normals @ lights.T, 0.0)
        albedo = (weight * lit_by * values).sum(axis=1) / np.maximum((weight * lit_by**2).sum(axis=1), RIDGE)
        albedo = np.clip(albedo, *ALBEDOS)
        weight = lit / (1.0 + ((values - lit_by * albedo[:, None]) / DOME_WIDTH) ** 2)
        lights = mean_strength_one(lights)
    return lights


def equally_strong(lights: Array) -> Array | None:
    """Return the matrix M (3, 3) for which the rows of ``lights @ M`` are nearest to unit length, or None."""
    products = lights[:, :, None] * lights[:, None, :]
    upper = np.triu_indices(3)
    twice = np.where(upper[0] == upper[1], 1.0, 2.0)
    square = np.zeros((3, 3))
    square[upper] = np.linalg.lstsq(products[:, *upper] * twice, np.ones(len(lights)), rcond=None)[0]
    value, vector = np.linalg.eigh(np.triu(square) + np.triu(square, 1).T)
    return vector * np.sqrt(value) if value[0] > LEAST_SQUARE * value[2] else None


def mean_strength_one(lights: Array) -> Array:
    """Return the lights scaled so that the geometric mean of their strengths is 1."""
    strength = np.maximum(np.linalg.norm(lights, axis=1), RIDGE)
    return np.asarray(lights / np.exp(np.log(strength).mean()))


def towards_known(lights: Array, numbers: NDArray[np.int64], directions: Array) -> Array:
    """Return the lights (L, 3) under the least linear change of all that turns some to known unit directions (N, 3)."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    # of lights @ change, the parts across the known directions, by the change's nine numbers
    parts = np.einsum("ni,njk->nkij", lights[numbers], across).reshape(-1, 9)
    system = parts.T @ parts + STIFF * np.eye(9)
    change = np.linalg.solve(system, STIFF * np.eye(3).ravel()).reshape(3, 3)
    return mean_strength_one(lights @ change)


def _turned_to(normals: Array, trust: Array, dome: Array, lights: Array, by_dome: Array) -> Array:
    """Return the rotation, mirrored or not, that turns normals to the dome's, beginning with the lights'."""
    rotation = _procrustes(lights, by_dome)
    for _ in range(DOME_ROUNDS):
        apart = np.linalg.norm(normals @ rotation - dome, axis=1)
        rotation = _procrustes(normals * (trust / (1.0 + (apart / DOME_WIDTH) ** 2))[:, None], dome)
    return rotation


def _procrustes(start: Array, end: Array) -> Array:
    left, _, right = np.linalg.svd(start.T @ end)
    return np.asarray(left @ right)


def rows(weight: Array, known: Array, values: Array) -> Array:
    """Return the rows x (N, 3) that minimise sum_m weight_nm (values_nm - known_m . x_n)^2."""
    system = np.einsum("nm,mi,mj->nij", weight, known, known, optimize=True)
    system += RIDGE * np.maximum(np.trace(system, axis1=1, axis2=2), 1.0)[:, None, None] * np.eye(3)
    right = (weight * values) @ known
    return np.asarray(np.linalg.solve(system, right[..., None])[..., 0])
