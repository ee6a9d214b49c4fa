"""Layers of a shape on its mesh: every vertex has what its pixel has."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.blender import meshes, overlays
from pipeline.core.camera import Camera
from pipeline.core.shape import Shape
from pipeline.core.shape.mesh import Mesh

SIZE = 8


@pytest.fixture
def shown() -> tuple[bpy.types.Object, NDArray[np.int64]]:
    """A mesh of two triangles whose vertices lie in known pixels, (4, 2) rows and columns."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    pixels = np.array([[1, 1], [1, 6], [6, 1], [5, 6]])
    uv = np.stack([(pixels[:, 1] + 0.5) / SIZE, 1 - (pixels[:, 0] + 0.5) / SIZE], axis=1)
    vertices = np.concatenate([uv, np.zeros((4, 1))], axis=1)
    mesh = Mesh(vertices, np.tile([0.0, 0.0, 1.0], (4, 1)), uv, np.array([[0, 2, 1], [1, 2, 3]]))
    grid = np.arange(SIZE * SIZE, dtype=np.float32).reshape(SIZE, SIZE)
    normal = np.zeros((SIZE, SIZE, 3), np.float32)
    normal[..., 0], normal[..., 2] = 0.6, 0.8
    camera = Camera("pinhole", np.eye(4), (SIZE, SIZE), (10.0, 10.0), (4.0, 4.0))
    shape = Shape(camera, grid, normal, grid / 63, {"expected_error": 63 - grid})
    item = meshes.add_mesh(bpy.context.scene, "seen", mesh, None)
    overlays.add(item, mesh, shape)
    return item, pixels


def colours(item: bpy.types.Object) -> NDArray[np.float32]:
    values = np.empty(4 * len(item.data.vertices), np.float32)
    item.data.color_attributes[overlays.COLOURS].data.foreach_get("color", values)
    return values.reshape(-1, 4)[:, :3]


def test_a_vertex_has_what_its_pixel_has(shown: tuple[bpy.types.Object, NDArray[np.int64]]) -> None:
    item, pixels = shown
    values = np.empty(4, np.float32)
    item.data.attributes["depth"].data.foreach_get("value", values)
    np.testing.assert_array_equal(values, SIZE * pixels[:, 0] + pixels[:, 1])


def test_the_better_the_yellower(shown: tuple[bpy.types.Object, NDArray[np.int64]]) -> None:
    item, pixels = shown
    order = np.argsort(SIZE * pixels[:, 0] + pixels[:, 1])
    overlays.show(item, "confidence")
    sure = colours(item)
    assert (np.diff(sure[order, 1]) > 0).all()  # green grows along the whole ramp
    overlays.show(item, "expected_error")  # the other way round: where confidence is high, little is expected
    assert (np.diff(colours(item)[order, 1]) > 0).all()
    overlays.show(item, "depth")
    assert (np.diff(colours(item)[order, 1]) > 0).all()


def test_normals_are_colours_and_what_is_unknown_grey(shown: tuple[bpy.types.Object, NDArray[np.int64]]) -> None:
    item, _ = shown
    overlays.show(item, "normal")
    np.testing.assert_allclose(colours(item), np.tile([0.8, 0.5, 0.9], (4, 1)), atol=1e-6)
    item.data.attributes.remove(item.data.attributes["expected_error"])
    overlays.show(item, "expected_error")
    np.testing.assert_allclose(colours(item), 0.2, atol=1e-6)
