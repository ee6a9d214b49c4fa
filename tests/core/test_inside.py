"""Winding numbers of meshes, closed and nearly so."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from pipeline.core.inside import distance_to, winding_number
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


def test_distance_to_face_edge_corner_and_far_side() -> None:
    triangle = np.array([[[0.0, 0, 0], [4, 0, 0], [0, 3, 0]]])
    points = np.array([[1, 1, 2.0], [1, 1, 0], [2, -2, 0], [-3, -4, 0], [4, 3, 0], [2, 1.5, 1e-3], [8, 0, 3]])
    wanted = [2, 0, 2, 5, 12 / 5, 1e-3, 5]
    np.testing.assert_allclose(distance_to(points, triangle), wanted, atol=1e-12)
    np.testing.assert_allclose(distance_to(points, triangle[:, ::-1]), wanted, atol=1e-12)
    line = np.array([[[0.0, 0, 0], [4, 0, 0], [2, 0, 0]]])  # without area
    np.testing.assert_allclose(distance_to(points[2:4], line), [2, 5], atol=1e-12)


def test_distance_to_a_ball_is_that_to_its_nearest_face() -> None:
    points = sphere(7) @ np.diag([1.3, 0.5, 2.0])
    steps = np.stack(np.meshgrid(*[np.linspace(0, 1, 41)] * 2), axis=-1).reshape(-1, 2)
    steps = steps[steps.sum(axis=1) <= 1]
    weights = np.column_stack([steps, 1 - steps.sum(axis=1)])
    dense = np.einsum("sk,tki->tsi", weights, ball()).reshape(-1, 3)
    sampled = np.linalg.norm(points[:, None] - dense, axis=2).min(axis=1)
    np.testing.assert_allclose(distance_to(points, ball()), sampled, atol=0.003)
