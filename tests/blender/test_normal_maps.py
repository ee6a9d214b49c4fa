"""Simple meshes with normal maps: Cycles shades them as the pixels' own normals ask."""

from __future__ import annotations

import dataclasses
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.blender import views
from pipeline.blender.ball import dress
from pipeline.blender.meshes import add_mesh, decimated
from pipeline.blender.mixtures import mixture_material
from pipeline.blender.normal_maps import normal_map
from pipeline.core.lights import Lights
from pipeline.core.material import STOPS, Mixture
from pipeline.core.material.closures import Lobe
from pipeline.core.material.surface import Surface
from pipeline.core.progress import finish
from pipeline.core.shape import Shape
from pipeline.core.shape.back import closed
from pipeline.core.shape.mesh import relief
from tests import synthetic, tolerances

SIZE = 48
SUN = Lights("distant", np.array([[0.36, 0.48, 0.8]]), np.ones((1, 3)), np.zeros(1, int))
WHITE = Surface(Mixture((Lobe("diffuse"),), np.ones((1, 1, len(STOPS), 3))), np.ones((1, 1, 1, 1), np.float32))


@pytest.fixture
def scene() -> bpy.types.Scene:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.engine = "CYCLES"
    return bpy.context.scene


def wavy() -> Shape:
    """A ball whose normals say more than its mesh: waves as a normal map would have them."""
    ball = synthetic.ball(synthetic.camera(SIZE))
    row, column = np.indices(ball.depth.shape)
    normal = ball.normal.astype(np.float64)
    normal[..., 0] += 0.15 * np.sin(0.9 * column)
    normal[..., 1] += 0.15 * np.sin(0.7 * row)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return dataclasses.replace(ball, normal=normal.astype(np.float32))


def shown(scene: bpy.types.Scene, shape: Shape, item: bpy.types.Object, normals: Any) -> NDArray[np.float64]:
    """What Cycles shades: n.l under one sun, by a white diffuse surface of radiance n.l / pi."""
    dress(item, mixture_material("white", WHITE, normals))
    return np.asarray(finish(views.under_lights(scene, shape.camera, SUN))[0][..., 0] * np.pi, np.float64)


def wanted(shape: Shape) -> NDArray[np.float64]:
    return np.asarray(np.maximum(shape.camera.normals_to_world(shape.normal) @ SUN.position[0], 0))


def inside(shape: Shape) -> NDArray[np.bool_]:
    """Pixels well inside, lit well."""
    known = np.isfinite(shape.depth)
    for _ in range(4):
        known = known & np.roll(known, 1, 0) & np.roll(known, -1, 0) & np.roll(known, 1, 1) & np.roll(known, -1, 1)
    return known & (wanted(shape) > 0.3)


@pytest.mark.parametrize(("keep", "back"), [(1.0, False), (0.1, False), (0.1, True)])
def test_a_mesh_with_its_map_is_shaded_as_the_pixels_are(scene: bpy.types.Scene, keep: float, back: bool) -> None:
    shape = wavy()
    mesh = relief(shape) if keep == 1 else decimated(relief(shape), keep, shape)
    front = len(mesh.faces)
    item = add_mesh(scene, "wavy", closed(mesh, shape) if back else mesh, None)
    normals = normal_map(item, shape, front)
    where = inside(shape)
    right, plain = shown(scene, shape, item, normals), shown(scene, shape, item, None)
    error = np.abs(right[where] / wanted(shape)[where] - 1)
    assert np.median(error) < tolerances.NORMAL_MAP and np.percentile(error, 95) < 10 * tolerances.NORMAL_MAP
    if keep == 1:  # the mesh itself has the normals: the map is neutral
        assert np.median(error) < tolerances.NORMAL_MAP / 10
        return
    assert np.median(np.abs(plain[where] / wanted(shape)[where] - 1)) > 0.02
    for wrong in (normals * [1, -1, 1] + [0, 1, 0], normals[:, ::-1]):
        off = shown(scene, shape, item, np.ascontiguousarray(wrong, np.float32))
        assert np.median(np.abs(off[where] / wanted(shape)[where] - 1)) > 10 * tolerances.NORMAL_MAP


def test_decimation_keeps_shape_and_share(scene: bpy.types.Scene) -> None:
    shape = synthetic.ball(synthetic.camera(SIZE))
    mesh = relief(shape)
    before = len(bpy.data.meshes), len(bpy.data.objects), len(bpy.data.scenes)
    simple = decimated(mesh, 0.2, shape)
    assert (len(bpy.data.meshes), len(bpy.data.objects), len(bpy.data.scenes)) == before
    assert len(simple.faces) == pytest.approx(0.2 * len(mesh.faces), rel=0.1)
    np.testing.assert_allclose(np.linalg.norm(simple.vertices, axis=1), synthetic.RADIUS, atol=0.02)
    np.testing.assert_allclose(np.linalg.norm(simple.normals, axis=1), 1, rtol=1e-6)
    facing = np.einsum("vi,vi->v", simple.normals, simple.vertices) / synthetic.RADIUS
    assert np.median(facing) > 0.99
    assert simple.vertices.min() == pytest.approx(mesh.vertices.min(), abs=0.03)  # the contour stays where it was
