"""What the add-on shows beside its stages: costs, layers, comparisons, live light, rig, groups, files."""

from __future__ import annotations

import dataclasses
import json
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Vector

from pipeline.blender import cycles, pixels, rig
from pipeline.blender import scene as scenes
from pipeline.blender.plan import effects
from pipeline.core.settings import limits_of
from tests.addon import ball_before_camera, part
from tests.photographed import directions, lambert, listed, png

FRONT = Vector((0.0, -1.0, 0.0))  # of the unit ball, before the camera


def fields_of(stage: Any) -> list[str]:
    return [item.name for item in dataclasses.fields(stage.settings)]


@pytest.fixture(scope="module")
def captured_file(addon: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with a light, captured, its shape recovered."""
    path = tmp_path_factory.mktemp("captured") / "work.blend"
    scene = ball_before_camera(path)
    bpy.ops.object.light_add(type="POINT", location=(2.5, -3.0, 1.5))
    bpy.context.object.data.energy = 200
    bpy.context.object.data.shadow_soft_size = 0
    assert bpy.ops.lightsphere.capture() == {"FINISHED"}
    assert bpy.ops.lightsphere.shape() == {"FINISHED"}
    assert scene.lightsphere.shape_folder
    bpy.ops.wm.save_mainfile()
    return path


@pytest.fixture
def captured(captured_file: Path) -> bpy.types.Scene:
    bpy.ops.wm.open_mainfile(filepath=str(captured_file))
    return bpy.context.scene


def test_presets_say_what_they_take_and_give_until_something_changes(captured: bpy.types.Scene) -> None:
    costs, stage = part("costs"), part("stages").STAGES["shape"]
    assert costs.presets(stage, captured) == {}
    with pytest.raises(RuntimeError, match="estimate time and error first"):
        bpy.ops.lightsphere.preset(stage="shape", preset="draft")
    assert bpy.ops.lightsphere.estimate(stage="shape") == {"FINISHED"}
    found = costs.presets(stage, captured)
    assert list(found) == ["draft", "standard", "final"]
    assert 0 < found["draft"]["seconds"] <= found["final"]["seconds"]
    assert found["final"]["value"] <= found["draft"]["value"]
    assert bpy.ops.lightsphere.preset(stage="shape", preset="draft") == {"FINISHED"}
    assert captured.lightsphere.shape.pictures == found["draft"]["settings"]["pictures"]
    assert costs.is_set(stage, captured, found["draft"])
    captured.lightsphere.shape.min_lit += 1
    assert costs.presets(stage, captured) == {}  # they hold for other settings
    captured.lightsphere.shape.min_lit -= 1
    assert costs.presets(stage, captured) != {}
    captured.lightsphere.capture_folder = "//elsewhere"
    assert costs.presets(stage, captured) == {}
    assert not list(part("runs").results_folder().glob("estimate_*"))
    assert captured.lightsphere.shape.method == "double-sphere"
    assert costs.last_time(captured, "shape") > 0


def test_a_preset_of_the_capture_takes_samples(scene: bpy.types.Scene) -> None:
    bpy.data.objects.remove(scene.objects["Sphere"])
    bpy.ops.mesh.primitive_torus_add()  # light bounces in it
    scene.lightsphere.capture.effects, scene.lightsphere.capture.error = "full", 0.1
    assert bpy.ops.lightsphere.estimate(stage="capture") == {"FINISHED"}
    scene.lightsphere.capture.simulate = "nonsense"  # the panel is drawn all the same
    assert part("costs").presets(part("stages").STAGES["capture"], scene) == {}
    scene.lightsphere.capture.simulate = ""
    found = part("costs").presets(part("stages").STAGES["capture"], scene)
    bpy.ops.lightsphere.preset(stage="capture", preset="final")
    assert scene.lightsphere.capture.samples == found["final"]["settings"]["samples"]
    assert found["final"]["settings"]["samples"] > found["draft"]["settings"]["samples"]


def test_effects_are_planned_and_decided_by_check_boxes(scene: bpy.types.Scene) -> None:
    bpy.ops.mesh.primitive_plane_add(size=6, location=(0, 0, -1))  # light bounces from it
    shown = scene.lightsphere
    shown.capture.effects, shown.capture.error = "auto", 0.5
    shown.capture.leave_out = "diffuse"  # the artist's, not the plan's
    assert bpy.ops.lightsphere.plan() == {"FINISHED"}
    assert not list(part("runs").results_folder().glob("plan_*"))
    bounced, shadows = shown.plan["diffuse interreflection"], shown.plan["cast shadows"]
    assert bounced.planned and not bounced.simulated and "%" in bounced.adds
    assert shadows.planned and not shadows.switch
    assert not shown.plan["transmission"].switch  # there is nothing to decide
    bounced.simulated = True  # as planned
    assert shown.capture.leave_out == shown.capture.simulate == ""
    bounced.simulated = False
    assert (shown.capture.simulate, shown.capture.leave_out) == ("", "diffuse")
    shown.capture.leave_out = "nonsense"
    assert bounced.simulated
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)
    assert bpy.context.scene.lightsphere.plan["diffuse interreflection"].planned


def test_a_stopped_plan_leaves_nothing(scene: bpy.types.Scene) -> None:
    runs = part("runs")
    run = runs.Run(part("stages").STAGES["plan"], scene)
    run.stop()
    assert run.stopped() == "Stopped; nothing was planned"
    assert not run.folder.exists() and not scene.lightsphere.plan


def test_a_stopped_estimate_leaves_nothing(captured: bpy.types.Scene) -> None:
    runs, stage = part("runs"), part("stages").STAGES["shape"]
    run = runs.Estimate(stage, captured)
    assert runs.busy() and run.folder.is_dir()
    run.stop()
    assert not runs.busy() and not run.folder.exists()
    assert part("costs").presets(stage, captured) == {}


def test_the_mesh_shows_what_is_known_of_it(captured: bpy.types.Scene) -> None:
    data = captured.objects["shape_001"].data
    assert {"confidence", "expected_error", "depth", "normal"} <= set(data.attributes.keys())
    captured.lightsphere.layer = "normal"
    colours = np.empty(4 * len(data.vertices), np.float32)
    data.color_attributes.active_color.data.foreach_get("color", colours)
    right, facing = colours.reshape(-1, 4)[:, 0], colours.reshape(-1, 4)[:, 2]
    place = np.array([vertex.co[:] for vertex in data.vertices])
    assert np.median(abs(right - 0.5 * place[:, 0] - 0.5)) < 0.02  # a unit sphere: its normal is its place
    assert np.median(abs(right - 0.5 * place[:, 2] - 0.5)) > 0.1
    assert np.quantile(facing, 0.1) > 0.5
    captured.lightsphere.layer = "plain"


def test_why_a_depth_is_what_it_is_comes_as_a_plot(captured: bpy.types.Scene) -> None:
    mesh = captured.objects["shape_001"]
    nearest = min(mesh.data.polygons, key=lambda polygon: (mesh.matrix_world @ polygon.center - FRONT).length)
    row, column = part("layers").overlays.pixel_of(mesh, nearest.index)
    assert abs(row - 12) <= 1 and abs(column - 12) <= 1  # of 24 by 24, the camera aims at the ball's middle
    captured.lightsphere.pixel = (row, column)
    assert bpy.ops.lightsphere.profile() == {"FINISHED"}
    plot = bpy.data.images["profile_001"]
    assert plot.packed_file and plot.size[0] > 500
    captured.lightsphere.pixel = (0, 0)
    with pytest.raises(RuntimeError, match="does not show the object"):
        bpy.ops.lightsphere.profile()


def test_capture_and_shape_are_kept_in_a_small_file(captured: bpy.types.Scene) -> None:
    assert bpy.ops.lightsphere.keep() == {"FINISHED"}
    small = next(Path(bpy.data.filepath).parent.rglob("relightable.npz"))
    pictures = next(path for path in small.parent.parent.iterdir() if path.name.startswith("capture"))
    assert small.stat().st_size < sum(path.stat().st_size for path in pictures.iterdir()) / 5
    assert small.with_name("relit.ptm").is_file()


def test_relit_by_the_scene_s_lights(captured: bpy.types.Scene) -> None:
    assert bpy.ops.lightsphere.relight() == {"FINISHED"}
    relit = pixels.array(bpy.data.images["relight_001"])[..., :3]
    height, width = relit.shape[:2]
    upper_right, lower_left = relit[: height // 2, width // 2 :].mean(), relit[height // 2 :, : width // 2].mean()
    assert upper_right > 2 * lower_left  # where the light stands
    bpy.data.objects.remove(next(item for item in captured.objects if item.type == "LIGHT"))
    assert "no light" in part("runs").lacks("relight", captured)


def test_the_relit_picture_follows_a_light(captured: bpy.types.Scene) -> None:
    live = part("live")
    light = next(item for item in captured.objects if item.type == "LIGHT")
    assert bpy.ops.lightsphere.relight_live() == {"FINISHED"}

    def settled() -> np.ndarray:
        deadline = time.monotonic() + 60
        live.tick()
        while live.session.told and time.monotonic() < deadline:
            live.tick()
            time.sleep(0.02)
        assert live.session.told == ""
        return pixels.array(bpy.data.images[live.IMAGE])[..., :3]

    first = settled()
    light.location.x = -2.5
    live.session.told = "asked"
    second = settled()
    half = first.shape[1] // 2
    assert first[:, half:].sum() > first[:, :half].sum()
    assert second[:, half:].sum() < second[:, :half].sum()
    light.location = (0.0, -0.5, 0.0)  # inside the object
    live.session.told = ""
    deadline = time.monotonic() + 30
    while not live.session.told and time.monotonic() < deadline:
        live.tick()
        time.sleep(0.02)
    assert "inside the object" in live.session.told
    light.location = (2.5, -3.0, 1.5)
    live.session.told = "asked"
    np.testing.assert_array_equal(settled(), first)  # it goes on, and the same light gives the same picture
    bpy.ops.lightsphere.relight_live()
    assert live.session is None


def test_another_file_ends_the_live_picture(captured: bpy.types.Scene) -> None:
    bpy.ops.lightsphere.relight_live()
    session = part("live").session
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert part("live").session is None
    assert session._worker.has_ended


def test_lights_inside_the_object_are_told_as_they_are_moved(scene: bpy.types.Scene) -> None:
    overlay = part("rig_overlay")
    bpy.ops.lightsphere.add_rig()
    (item,) = part("results").rigs(scene)
    overlay.examine(scene)
    assert overlay.told(item) == ""
    item.scale = (0.4, 0.4, 0.4)  # the inner surface is inside the sphere now
    overlay.examine(scene)
    assert "40 of 60 lights are inside" in overlay.told(item)
    item.scale = (1.0, 1.0, 1.0)
    overlay._moved_at = time.monotonic()  # it moves still: looking at every triangle can wait
    overlay.tick()
    assert "inside" in overlay.told(item)
    overlay._moved_at -= overlay.STILL
    overlay.tick()
    assert overlay.told(item) == ""


def test_the_rig_follows_radii_and_counts_where_it_was_moved_to(scene: bpy.types.Scene) -> None:
    shown = scene.lightsphere.capture
    shown.rig = "double-hemisphere"
    bpy.ops.lightsphere.add_rig()
    (item,) = part("results").rigs(scene)
    assert bpy.context.view_layer.objects.active == item
    item.location += Vector((1.0, 2.0, 3.0))
    shown.inner, shown.radius_inner = 50, 2.5
    bpy.context.view_layer.update()
    radii = [(item.matrix_world @ vertex.co - Vector((1.0, 2.0, 3.0))).length for vertex in item.data.vertices]
    np.testing.assert_allclose(radii, [2.5] * 50 + [3.0] * 20, rtol=1e-5)  # about the ball, moved along
    assert min((item.matrix_world @ vertex.co).z for vertex in item.data.vertices) > 3.0  # halves stay halves
    shown.radius_inner = 4.0  # larger than the outer one: it stays as it is
    assert part("results").intersect(scene)
    assert len(item.data.vertices) == 70
    assert max(vertex.co.length for vertex in item.data.vertices) < 3.5
    shown.radius_inner, shown.power = 2.0, 3.0
    made = rig.lights_of(item)
    np.testing.assert_allclose(made.intensity, 3 * np.pi * 2.0**2, rtol=1e-6)  # a white surface at 2 m reflects 3
    assert bpy.ops.lightsphere.capture() == {"FINISHED"}  # lights keep their intensities and surfaces


@pytest.mark.slow
def test_groups_are_edited_found_applied_and_taken_back(addon: None, tmp_path: Path) -> None:
    scene = scenes.load("colour-box")
    scene.render.resolution_x, scene.render.resolution_y = 32, 24
    scene.render.use_file_extension = False
    scene.cycles.samples, scene.cycles.seed, scene.cycles.use_adaptive_sampling = 256, 99, False
    with cycles.openexr(scene):
        cycles.render(scene, tmp_path / "photograph.exr")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "box.blend"))
    scene = bpy.context.scene
    shown = scene.lightsphere
    assert "No photograph is chosen" in part("runs").lacks("inverse", scene)
    shown.photograph = "//photograph.exr"
    shown.inverse.budget, shown.inverse.levels = 8.0, "diffuse"
    bpy.ops.lightsphere.list_groups()
    assert {"Red", "Green", "Floor"} <= {item.name for item in shown.groups}
    boxes = [item for item in scene.objects if item.name in ("Tall", "Short")]
    assert len(boxes) == 2
    for item in scene.objects:
        item.select_set(item in boxes)
    with bpy.context.temp_override(selected_objects=boxes):
        bpy.ops.lightsphere.assign_group(name="Boxes")
    assert {"Boxes"} <= {item.name for item in shown.groups}
    assert not {"Tall", "Short"} & {item.name for item in shown.groups}
    before = [slot.material for item in scene.objects for slot in item.material_slots]
    assert bpy.ops.lightsphere.inverse() == {"FINISHED"}
    assert [slot.material for item in scene.objects for slot in item.material_slots] == before  # nothing is applied
    red = next(item for item in shown.groups if item.name == "Red")
    assert "diffuse" in red.told and "±" in red.told
    wall = next(slot.object for slot in red.slots)
    bpy.ops.lightsphere.apply_group(index=list(shown.groups).index(red))
    assert red.is_applied and wall.material_slots[0].material == red.recovered
    others = [item for item in shown.groups if item.name != "Red"]
    assert not any(item.is_applied for item in others)
    bpy.ops.lightsphere.apply_group(revert=True)
    assert [slot.material for item in scene.objects for slot in item.material_slots] == before
    bpy.data.objects.remove(boxes[0])
    with pytest.raises(RuntimeError, match="lost a surface"):
        bpy.ops.lightsphere.apply_group()


def test_files_are_opened_from_the_import_menu(scene: bpy.types.Scene, tmp_path: Path) -> None:
    folder = tmp_path / "ball"
    folder.mkdir()
    lights = directions(4)
    for i, picture in enumerate(lambert(lights)):
        png(folder / f"IMG_{i}.png", np.round(65535 * picture).astype(np.uint16))
    (folder / "lights.txt").write_text(listed(lights))
    assert bpy.ops.lightsphere.open_photographs(filepath=str(folder / "IMG_0.png")) == {"FINISHED"}
    made = Path(bpy.path.abspath(scene.lightsphere.capture_folder))
    assert json.loads((made / "capture.json").read_text())["lights"]
    assert scene.lightsphere.shape.method == "acls"  # distant lights
    scene.lightsphere.capture_folder, scene.lightsphere.shape.method = "", "double-sphere"
    assert bpy.ops.lightsphere.open_capture(filepath=str(made / "capture.json")) == {"FINISHED"}
    assert Path(bpy.path.abspath(scene.lightsphere.capture_folder)) == made
    assert scene.lightsphere.shape.method == "acls"
    with pytest.raises(RuntimeError, match="no finished capture"):
        bpy.ops.lightsphere.open_capture(filepath=str(folder / "lights.txt"))
    handler = bpy.types.LIGHTSPHERE_FH_photographs
    assert ".lp" in handler.bl_file_extensions and handler.bl_import_operator == "lightsphere.open_photographs"


def test_a_scanned_mesh_gives_the_shape(captured: bpy.types.Scene, tmp_path: Path) -> None:
    ball = captured.objects["Sphere"]
    for item in captured.objects:
        item.select_set(item == ball)
    bpy.ops.wm.ply_export(
        filepath=str(tmp_path / "ball.ply"), export_selected_objects=True, forward_axis="Y", up_axis="Z"
    )
    assert bpy.ops.lightsphere.open_scan(filepath=str(tmp_path / "ball.ply")) == {"FINISHED"}
    folder = Path(bpy.path.abspath(captured.lightsphere.shape_folder))
    notes = json.loads((folder / "shape.json").read_text())["notes"]
    assert notes["mesh"].endswith("ball.ply")
    captured.lightsphere.scan = ""


def test_a_report_says_what_a_bug_report_needs(captured: bpy.types.Scene) -> None:
    words = part("preferences").report()
    assert bpy.app.version_string in words and "last stage: shape" in words


def test_the_weight_of_a_cache_is_told(addon: None, tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "kernel").write_bytes(bytes(1234))
    assert part("preferences").size(tmp_path) == 1234


def test_labels_buttons_and_tooltips_are_translated(addon: None) -> None:
    words = part("translations").GERMAN
    classes = [
        *part("operators").CLASSES,
        *part("group_operators").CLASSES,
        *part("view_operators").CLASSES,
        *part("files").CLASSES,
        *part("panels").CLASSES,
    ]
    operators = [item for item in classes if issubclass(item, bpy.types.Operator)]
    labels = {item.bl_label for item in classes if hasattr(item, "bl_label")} - {"Material"}  # Blender's own word
    tips = {item.__doc__ for item in operators}
    assert len(operators) > 15
    assert not (labels | tips) - set(words)
    assert not [tip for tip in tips if tip.endswith(".")]  # Blender's habit
    fields = [
        item for stage in part("stages").STAGES.values() if hasattr(stage, "settings") for item in fields_of(stage)
    ]
    settings = {name.replace("_", " ").title() for name in fields}
    named = (effects.SHADOWS, effects.FALL_OFF, *effects.SWITCHES, *effects.INSIDE, effects.NOISE, effects.SATURATION)
    planned = {name.capitalize() for name in named}
    choices = {
        word.replace("-", " ").title()
        for stage in part("stages").STAGES.values()
        if hasattr(stage, "settings")
        for item in dataclasses.fields(stage.settings)
        for word in limits_of(item).choices
    } - {"Acls", "Cycles", "Diligent", "Ggx", "Lp"}  # names
    assert not (settings | choices | planned | set(part("costs").WORDS.values())) - set(words)
    folder = Path(part("stages").__file__).parent
    source = "".join(path.read_text() for path in folder.glob("*.py") if path.name != "translations.py")
    known = settings | choices | tips | planned | {"Draft", "Standard", "Final"}
    assert not [key for key in words if f'"{key}' not in source and key not in known]  # what nobody shows
