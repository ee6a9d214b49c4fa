"""A closed relief: watertight, outwards, and behind what the camera saw."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.shape import Shape
from pipeline.core.shape.back import closed
from pipeline.core.shape.mesh import Mesh, relief
from tests import synthetic

SHAPES = {
    "ball": lambda: synthetic.ball(synthetic.camera(32)),
    "orthographic": lambda: synthetic.ball(synthetic.camera(32, "orthographic")),
    "step": lambda: synthetic.step(synthetic.camera(24), 0.6),
    "hollow": lambda: hollow(),
    "corner to corner": lambda: corner_to_corner(),
}


def hollow() -> Shape:
    """A bowl seen from inside: its middle lies behind its rim."""
    ball = synthetic.ball(synthetic.camera(32, "orthographic"))
    normal = ball.normal * np.array([-1, -1, 1], np.float32)
    return dataclasses.replace(ball, depth=(2 * np.float32(5.0) - ball.depth), normal=normal)


def corner_to_corner() -> Shape:
    """Two squares of a plane that meet in one point."""
    flat = synthetic.plane(synthetic.camera(16), np.array([0.0, 0.0, 1.0]))
    row, column = np.indices(flat.depth.shape)
    kept = (row < 8) == (column < 8)
    joined = kept | ((row // 2 == 3) & (column // 2 == 3))
    return dataclasses.replace(flat, depth=np.where(joined, flat.depth, np.nan).astype(np.float32))


def edge_counts(mesh: Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """How many triangles each edge has, and how often it is run through each way."""
    along = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    return (
        np.unique(np.sort(along, axis=1), axis=0, return_counts=True)[1],
        np.unique(along, axis=0, return_counts=True)[1],
    )


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.einsum("fi,fi->f", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("name", SHAPES)
def test_every_edge_has_two_triangles_that_run_against_each_other(name: str) -> None:
    shape = SHAPES[name]()
    front = relief(shape)
    mesh = closed(front, shape)
    both, each_way = edge_counts(mesh)
    assert (both == 2).all() and (each_way == 1).all()
    assert (edge_counts(front)[0] == 1).any()  # which it was not before
    assert volume(mesh) > 0
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert area.min() > 1e-9


@pytest.mark.parametrize("name", SHAPES)
def test_the_back_lies_behind_the_front_on_the_same_rays(name: str) -> None:
    shape = SHAPES[name]()
    front = relief(shape)
    mesh = closed(front, shape)
    half = len(mesh.vertices) // 2
    np.testing.assert_array_equal(mesh.vertices[mesh.faces[: len(front.faces)]], front.vertices[front.faces])
    np.testing.assert_array_equal(mesh.uv[:half], mesh.uv[half:])
    place, depth = shape.camera.project(mesh.vertices)
    np.testing.assert_allclose(place[:half], place[half:], atol=1e-6)
    assert (depth[half:] > depth[:half]).all()


def test_a_ball_is_closed_to_a_ball() -> None:
    """The back is as far behind the contour as the front is before it. The last pixels, where a ball is steep, lack."""
    shape = synthetic.ball(synthetic.camera(48, "orthographic"))
    whole = 4 / 3 * np.pi * synthetic.RADIUS**3
    assert 0.7 * whole < volume(closed(relief(shape), shape)) < whole


def test_normals_of_the_back_look_away_from_the_camera() -> None:
    shape = synthetic.ball(synthetic.camera(32, "orthographic"))
    mesh = closed(relief(shape), shape)
    half = len(mesh.vertices) // 2
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, rtol=1e-6)
    assert (mesh.normals[:half, 2] > 0).all() and (mesh.normals[half:, 2] < 0).mean() > 0.95
