"""Neighbours' depths and normals brought together without blurring depth edges, and what their disagreement tells.

With point P_i = o_i + l_i r_i on the ray of pixel i and the mean normal n of two neighbours, a smooth surface has
n.(P_i - P_j) = 0 up to the third order of their distance: an equation linear in both ray lengths. All of them, beside
l_i = measured, are solved in the least squares sense with robust weights on *both* kinds, so that a wrong depth gives
way to its neighbours and a depth edge to nobody.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import cg

from .coarse_to_fine import OFFSETS, neighbours_at

ROUNDS = 6  # of reweighting
STEEPEST = 0.15  # cosine of view and normal below which a pair says nothing about depth
PAIR_SHARE = 0.02  # deviation that a pair's equation has by curvature, share of the pair's distance
LEAST_DEVIATION = 1e-7  # of a depth, share of the depth: keeps the system regular


def pairs(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the numbers of all horizontally or vertically adjacent pixels of a mask, (N, 2)."""
    pixels = np.arange(int(mask.sum()))
    around = neighbours_at(mask, pixels, 1)
    found = [
        np.stack([pixels, around[:, OFFSETS.index(offset)]], axis=1)[around[:, OFFSETS.index(offset)] >= 0]
        for offset in ((0, 1), (1, 0))
    ]
    return np.concatenate(found)


def pair_equations(
    rays: NDArray[np.float64], depth: NDArray[np.float64], normal: NDArray[np.float64], both: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the terms of n.(P_i - P_j) = a_i l_i - a_j l_j + b for pairs of pixels.

    Parameters
    ----------
    rays : (P, 6) float64
        Origin [m] and unit direction.
    depth : (P,) float64
        Ray length [m]; NaN allowed.
    normal : (P, 3) float64
        Unit normals, world space.
    both : (N, 2) int64
        The pairs.

    Returns
    -------
    a : (N, 2) float64
        n.r of both pixels, NaN where the pair says nothing.
    b : (N,) float64
        n.(o_i - o_j) [m].
    distance : (N,) float64
        Of the two points as seen by the camera, across the view [m].
    """
    i, j = both.T
    n = normal[i] + normal[j]
    length = np.linalg.norm(n, axis=1, keepdims=True)
    n = n / np.where(length > 0, length, np.nan)
    a = np.stack([(n * rays[i, 3:]).sum(axis=1), (n * rays[j, 3:]).sum(axis=1)], axis=1)
    a[(a > -STEEPEST).any(axis=1)] = np.nan
    b = (n * (rays[i, :3] - rays[j, :3])).sum(axis=1)
    mean = 0.5 * (depth[i] + depth[j])
    across = rays[i, :3] - rays[j, :3] + mean[:, None] * (rays[i, 3:] - rays[j, 3:])
    return a, b, np.linalg.norm(across, axis=1)


def disagreement(
    mask: NDArray[np.bool_], rays: NDArray[np.float64], depth: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how far each depth is from where its neighbours' tangent planes put it, (P,) [m].

    The second smallest of the distances to the neighbours, so that a depth edge beside a pixel does not count;
    infinite where there are fewer than two.
    """
    both = pairs(mask)
    a, b, _ = pair_equations(rays, depth, normal, both)
    i, j = both.T
    apart = np.abs(a[:, 0] * depth[i] - a[:, 1] * depth[j] + b) / np.abs(a).min(axis=1)
    apart = np.where(np.isfinite(apart), apart, np.inf)
    order = np.lexsort((np.concatenate([apart, apart]), np.concatenate([i, j])))
    owner, sorted_apart = np.concatenate([i, j])[order], np.concatenate([apart, apart])[order]
    first = np.searchsorted(owner, np.arange(len(depth)))
    result = np.full(len(depth), np.inf)
    enough = np.bincount(owner, minlength=len(depth)) >= 2
    result[enough] = sorted_apart[first[enough] + 1]
    return result


def fuse(
    mask: NDArray[np.bool_],
    rays: NDArray[np.float64],
    depth: NDArray[np.float64],
    deviation: NDArray[np.float64],
    normal: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return depths (P,) [m] that agree with the normals wherever measured depths are the less certain.

    Parameters
    ----------
    mask : (H, W) bool
        P pixels, numbered in row order.
    rays, depth, normal
        As in :func:`pair_equations`; depth and normal NaN where nothing was recovered, and so they stay.
    deviation : (P,) float64
        Standard deviation of each depth [m].
    """
    known = np.isfinite(depth) & np.isfinite(normal).all(axis=1)
    if not known.any():
        return depth.copy()
    both = pairs(mask)
    both = both[known[both].all(axis=1)]
    a, b, distance = pair_equations(rays, depth, normal, both)
    usable = np.isfinite(a).all(axis=1)
    both, a, b, distance = both[usable], a[usable], b[usable], distance[usable]
    rows = np.repeat(np.arange(len(both)), 2)
    pair_matrix = sparse.csr_matrix((np.stack([a[:, 0], -a[:, 1]], axis=1).ravel(), (rows, both.ravel())),
                                    shape=(len(both), len(depth)))  # fmt: skip
    measured = np.where(known, depth, 0.0)
    scale = np.where(known, np.maximum(deviation, LEAST_DEVIATION * np.abs(measured)), 1.0)
    scale = np.minimum(scale, 1e6 * LEAST_DEVIATION * max(float(np.median(measured[known])), 1e-30))
    pair_scale = PAIR_SHARE * distance
    fused = measured.copy()
    for _ in range(ROUNDS):
        off = (fused - measured) / scale
        apart = (pair_matrix @ fused + b) / pair_scale
        own_weight = 1.0 / (scale**2 * (1.0 + (off / 3.0) ** 2))
        pair_weight = 1.0 / (pair_scale**2 * (1.0 + (apart / 3.0) ** 2))
        weighted = pair_matrix.T @ sparse.diags(pair_weight)
        left = weighted @ pair_matrix + sparse.diags(own_weight)
        # Solved for the change: what is right already stays right to the last digit.
        right = -(weighted @ (pair_matrix @ fused + b)) - own_weight * (fused - measured)
        change, _ = cg(left, right, rtol=1e-6, maxiter=300, M=sparse.diags(1.0 / left.diagonal()))
        fused = fused + change
    return np.where(known, fused, np.nan)
