"""Whether points lie inside a triangle mesh that need not be closed, or on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def winding_number(points: NDArray[np.float64], triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how often a mesh winds round each point: 0 outside and 1 inside a closed mesh facing outwards.

    The sum of the triangles' signed solid angles over 4 pi, w = sum_t atan2(det(a, b, c), |a||b||c| + (a.b)|c| +
    (b.c)|a| + (c.a)|b|) / (2 pi), with a, b, c from the point to the corners. Small holes change it little, so that
    parts that only overlap can be tested as one.

    Parameters
    ----------
    points : (N, 3) float64
        World [m].
    triangles : (T, 3, 3) float64
        Corners, world [m].

    Returns
    -------
    (N,) float64

    References
    ----------
    Van Oosterom, Strackee, "The solid angle of a plane triangle", 1983; Jacobson, Kavan, Sorkine-Hornung, "Robust
    inside-outside segmentation using generalized winding numbers", 2013.
    """
    result = np.empty(len(points))
    for i, point in enumerate(points):
        a, b, c = (triangles[:, k] - point for k in range(3))
        la, lb, lc = (np.sqrt((v * v).sum(axis=1)) for v in (a, b, c))
        above = (a * np.cross(b, c)).sum(axis=1)
        below = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
        result[i] = np.arctan2(above, below).sum() / (2 * np.pi)
    return result


def distance_to(points: NDArray[np.float64], triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each point to the nearest of some triangles.

    To the plane where the foot of the perpendicular lies in the triangle, else to the nearest edge.

    Parameters
    ----------
    points : (N, 3) float64
        World [m].
    triangles : (T, 3, 3) float64
        Corners, world [m]; degenerate triangles count with their edges.

    Returns
    -------
    (N,) float64
        [m].
    """
    edges = np.roll(triangles, -1, axis=1) - triangles
    normal = np.cross(edges[:, 0], edges[:, 1])
    area = np.linalg.norm(normal, axis=1)
    squared = np.maximum((edges**2).sum(axis=2), np.finfo(np.float64).tiny)
    result = np.empty(len(points))
    for i, point in enumerate(points):
        from_corner = point - triangles
        along = np.clip((from_corner * edges).sum(axis=2) / squared, 0.0, 1.0)
        to_edges = np.linalg.norm(from_corner - along[..., None] * edges, axis=2)
        over = ((np.cross(edges, from_corner) * normal[:, None]).sum(axis=2) >= 0).all(axis=1) & (area > 0)
        to_planes = abs((from_corner[over, 0] * normal[over]).sum(axis=1)) / area[over]
        result[i] = min(to_edges.min(), to_planes.min(initial=np.inf))
    return result
