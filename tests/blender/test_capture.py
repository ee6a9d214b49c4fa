"""A capture leaves the scene as it was, and its files do not depend on how it was made."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from pipeline import cli
from pipeline.blender import capture, cycles, geometry, rig
from pipeline.blender import scene as scenes
from pipeline.core import rig as layouts
from pipeline.core.capture import Capture
from pipeline.core.capture_settings import CaptureSettings
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from tests import tolerances
from tests.blender import small_scenes

SMALL = CaptureSettings(inner=6, outer=4, resolution=24, effects="direct", workers=1)


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def state(scene: bpy.types.Scene) -> dict[str, Any]:
    """Return every simple value of what a capture touches, and which data there is."""
    owners = [scene.render, scene.render.image_settings, scene.cycles, scene.view_layers[0], scene.camera.data.dof]
    owners += [*scene.objects, *bpy.data.materials]
    found: dict[str, Any] = {"world": scene.world, "objects": [item.name for item in bpy.data.objects]}
    found["data"] = [[item.name for item in kind] for kind in (bpy.data.meshes, bpy.data.lights, bpy.data.cameras)]
    for owner in owners:
        for name, kind in owner.bl_rna.properties.items():
            simple = kind.type in ("BOOLEAN", "INT", "FLOAT", "STRING", "ENUM") and not getattr(kind, "is_array", False)
            if simple and name != "use_nodes":  # deprecated in Blender 5
                found[f"{owner!r}.{name}"] = getattr(owner, name)
    return found


@pytest.fixture
def scene() -> bpy.types.Scene:
    """Return a ball in a scene whose every setting is unlike what a capture needs, with lights of its own."""
    made = small_scenes.lambert(0.5)
    made.world = bpy.data.worlds.new("World")
    bpy.ops.object.light_add(type="POINT", location=(2, -3, 3))
    made.render.engine = "BLENDER_WORKBENCH"
    made.render.resolution_percentage = 50
    made.render.filepath = "//mine"
    made.render.use_border = True
    made.render.image_settings.file_format = "JPEG"
    made.render.image_settings.color_mode = "BW"
    made.render.image_settings.quality = 55
    made.cycles.samples = 77
    made.cycles.filter_width = 3.0
    made.cycles.sample_clamp_indirect = 4.0
    made.cycles.use_denoising = True
    made.view_layers[0].use_pass_combined = False
    made.view_layers.new("Other")
    made.camera.data.dof.use_dof = True
    bpy.data.objects[0].pass_index = 5
    bpy.data.materials[0].pass_index = 9
    return made


def test_scene_is_as_before(scene: bpy.types.Scene, tmp_path: Path) -> None:
    before = state(scene)
    finish(capture.capture(scene, "test", tmp_path, SMALL))
    assert state(scene) == before
    scene.cycles.samples = 78
    assert state(scene) != before


def test_scene_is_as_before_when_stopped_half_way(scene: bpy.types.Scene, tmp_path: Path) -> None:
    before = state(scene)
    work = capture.capture(scene, "test", tmp_path, SMALL)
    for _ in range(3):
        next(work)
    assert state(scene) != before
    work.close()
    assert state(scene) == before
    assert len(list(tmp_path.glob("light_*.exr"))) == 3


def test_scene_is_as_before_when_a_picture_cannot_be_written(scene: bpy.types.Scene, tmp_path: Path) -> None:
    before = state(scene)
    (tmp_path / "light_0002.exr").mkdir()
    with pytest.raises(LightsphereError, match=r"light_0002\.exr cannot be written"):
        finish(capture.capture(scene, "test", tmp_path, SMALL))
    assert state(scene) == before


def test_scene_settings_do_not_matter(scene: bpy.types.Scene, tmp_path: Path) -> None:
    finish(capture.capture(scene, "test", tmp_path / "odd", SMALL))
    finish(capture.capture(small_scenes.lambert(0.5), "test", tmp_path / "plain", SMALL))
    odd, plain = Capture.open(tmp_path / "odd"), Capture.open(tmp_path / "plain")
    assert odd.checksums == plain.checksums
    assert max(plain.image(i).max() for i in range(len(plain))) > 0.1


def test_second_user_of_a_mesh_changes_no_picture(tmp_path: Path) -> None:
    scene = small_scenes.lambert(0.5)
    finish(capture.capture(scene, "test", tmp_path / "cached", SMALL))
    scene.objects[0].copy()  # outside the scene; now the mesh counts as shared and is left alone
    finish(capture.capture(scene, "test", tmp_path / "plain", SMALL))
    cached, plain = Capture.open(tmp_path / "cached"), Capture.open(tmp_path / "plain")
    for i in range(len(plain)):
        assert abs(cached.image(i) - plain.image(i)).max() < tolerances.MESH_CACHE


def test_workers_change_no_byte(tmp_path: Path) -> None:
    for workers in (1, 2):
        settings = dataclasses.replace(SMALL, inner=20, workers=workers)
        loaded = scenes.load("teapot-lambert")
        finish(capture.capture(loaded, "teapot-lambert", tmp_path / str(workers), settings))
    assert bytes_of(tmp_path / "1") == bytes_of(tmp_path / "2")


def test_damaged_and_missing_pictures_are_rendered_again(tmp_path: Path) -> None:
    scene = small_scenes.lambert(0.5)
    done = finish(capture.capture(scene, "test", tmp_path, SMALL))
    whole = bytes_of(tmp_path)
    assert done.changed() == done.damaged() == []
    (tmp_path / "light_0001.exr").unlink()
    (tmp_path / "light_0004.exr").write_bytes(whole["light_0003.exr"])
    (tmp_path / "truth.exr").write_bytes(b"damaged")
    (tmp_path / ".light_0001.exr.4711.part").write_bytes(b"left by a killed process")
    assert done.changed() == ["light_0001.exr", "light_0004.exr"]
    assert done.damaged() == ["light_0001.exr", "light_0004.exr", "truth.exr"]
    steps = []
    finish(capture.capture(scene, "test", tmp_path, SMALL), steps.append)
    assert bytes_of(tmp_path) == whole
    assert [step.done for step in steps if step.stage == "render"] == [9, 10]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"resolution": 25}, "resolution 24, not 25"),
        ({"inner": 7}, "inner 6, not 7"),
        ({"pixel_type": "half", "seed": 3}, "seed 0, not 3, pixel_type float, not half"),
    ],
)
def test_capture_is_not_continued_with_other_settings(tmp_path: Path, change: dict[str, Any], said: str) -> None:
    scene = small_scenes.lambert(0.5)
    finish(capture.capture(scene, "test", tmp_path, SMALL))
    before = bytes_of(tmp_path)
    with pytest.raises(LightsphereError, match=said):
        finish(capture.capture(scene, "test", tmp_path, dataclasses.replace(SMALL, **change)))
    scene.camera.location.x += 0.1
    with pytest.raises(LightsphereError, match="another camera"):
        finish(capture.capture(scene, "test", tmp_path, SMALL))
    assert bytes_of(tmp_path) == before


def test_a_description_that_leads_out_of_its_folder_is_not_followed(scene: bpy.types.Scene, tmp_path: Path) -> None:
    folder = tmp_path / "capture"
    made = finish(capture.capture(scene, "ball", folder, SMALL))
    harmful = dataclasses.replace(made, files=("../outside.exr", *made.files[1:]), checksums=("", *made.checksums[1:]))
    harmful.save()
    with pytest.raises(LightsphereError, match="holds a capture with other"):
        finish(capture.capture(scene, "ball", folder, SMALL))
    assert not (tmp_path / "outside.exr").exists()


def test_a_capture_is_continued_on_the_device_that_began_it(tmp_path: Path) -> None:
    scene = small_scenes.lambert(0.5)
    whole = finish(capture.capture(scene, "test", tmp_path, SMALL))
    dataclasses.replace(whole, notes=whole.notes | {"device": "CUDA"}).save()
    with pytest.raises(LightsphereError, match="device CUDA, not CPU"):
        finish(capture.capture(scene, "test", tmp_path, SMALL))
    older = {name: value for name, value in whole.notes.items() if name != "device"}
    dataclasses.replace(whole, notes=older).save()
    assert finish(capture.capture(scene, "test", tmp_path, SMALL)).notes == older


def test_half_floats_are_the_rounded_floats(tmp_path: Path) -> None:
    scene = small_scenes.lambert(0.5)
    for kind in ("float", "half"):
        finish(capture.capture(scene, "test", tmp_path / kind, dataclasses.replace(SMALL, pixel_type=kind)))
    exact, rounded = Capture.open(tmp_path / "float"), Capture.open(tmp_path / "half")
    for i in range(len(exact)):
        assert (abs(exact.image(i) - rounded.image(i)) <= tolerances.HALF * exact.image(i) + 1e-7).all()
    assert any((exact.image(i) != rounded.image(i)).any() for i in range(len(exact)))


def test_rig_object_moves_and_scales_the_lights(tmp_path: Path) -> None:
    scene = small_scenes.lambert(0.5)
    placed = layouts.double_sphere(SMALL, np.zeros(3))
    item = rig.add(scene, placed, SMALL)
    item.location, item.scale = (0.1, 0.2, 0.3), (2, 2, 2)
    made = finish(capture.capture(scene, "test", tmp_path, dataclasses.replace(SMALL, rig="scene")))
    expected = 2 * (placed.position - placed.position.mean(axis=0)) + (0.1, 0.2, 0.3)
    assert np.allclose(made.lights.position, expected, atol=1e-5)
    assert np.allclose(made.lights.intensity, placed.intensity) and (made.lights.surface == placed.surface).all()
    assert (made.mask() == Capture.open(tmp_path).mask()).all() and made.mask().any()


def test_backdrop_is_no_object(tmp_path: Path) -> None:
    loaded = scenes.load("teapot-lambert")
    made = finish(capture.capture(loaded, "teapot-lambert", tmp_path, SMALL))
    truth, mask = made.truth(), made.mask()
    assert truth is not None
    on_ground = np.isclose(truth.position[..., 2], loaded.objects["Ground"].location.z, atol=1e-4)
    assert on_ground.any() and not (mask & on_ground & (truth.normal[..., 1] > 0.5)).any()
    assert set(np.unique(truth.material[mask])) == {1} and set(np.unique(truth.material)) == {0, 1, 2}
    assert truth.diameter == pytest.approx(2.4, abs=1e-5)


def test_own_blend_is_captured_and_left_alone(tmp_path: Path) -> None:
    small_scenes.lambert(0.5)
    bpy.ops.object.light_add(type="SUN")
    path = tmp_path / "mine.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    before = path.read_bytes()
    words = ["capture", str(path), "-o", str(tmp_path / "out"), "--inner", "4", "--outer", "4", "--resolution", "16"]
    assert cli.main([*words, "--effects", "direct", "--workers", "2"]) == 0
    made = Capture.open(tmp_path / "out")
    assert made.notes["scene"] == "mine.blend" and made.mask().any() and path.read_bytes() == before
    shutil.copy(path, tmp_path / "copy.blend")
    bpy.context.scene.frame_end += 1
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert cli.main([*words, "--effects", "direct"]) == 2  # the file is no longer the one that was captured


def no_camera(scene: bpy.types.Scene) -> None:
    scene.camera = None


def panoramic(scene: bpy.types.Scene) -> None:
    scene.camera.data.type = "PANO"


def looking_away(scene: bpy.types.Scene) -> None:
    scene.camera.rotation_euler.x += 3.1


def nothing(scene: bpy.types.Scene) -> None:
    scene.objects[0].hide_render = True


def all_backdrop(scene: bpy.types.Scene) -> None:
    scene.objects[0]["lightsphere_backdrop"] = True


def glowing(scene: bpy.types.Scene) -> None:
    nodes = bpy.data.materials[0].node_tree.nodes
    emission = nodes.new("ShaderNodeEmission")
    bpy.data.materials[0].node_tree.links.new(emission.outputs[0], nodes["Material Output"].inputs[0])


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (no_camera, "has no camera"),
        (panoramic, "is a PANO"),
        (looking_away, "does not see the object"),
        (nothing, "shows no surface"),
        (all_backdrop, "shows no surface"),
        (glowing, "shine without a light"),
    ],
)
def test_scenes_that_cannot_be_captured_are_refused(tmp_path: Path, spoil: Any, said: str) -> None:
    scene = small_scenes.lambert(0.5)
    spoil(scene)
    with pytest.raises(LightsphereError, match=said):
        finish(capture.capture(scene, "test", tmp_path, SMALL))


def test_light_inside_the_object_is_named(tmp_path: Path) -> None:
    path = tmp_path / "lights.txt"
    path.write_text("0 0 3\n2 0 0\n0.2 -0.3 0.4\n")
    settings = dataclasses.replace(SMALL, rig=str(path))
    with pytest.raises(LightsphereError, match=r"light 2 at \(0\.2, -0\.3, 0\.4\) m is inside the object"):
        finish(capture.capture(small_scenes.lambert(0.5), "test", tmp_path / "c", settings))


@pytest.mark.parametrize("place", ["corner", "face"])
def test_light_on_the_surface_is_named(place: str) -> None:
    triangles = geometry.object_triangles(small_scenes.lambert(0.5))
    on = triangles[77, 0] if place == "corner" else triangles[77].mean(axis=0)
    off = on * 1.01
    geometry.check_outside(np.stack([off, 3 * on]), triangles)
    with pytest.raises(LightsphereError, match=r"light 1 at .* on its surface, as 1 of 2 lights"):
        geometry.check_outside(np.stack([off, on]), triangles)


def test_every_setting_of_cycles_exists() -> None:
    scene = small_scenes.empty()
    assert all(hasattr(scene.cycles, name) for name in cycles.CYCLES)
    assert all(hasattr(scene.render, name) for name in cycles.RENDER)
