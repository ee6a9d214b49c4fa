"""Winding numbers of meshes, closed and nearly so."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from pipeline.core.inside import winding_number
from pipeline.core.rig import sphere


def ball() -> np.ndarray:
    points = sphere(200)
    triangles = points[ConvexHull(points).simplices]
    outward = (np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) * triangles[:, 0]).sum(1)
    triangles[outward < 0] = triangles[outward < 0][:, ::-1]
    return triangles


def test_closed_mesh_winds_once_inside_and_never_outside() -> None:
    points = np.array([[0, 0, 0], [0.9, 0, 0], [0, -0.5, 0.5], [1.1, 0, 0], [0, 5, 0]])
    assert np.allclose(winding_number(points, ball()), [1, 1, 1, 0, 0], atol=1e-9)


def test_small_hole_changes_little() -> None:
    points = np.array([[0.0, 0, 0], [0, 0, -3.0]])
    assert np.allclose(winding_number(points, ball()[3:]), [1, 0], atol=0.02)
    assert abs(winding_number(points[:1], ball()[::2])[0] - 1) > 0.3  # half the triangles are no longer a ball
