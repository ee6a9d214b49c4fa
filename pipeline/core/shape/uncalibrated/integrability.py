"""What the normals' being those of one surface says about the lights.

If all normals become (1 + X) n, with one matrix X, and all lights the inverse of it, a matt surface shows the same.
Only some X leave a surface: under a pinhole camera X = 0 alone (Papadhimitri and Favaro 2013), under an orthographic
one the four of the generalised bas-relief ambiguity (Belhumeur, Kriegman and Yuille 1999). The misfit of the normals
to the nearest surface, linearised in X, is therefore a statement on X, and so on the lights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from ..tangents import rises

Array = NDArray[np.float64]

STEP = 1e-4  # of a difference quotient
ROUNDS = 6  # of reweighting, so that depth edges do not count
OUTLYING = 2.0  # median deviations beyond which a pair of pixels counts less
LEAST_SCATTER = 1e-4  # of the pairs' equations [rad]
CERTAIN = 1e-9  # of the largest information; what is below is not told
STILL = 1e-8  # share of a pair's weight by which every pixel stays where it is: the system is regular


def cue(mask: NDArray[np.bool_], rays: Array, normals: Array, lights: Array, pinhole: bool) -> tuple[Array, Array]:
    """Return equations ``matrix @ s = target`` in the lights s (3 L,), of unit variance each.

    Parameters
    ----------
    mask : (H, W) bool
        P pixels that are neighbours in it, numbered in row order.
    rays : (P, 6) float64
        Origin and unit direction of every pixel's ray, camera space.
    normals : (P, 3) float64
        Unit, camera space.
    lights : (L, 3) float64
        Those that the normals belong to.
    pinhole : bool
    """
    off, slopes, scatter = _beside_a_surface(mask, rays, normals, pinhole)
    information = slopes.T @ slopes / scatter**2
    value, vector = np.linalg.eigh(information)
    told = value > CERTAIN * value[-1]
    root = (vector[:, told] * np.sqrt(value[told])).T
    best = -(root / value[told][:, None]) @ (slopes.T @ off) / scatter**2
    # lights' change S' = S (1 - X), so X = -S^+ (S' - S)
    back = np.linalg.pinv(lights)
    matrix = -root @ np.kron(back, np.eye(3))
    return matrix, best + matrix @ lights.ravel()


def _beside_a_surface(
    mask: NDArray[np.bool_], rays: Array, normals: Array, pinhole: bool
) -> tuple[Array, Array, float]:
    """Return the misfit to the nearest surface of each pair of neighbours (N,), by X (N, 9), and its usual size."""
    found = rises(mask, rays, normals, pinhole)
    columns = [found.rise]
    for k in range(9):
        turned = normals.copy()
        turned[:, k // 3] += STEP * normals[:, k % 3]
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        columns.append((rises(mask, rays, turned, pinhole).rise - found.rise) / STEP)
    rise = np.stack(columns, axis=1)
    pairs, pixels = len(found.pairs), len(normals)
    entries = (np.repeat([-1.0, 1.0], pairs), (np.tile(np.arange(pairs), 2), found.pairs.T.ravel()))
    difference = sparse.csr_array(entries, shape=(pairs, pixels))
    robust = np.ones(pairs)
    for _ in range(ROUNDS):
        weight = found.facing / found.footprint * np.sqrt(robust)
        weighted = sparse.diags_array(weight) @ difference
        system = weighted.T @ weighted + STILL * float((weight**2).mean()) * sparse.eye_array(pixels)
        right = rise * weight[:, None]
        left_over = right - weighted @ splu(system.tocsc()).solve(np.asarray(weighted.T @ right))
        apart = np.abs(left_over[:, 0]) / np.sqrt(robust)
        scatter = max(1.4826 * float(np.median(apart)), LEAST_SCATTER)
        robust = 1.0 / (1.0 + (apart / (OUTLYING * scatter)) ** 2) ** 2
    return left_over[:, 0], left_over[:, 1:], scatter
