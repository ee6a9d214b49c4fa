"""What the normals' being those of one surface says about the lights.

If all normals become (1 + X) n, with one matrix X, and all lights the inverse of it, a matt surface shows the same.
Only some X leave a surface: under a pinhole camera X = 0 alone (Papadhimitri and Favaro 2013), under an orthographic
one the four of the generalised bas-relief ambiguity (Belhumeur, Kriegman and Yuille 1999). The misfit of the normals
to the nearest surface, linearised in X, is therefore a statement on X, and so on the lights.

Where normals are known but for a rotation, it can be found without a guess: by trying all.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import minimize
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

from ..tangents import rises

Array = NDArray[np.float64]

STEP = 1e-4  # of a difference quotient
ROUNDS = 6  # of reweighting, so that depth edges do not count
OUTLYING = 2.0  # median deviations beyond which a pair of pixels counts less
LEAST_SCATTER = 1e-4  # of the pairs' equations [rad]
CERTAIN = 1e-9  # of the largest information; what is below is not told
STILL = 1e-8  # share of a pair's weight by which every pixel stays where it is: the system is regular
TRIED, FOLLOWED = 3000, 6  # rotations, about 13 degrees apart, and how many of the best are followed
OFF = 0.03  # of a surface, over how far normals turn from pixel to pixel, at which a cell counts half
FLAT = 0.3  # of the usual turn; where normals turn less, noise is what is seen


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


def rotation(mask: NDArray[np.bool_], rays: Array, normals: Array, pinhole: bool) -> Array:
    """Return the rotation R (3, 3) for which the normals ``R n`` are nearest to those of one surface.

    With the image axes x and y in units of the distance, q = (x, y, -1) along the ray, N_x = n x dn/dx and
    N_y = n x dn/dy, a surface's normals satisfy::

        N_x . e_x + N_y . e_y + (x N_x + y N_y) . e_z = 0

    which is that the mixed derivatives of its logarithmic depth agree, and is linear in R. Under parallel rays the last
    term is missing. R and -R are the same here. The unit matrix where no four pixels are neighbours.

    Parameters
    ----------
    mask : (H, W) bool
        P pixels that are neighbours in it, numbered in row order.
    rays : (P, 6) float64
        Origin and unit direction of every pixel's ray, camera space.
    normals : (P, 3) float64
        Unit.
    pinhole : bool
    """
    rows = _in_rotations(mask, rays, normals, pinhole)
    if not len(rows):
        return np.eye(3)

    def cost(rotations: Array) -> Array:
        return np.asarray(np.log1p((rotations.reshape(-1, 9) @ rows.T / OFF) ** 2).mean(axis=1))

    def followed(start: Array) -> tuple[float, Array]:
        def turned(by: Array) -> Array:
            return np.asarray(Rotation.from_rotvec(by).as_matrix() @ start)

        found = minimize(lambda by: cost(turned(by))[0], np.zeros(3), method="Nelder-Mead")
        return float(found.fun), turned(found.x)

    tried = Rotation.from_quat(np.random.default_rng(0).standard_normal((TRIED, 4))).as_matrix()
    ends = [followed(tried[k]) for k in np.argsort(cost(tried))[:FOLLOWED]]
    return min(ends, key=lambda end: end[0])[1]


def _in_rotations(mask: NDArray[np.bool_], rays: Array, normals: Array, pinhole: bool) -> Array:
    """Return the equations ``rows @ R.ravel() = 0`` (N, 9) of every cell of four pixels, of alike weight."""
    number = np.full(mask.shape, -1)
    number[mask] = np.arange(len(normals))
    cells = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]], axis=-1).reshape(-1, 4)
    cells = cells[(cells >= 0).all(axis=1)]
    if not len(cells):
        return np.zeros((0, 9))
    left, right, below_left, below_right = normals[cells].swapaxes(0, 1)
    by_x = np.cross(left, right) + np.cross(below_left, below_right)
    by_y = np.cross(below_left, left) + np.cross(below_right, right)
    x, y = (-rays[cells, 3:5] / rays[cells, 5:]).mean(axis=1).T if pinhole else np.zeros((2, len(cells)))
    rows = np.hstack([by_x, by_y, x[:, None] * by_x + y[:, None] * by_y])
    change = np.linalg.norm(rows[:, :6], axis=1, keepdims=True)
    return np.asarray(rows / np.maximum(change + FLAT * np.median(change), STILL))
