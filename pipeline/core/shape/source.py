"""The source's own objective, kept to compare with (Magda, Kriegman, Zickler, Belhumeur 2001, equation 5).

For a depth t the ray from the surface point to outer light k meets the inner surface at distance d, where the picture
value i is interpolated linearly in the triangle of inner lights that it hits. The light there would make the same
radiance per irradiance as light k at distance d_k::

    O(t) = sum over k of (d_k^2 i_k - d^2 i(t))^2

Ten depths are tried and the best is improved by golden section between its neighbours. As written it favours small
depths and is ruled by highlights.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from ..compiled import kernel, parallel_kernel
from ..errors import LightsphereError
from ..progress import Progress, Work
from .coarse_to_fine import BLOCK, Views

GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
SEARCH_STEPS = 30  # of golden section: a millionth of the distance of two candidates
MARGIN = 0.02  # share of the ray inside the lights that is kept free at both ends: distances vanish there


def triangulate(inner: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the triangles (T, 3) of a surface of lights that is star-shaped about its centroid.

    The triangles of the convex hull of the lights' directions from there.
    """
    away = inner - inner.mean(axis=0)
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    if distance.min() <= 0:
        raise LightsphereError("an inner light lies at the centre of the others; move it onto their surface")
    return np.asarray(ConvexHull(away / distance).simplices, np.int64)


@kernel
def hit(point, direction, inner, triangle, weights):  # type: ignore[no-untyped-def]
    """Return the distance at which a ray meets a triangle of lights, its barycentric weights filled in; -1 for a miss.

    Moller and Trumbore 1997.
    """
    a, b, c = inner[triangle[0]], inner[triangle[1]], inner[triangle[2]]
    e1x, e1y, e1z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    e2x, e2y, e2z = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    px = direction[1] * e2z - direction[2] * e2y
    py = direction[2] * e2x - direction[0] * e2z
    pz = direction[0] * e2y - direction[1] * e2x
    determinant = e1x * px + e1y * py + e1z * pz
    if abs(determinant) < 1e-14:
        return -1.0
    tx, ty, tz = point[0] - a[0], point[1] - a[1], point[2] - a[2]
    u = (tx * px + ty * py + tz * pz) / determinant
    qx, qy, qz = ty * e1z - tz * e1y, tz * e1x - tx * e1z, tx * e1y - ty * e1x
    v = (direction[0] * qx + direction[1] * qy + direction[2] * qz) / determinant
    if u < -1e-9 or v < -1e-9 or u + v > 1.0 + 1e-9:
        return -1.0
    weights[0], weights[1], weights[2] = 1.0 - u - v, u, v
    return (e2x * qx + e2y * qy + e2z * qz) / determinant


@kernel
def objective(depth, ray, values, inner, outer, triangles, last):  # type: ignore[no-untyped-def]
    """Return O(t) per outer light that is seen through the inner surface; infinite where none is.

    ``values`` holds those of the inner lights first, then those of the outer ones; ``last`` the triangle that each
    outer light was last seen through.
    """
    point = np.empty(3)
    direction = np.empty(3)
    weights = np.empty(3)
    for k in range(3):
        point[k] = ray[k] + depth * ray[3 + k]
    total = 0.0
    count = 0
    for n in range(len(outer)):
        far = 0.0
        for k in range(3):
            direction[k] = outer[n, k] - point[k]
            far += direction[k] ** 2
        for k in range(3):
            direction[k] /= math.sqrt(far)
        for step in range(len(triangles)):
            at = (last[n] + step) % len(triangles)
            triangle = triangles[at]
            near = hit(point, direction, inner, triangle, weights)
            if near > 0.0:
                last[n] = at
                value = 0.0
                for k in range(3):
                    value += weights[k] * values[triangle[k]]
                total += (far * values[len(inner) + n] - near * near * value) ** 2
                count += 1
                break
    return total / count if count > 0 else np.inf


@kernel
def search(ray, near, far, values, inner, outer, triangles, candidates):  # type: ignore[no-untyped-def]
    """Return the depth of least O among even candidates, improved by golden section; NaN where no light is seen."""
    last = np.zeros(len(outer), np.int64)
    step = (1.0 - 2.0 * MARGIN) * (far - near) / (candidates - 1)
    start = near + MARGIN * (far - near)
    best, lowest = np.nan, np.inf
    for k in range(candidates):
        cost = objective(start + k * step, ray, values, inner, outer, triangles, last)
        if cost < lowest:
            best, lowest = start + k * step, cost
    if lowest == np.inf:
        return best
    low, high = max(start, best - step), min(start + (candidates - 1) * step, best + step)
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    left_cost = objective(left, ray, values, inner, outer, triangles, last)
    right_cost = objective(right, ray, values, inner, outer, triangles, last)
    for _ in range(SEARCH_STEPS):
        if left_cost < right_cost:
            high, right, right_cost = right, left, left_cost
            left = high - GOLDEN * (high - low)
            left_cost = objective(left, ray, values, inner, outer, triangles, last)
        else:
            low, left, left_cost = left, right, right_cost
            right = low + GOLDEN * (high - low)
            right_cost = objective(right, ray, values, inner, outer, triangles, last)
    return 0.5 * (low + high)


@parallel_kernel
def sweep(rays, near, far, values, order, inner, outer, triangles, candidates, min_lit):  # type: ignore[no-untyped-def]
    """Return the depths of some pixels (P,); NaN where fewer than ``min_lit`` lights are lit."""
    depths = np.full(len(rays), np.nan)
    for i in prange(len(rays)):
        if (values[i] > 0.0).sum() >= min_lit:
            own = values[i][order].astype(np.float64) ** 3
            depths[i] = search(rays[i], near[i], far[i], own, inner, outer, triangles, candidates)
    return depths


def solve(
    views: Views, inner: NDArray[np.int64], outer: NDArray[np.int64], candidates: int, min_lit: int
) -> Work[NDArray[np.float64]]:
    """Return the depth (P,) [m] of every pixel by the source's objective; NaN where it has none.

    Parameters
    ----------
    views : Views
    inner, outer : (L,) int64
        Numbers of the lights on both surfaces.
    candidates : int
        Depths tried along each ray.
    min_lit : int
        Fewest lit lights with which a pixel is tried.
    """
    triangles = triangulate(views.positions[inner])
    order = np.concatenate([inner, outer])
    depths = np.full(len(views.rays), np.nan)
    for start in range(0, len(depths), BLOCK):
        part = slice(start, start + BLOCK)
        depths[part] = sweep(
            views.rays[part], views.near[part], views.far[part], np.maximum(views.values[part], 0.0), order,
            views.positions[inner], views.positions[outer], triangles, candidates, min_lit,
        )  # fmt: skip
        yield Progress("shape", min(start + BLOCK, len(depths)), len(depths), "pixels")
    return depths
