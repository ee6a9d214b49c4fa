"""Rays against closed forms, and a camera that survives its own file."""

from __future__ import annotations

import json

import numpy as np
import pytest

from pipeline.core.camera import Camera
from pipeline.core.errors import LightsphereError


def rigid(seed: int = 3) -> np.ndarray:
    """Return a random rotation and position as a (4, 4) matrix."""
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, rng.normal(size=3)
    return matrix


def camera(model: str) -> Camera:
    return Camera(model, rigid(), (7, 5), (11.0, 12.0), (3.25, 2.75))


def project(eye: Camera, points: np.ndarray) -> np.ndarray:
    """Return where points fall in the picture [px], by the textbook projection."""
    local = (points - eye.to_world[:3, 3]) @ eye.to_world[:3, :3]
    scale = -local[..., 2:] if eye.model == "pinhole" else 1.0
    x, y = np.moveaxis(local[..., :2] / scale, -1, 0)
    return np.stack([eye.centre[0] + eye.focal[0] * x, eye.centre[1] - eye.focal[1] * y], axis=-1)


@pytest.mark.parametrize("model", ["pinhole", "orthographic"])
def test_points_on_a_ray_fall_on_the_centre_of_its_pixel(model: str) -> None:
    eye = camera(model)
    origins, directions = eye.rays()
    assert origins.shape == directions.shape == (5, 7, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1, atol=1e-14)
    columns, rows = np.meshgrid(np.arange(7) + 0.5, np.arange(5) + 0.5)
    centres = np.stack([columns, rows], axis=-1)
    for depth in (0.1, 4.0):
        np.testing.assert_allclose(project(eye, origins + depth * directions), centres, atol=1e-12)
    assert np.abs(project(eye, origins[::-1] + directions[::-1]) - centres).max() > 1  # rows upside down are noticed


def test_by_hand() -> None:
    """A pixel one focal length right of and above the axis looks along (1, 1, -1)."""
    eye = Camera("pinhole", np.eye(4), (3, 3), (1.0, 1.0), (1.5, 1.5))
    np.testing.assert_allclose(eye.rays()[1][0, 2], np.array([1, 1, -1]) / np.sqrt(3))
    flat = Camera("orthographic", np.eye(4), (3, 3), (1.0, 1.0), (1.5, 1.5))
    origins, directions = flat.rays()
    np.testing.assert_allclose(origins[0, 2], [1, 1, 0])
    np.testing.assert_allclose(directions[0, 2], [0, 0, -1])


def test_depth_of_a_pinhole_is_the_distance_from_its_centre() -> None:
    eye = camera("pinhole")
    origins, directions = eye.rays()
    np.testing.assert_allclose(np.linalg.norm(origins + 2.5 * directions - eye.to_world[:3, 3], axis=-1), 2.5)


def test_normals_turn_to_the_world_and_back() -> None:
    eye = camera("pinhole")
    normals = np.random.default_rng(0).normal(size=(4, 6, 3))
    np.testing.assert_allclose(eye.normals_to_camera(eye.normals_to_world(normals)), normals, atol=1e-14)
    towards_viewer = eye.normals_to_world(np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(towards_viewer, eye.to_world[:3, 2])
    assert np.abs(eye.normals_to_camera(normals) - normals).max() > 0.1  # the wrong space would be noticed


@pytest.mark.parametrize("model", ["pinhole", "orthographic"])
def test_json_returns_the_same_camera(model: str) -> None:
    eye = camera(model)
    same = Camera.from_json(json.loads(json.dumps(eye.as_json())))
    np.testing.assert_array_equal(same.to_world, eye.to_world)
    assert (same.model, same.resolution, same.focal, same.centre) == (model, eye.resolution, eye.focal, eye.centre)


@pytest.mark.parametrize(
    "change",
    [
        {"model": "fisheye"},
        {"to_world": [[1, 0], [0, 1]]},
        {"to_world": np.full((4, 4), np.nan).tolist()},
        {"resolution": [3]},
        {"resolution": [0, 5]},
        {"focal": [0, 1]},
        {"focal": ["far", 1]},
        {"centre": None},
        {"centre": [float("inf"), 1]},
    ],
    ids=str,
)
def test_a_description_that_is_no_camera_is_refused(change: dict[str, object]) -> None:
    value = camera("pinhole").as_json()
    Camera.from_json(value)
    with pytest.raises(LightsphereError, match="write the capture again"):
        Camera.from_json({**value, **change})
    for key in value:
        with pytest.raises(LightsphereError, match=key):
            Camera.from_json({k: v for k, v in value.items() if k != key})


@pytest.mark.parametrize("model", ["pinhole", "orthographic"])
def test_project_undoes_rays(model: str) -> None:
    eye = camera(model)
    place = np.random.default_rng(0).uniform(0, 5, (40, 2))
    origins, directions = eye.rays_at(place)
    depth = np.linspace(0.5, 9, 40)
    found, distance = eye.project(origins + depth[:, None] * directions)
    np.testing.assert_allclose(found, place, atol=1e-12)
    np.testing.assert_allclose(distance, depth, rtol=1e-12)
    assert (eye.project(origins - depth[:, None] * directions)[1] < 0).all()
