"""The asset: its material renders as the closed form says, its file opens and renders by itself."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from numpy.typing import NDArray

from pipeline.blender import asset, pixels, views
from pipeline.blender.camera import add_camera, camera_of
from pipeline.blender.single_lobe import GROUP, surface_group
from pipeline.core.camera import Camera
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from pipeline.core.reflectance import Reflectance
from pipeline.core.shape import Shape
from tests import oracles, synthetic, tolerances

SIZE = 32
ROUGHNESS = 0.4


@pytest.fixture
def scene() -> bpy.types.Scene:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return bpy.context.scene


@pytest.fixture(scope="module")
def tilted() -> Shape:
    return synthetic.plane(synthetic.camera(SIZE), oracles.unit(np.array([0.3, -0.2, 1.0])))


def maps(**changes: NDArray[np.float64]) -> Reflectance:
    """Colours that vary from pixel to pixel, differently in rows and columns."""
    wave = np.linspace(0.2, 0.8, SIZE)
    albedo = np.stack([wave[:, None] + 0 * wave, 0 * wave[:, None] + wave, np.full((SIZE, SIZE), 0.3)], axis=-1)
    specular = 0.5 * albedo[..., ::-1] * (1.2 - wave[:, None, None])
    grey = np.ones((SIZE, SIZE), np.float32)
    values = {"albedo": albedo, "specular": specular, "edge": 0.7 * grey, "roughness": ROUGHNESS * grey} | changes
    floats = {name: np.asarray(value, np.float32) for name, value in values.items()}
    return Reflectance(**floats, error=grey, notes={"model": "diffuse + GGX", "material_rel_rms": 0.0123})


def predicted(shape: Shape, reflectance: Reflectance, index: int) -> NDArray[np.float64]:
    """The picture under one light in closed form: three closures, no shadows."""
    lamps = synthetic.lights()
    normal = shape.camera.normals_to_world(shape.normal)
    to_viewer = -shape.camera.rays()[1]
    reach = lamps.position[index] - shape.points()
    to_light = oracles.unit(reach)
    half = oracles.unit(to_light + to_viewer)
    glossy = oracles.ggx_cosine(normal, to_light, to_viewer, ROUGHNESS)[..., None]
    grazing = reflectance.edge[..., None] * (1 - oracles.dot(half, to_viewer)[..., None]) ** 5
    f_cos = reflectance.albedo * oracles.lambert_cosine(normal, to_light, 1.0)[..., None]
    f_cos = f_cos + (reflectance.specular + grazing) * glossy
    return np.asarray(f_cos * lamps.intensity[index] / (reach**2).sum(-1)[..., None])


def rendered(scene: bpy.types.Scene, shape: Shape, reflectance: Reflectance, index: int) -> NDArray[np.float32]:
    views.exchange(scene, shape, reflectance)
    lamps = synthetic.lights().select(np.array([index]))
    return finish(views.under_lights(scene, shape.camera, lamps))[0]


def brightest(shape: Shape) -> int:
    """A light near the mirror direction, so that the highlight counts."""
    lamps = synthetic.lights()
    middle = shape.points()[SIZE // 2, SIZE // 2]
    normal = shape.camera.normals_to_world(shape.normal)[SIZE // 2, SIZE // 2]
    view = -shape.camera.rays()[1][SIZE // 2, SIZE // 2]
    mirror = 2 * (normal @ view) * normal - view
    return int(np.argmax(oracles.unit(lamps.position - middle) @ mirror))


def most_grazing(shape: Shape, reflectance: Reflectance) -> int:
    """The light under which the gain towards grazing angles counts most."""
    without = dataclasses.replace(reflectance, edge=0 * reflectance.edge)
    gains = []
    for i in range(len(synthetic.lights())):
        dim, bright = (predicted(shape, r, i) for r in (without, reflectance))
        gains.append((bright / dim).max() if (dim > 0).all() else 0.0)
    return int(np.argmax(gains))


def inside(values: NDArray[np.float32]) -> NDArray[np.float32]:
    return values[2:-2, 2:-2]


def test_cycles_renders_the_recovered_lobes(scene: bpy.types.Scene, tilted: Shape) -> None:
    light = brightest(tilted)
    wanted = inside(predicted(tilted, maps(), light))
    got = inside(rendered(scene, tilted, maps(), light))
    np.testing.assert_allclose(got, wanted, rtol=tolerances.NODES)


@pytest.mark.parametrize("change", ["flipped", "brighter", "rougher", "no edge"])
def test_a_wrong_material_does_not_pass(scene: bpy.types.Scene, tilted: Shape, change: str) -> None:
    right = maps()
    wrong = {
        "flipped": dataclasses.replace(right, albedo=right.albedo[::-1].copy()),
        "brighter": dataclasses.replace(right, albedo=right.albedo * np.float32(1.05)),
        "rougher": dataclasses.replace(right, roughness=right.roughness * np.float32(1.05)),
        "no edge": dataclasses.replace(right, edge=0 * right.edge),
    }[change]
    light = most_grazing(tilted, right) if change == "no edge" else brightest(tilted)
    wanted, got = inside(predicted(tilted, right, light)), inside(rendered(scene, tilted, wrong, light))
    assert np.abs(got / wanted - 1).max() > 3 * tolerances.NODES


def test_images_come_back_and_are_stored_in_the_file(scene: bpy.types.Scene, tmp_path: Path) -> None:
    values = np.random.default_rng(4).uniform(0, 3, (5, 9, 3)).astype(np.float32)
    image = pixels.packed_image("map", values)
    np.testing.assert_array_equal(pixels.array(image)[..., :3], values)
    assert image.packed_file is not None and image.colorspace_settings.name == "Non-Color"
    image.use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "map.blend"), copy=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "map.blend"))
    np.testing.assert_allclose(pixels.array(bpy.data.images["map"])[..., :3], values, rtol=tolerances.TEXTURE)
    assert not np.allclose(pixels.array(bpy.data.images["map"])[..., :3][::-1], values, rtol=0.1)


@pytest.mark.parametrize("model", ["pinhole", "orthographic"])
def test_the_camera_comes_back(scene: bpy.types.Scene, model: str) -> None:
    wanted = dataclasses.replace(synthetic.camera(40, model), centre=(17.5, 23.0)).orbited(np.array([0.1, 0.2, 0]), 33)
    add_camera(scene, wanted)
    scene.view_layers[0].update()
    found = camera_of(scene, 40)
    np.testing.assert_allclose(found.to_world, wanted.to_world, atol=1e-6)
    np.testing.assert_allclose(found.centre, wanted.centre, atol=tolerances.CAMERA_PIXELS)
    np.testing.assert_allclose(found.focal, wanted.focal, rtol=1e-5)


def test_the_camera_of_a_wide_picture_sees_what_it_should(scene: bpy.types.Scene) -> None:
    """Blender's own projection of a point falls on the pixel that the data model's camera says."""
    square = synthetic.camera(40)
    wide = Camera("pinhole", square.to_world, (60, 40), (90.0, 100.0), (25.0, 22.0))
    scene.render.resolution_x, scene.render.resolution_y = wide.resolution
    item = add_camera(scene, wide)
    scene.view_layers[0].update()
    origins, directions = wide.rays()
    for row, column in ((0, 0), (39, 59), (11, 40)):
        point = origins[row, column] + 3 * directions[row, column]
        u, v, _ = world_to_camera_view(scene, item, Vector(point))
        assert (u * 60, (1 - v) * 40) == pytest.approx((column + 0.5, row + 0.5), abs=tolerances.CAMERA_PIXELS)


def test_the_file_opens_and_renders_the_object(tilted: Shape, tmp_path: Path) -> None:
    path = tmp_path / "asset.blend"
    noted = dataclasses.replace(tilted, notes={"method": "double-sphere", "errors": {"depth_median_pct": 0.25}})
    asset.write(path, noted, maps(), "Thing")
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    item = bpy.data.objects["Thing"]
    assert item["depth_median_pct"] == 0.25
    assert item.active_material["material_rel_rms"] == pytest.approx(0.0123)
    assert item.data.uv_layers.active is not None and item.data.has_custom_normals
    assert all(image.packed_file for image in bpy.data.images if image.source == "FILE" or image.type == "UV_TEST")
    assert scene.render.engine == "CYCLES"
    scene.render.resolution_percentage = 8
    scene.cycles.samples = 4
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(tmp_path / "picture.png")
    bpy.ops.render.render(write_still=True)
    picture = pixels.array(bpy.data.images.load(scene.render.filepath))[..., :3]
    middle = len(picture) // 2
    assert picture[middle, middle].max() > 0.2
    assert np.ptp(picture[middle, :, 0]) > 0.02


def test_an_existing_file_is_kept_unless_told_otherwise(tilted: Shape, tmp_path: Path) -> None:
    path = tmp_path / "asset.blend"
    path.write_bytes(b"the artist's work")
    with pytest.raises(LightsphereError, match="exists"):
        asset.write(path, tilted, maps(), "Thing")
    assert path.read_bytes() == b"the artist's work"
    asset.write(path, tilted, maps(), "Thing", overwrite=True)
    assert path.stat().st_size > 10_000


def test_sliders_at_their_defaults_change_nothing_and_tint_does(scene: bpy.types.Scene) -> None:
    group = surface_group()
    assert group.name.startswith(GROUP)
    sockets = {s.name: s for s in group.interface.items_tree if s.in_out == "INPUT"}
    for name in ("Tint", "Specular Tint", "Specular Strength", "Roughness Scale"):
        assert np.all(np.asarray(sockets[name].default_value) == 1)
        assert sockets[name].description
    places = [tuple(node.location) for node in group.nodes]
    assert len(set(places)) == len(places)
