"""The add-on in Blender without a window: what it registers, its settings, and every stage by its operator."""

from __future__ import annotations

import dataclasses
import json
import time
from pathlib import Path

import bpy
import numpy as np
import pytest
import typer.main

from pipeline import cli
from pipeline.blender import pixels
from pipeline.core.capture import Capture
from pipeline.core.capture_settings import CaptureSettings
from pipeline.core.compare import CompareSettings
from pipeline.core.errors import LightsphereError
from pipeline.core.inverse import InverseSettings
from pipeline.core.material import MaterialSettings
from pipeline.core.photographs.settings import ImportSettings
from pipeline.core.reflectance import ReflectanceSettings
from pipeline.core.relight import RelightSettings
from pipeline.core.settings import limits_of
from pipeline.core.shape.settings import ShapeSettings
from tests import photographed
from tests.addon import MODULE, part

# isort: split
import addon_utils  # Blender's own, there once bpy is imported

SETTINGS = {
    "capture": CaptureSettings,
    "import_photographs": ImportSettings,
    "shape": ShapeSettings,
    "reflectance": ReflectanceSettings,
    "material": MaterialSettings,
    "relight": RelightSettings,
    "inverse": InverseSettings,
    "compare": CompareSettings,
}
COMMAND = {name: name for name in SETTINGS} | {"import_photographs": "import"}  # which Python keeps for itself


def registered() -> set[str]:
    """Return the names of everything that an add-on can leave in Blender."""
    kinds = {name for name in dir(bpy.types) if "lightsphere" in name.lower()}
    owners = (bpy.types.Scene, bpy.types.WindowManager, bpy.types.Object, bpy.types.World)
    attributes = {f"{owner.__name__}.{name}" for owner in owners for name in dir(owner) if "lightsphere" in name}
    handlers = {
        f"{name}[{i}] {handler.__module__}"
        for name in dir(bpy.app.handlers)
        if isinstance(listed := getattr(bpy.app.handlers, name), list)
        for i, handler in enumerate(listed)
    }
    operators = {f"ops.{name}" for name in dir(bpy.ops.lightsphere)}
    menus = {
        f"{name}: {draw.__module__}"
        for name in dir(bpy.types)
        for draw in getattr(getattr(getattr(bpy.types, name), "draw", None), "_draw_funcs", [])
    }
    return kinds | attributes | handlers | operators | menus


def test_it_takes_everything_back() -> None:
    before = registered()
    addon_utils.enable(MODULE)
    added = registered() - before
    addon_utils.disable(MODULE)
    assert {"Scene.lightsphere", "LIGHTSPHERE_OT_capture", "LIGHTSPHERE_PT_shape"} <= added
    assert registered() == before


@pytest.mark.parametrize("stage", SETTINGS)
def test_panel_command_line_and_dataclass_agree(addon: None, stage: str) -> None:
    shown = getattr(bpy.context.scene.lightsphere, stage).bl_rna.properties
    options = {option.name: option for option in typer.main.get_command(cli.app).commands[COMMAND[stage]].params}
    fields = dataclasses.fields(SETTINGS[stage])
    assert {item.name for item in fields} == set(shown.keys()) - {"rna_type", "name"}
    for item in fields:
        limits, prop = limits_of(item), shown[item.name]
        assert options[item.name].default == item.default
        assert f"--{item.name.replace('_', '-')}" in options[item.name].opts
        assert limits.help in options[item.name].help
        assert prop.description.lower().startswith(limits.help.lower())
        assert prop.default == (pytest.approx(item.default) if isinstance(item.default, float) else item.default)
        if limits.low is not None:
            assert prop.hard_min == pytest.approx(limits.low)
        if limits.high is not None:
            assert prop.hard_max == pytest.approx(limits.high)
        if limits.choices:
            assert tuple(prop.enum_items.keys()) == limits.choices


@pytest.mark.parametrize("stage", SETTINGS)
def test_what_the_panel_shows_is_what_the_command_gets(addon: None, stage: str) -> None:
    shown = getattr(bpy.context.scene.lightsphere, stage)
    for item in dataclasses.fields(SETTINGS[stage]):
        if isinstance(item.default, bool):
            setattr(shown, item.name, not item.default)
        elif isinstance(item.default, int | float):
            setattr(shown, item.name, item.default + 1)
    settings = part("settings").values(shown, SETTINGS[stage])
    words = part("settings").options(settings)
    references = ["SECOND"] if stage in ("compare", "inverse") else []
    arguments = [COMMAND[stage], "IN", *references, "-o", "OUT", *words]
    context = typer.main.get_command(cli.app).make_context("lightsphere", arguments[:1], resilient_parsing=True)
    command = context.command.commands[COMMAND[stage]]
    parsed = command.make_context(stage, arguments[1:], parent=context).params
    for item in dataclasses.fields(SETTINGS[stage]):
        assert parsed[item.name] == getattr(settings, item.name), item.name


def test_values_out_of_their_limits_cannot_be_shown(addon: None) -> None:
    capture = bpy.context.scene.lightsphere.capture
    capture.inner = 1
    assert capture.inner == limits_of(dataclasses.fields(CaptureSettings)[1]).low


def test_a_button_that_cannot_run_says_why(scene: bpy.types.Scene, tmp_path: Path) -> None:
    lacks = part("runs").lacks
    assert lacks("capture", scene) == ""
    assert "No capture" in lacks("shape", scene)
    assert "No shape" in lacks("material", scene)
    assert "No capture" in lacks("compare", scene)
    assert not bpy.ops.lightsphere.shape.poll()
    scene.lightsphere.capture_folder = "//nowhere"
    assert "No finished capture" in lacks("shape", scene)
    (tmp_path / "capture.json").write_text("{")  # damaged
    scene.lightsphere.capture_folder = str(tmp_path)
    assert "No finished capture" in lacks("shape", scene)
    scene.lightsphere.capture.rig = "scene"
    assert "add one" in lacks("capture", scene)
    scene.camera = None
    scene.lightsphere.capture.rig = "double-sphere"
    assert "no camera" in lacks("capture", scene)
    with pytest.raises(RuntimeError, match="no camera"):
        bpy.ops.lightsphere.capture()


def test_the_rig_is_one_undo_step(scene: bpy.types.Scene) -> None:
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.lightsphere.add_rig("EXEC_DEFAULT", True) == {"FINISHED"}  # with undo, as a button does
    assert len(part("results").rigs(bpy.context.scene)) == 1
    assert bpy.context.scene.lightsphere.capture.rig == "scene"
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.ed.undo()
    assert part("results").rigs(bpy.context.scene) == []
    assert bpy.context.scene.lightsphere.capture.rig == "double-sphere"


def test_a_rig_that_cannot_stand_is_refused(scene: bpy.types.Scene) -> None:
    scene.lightsphere.capture.radius_inner = 0.5
    with pytest.raises(RuntimeError, match="inside"):
        bpy.ops.lightsphere.add_rig()
    assert part("results").rigs(scene) == []


def test_from_rig_to_asset(scene: bpy.types.Scene, tmp_path: Path) -> None:
    before = (tmp_path / "work.blend").read_bytes()
    assert bpy.ops.lightsphere.add_rig() == {"FINISHED"}
    assert bpy.ops.lightsphere.capture() == {"FINISHED"}
    folder = tmp_path / "work.lightsphere" / "capture_001"
    assert scene.lightsphere.capture_folder == "//work.lightsphere/capture_001"
    assert bpy.data.images["capture_001"].source == "SEQUENCE"
    assert bpy.ops.lightsphere.shape() == {"FINISHED"}
    recovered = scene.objects["shape_001"]
    assert len(recovered.data.polygons) > 50
    # The front of the unit sphere at the origin, seen from -y.
    distance = [(recovered.matrix_world @ vertex.co).length for vertex in recovered.data.vertices]
    assert abs(sorted(distance)[len(distance) // 2] - 1) < 0.02
    assert bpy.ops.lightsphere.material() == {"FINISHED"}
    asset = scene.objects["Recovered"]
    assert asset.data.uv_layers and asset.active_material.node_tree.nodes
    bases = bpy.data.images["material_001 bases"]  # each on balls and over angles
    assert bases.packed_file and bases.size[0] > 1000
    assert "Lightsphere" in {tag.name for tag in asset.active_material.asset_data.tags}
    assert len([item for item in scene.objects if item.type == "CAMERA"]) == 1
    assert bpy.ops.lightsphere.show_bases() == {"FINISHED"}
    balls = [item for item in scene.objects if item.get("lightsphere_basis_of") == asset.name]
    assert len(balls) == 1 and balls[0].active_material.name == f"{asset.active_material.name} basis 1"
    asset.location.x += 3  # to look at it beside the original
    scene.lightsphere.compare.lights, scene.lightsphere.compare.bounces = 2, 0
    with pytest.raises(RuntimeError, match="no comparison is there"):
        bpy.ops.lightsphere.view_comparison()
    assert bpy.ops.lightsphere.compare() == {"FINISHED"}
    maps = [image for image in bpy.data.images if image.name.startswith("compare_001 ")]
    assert len(maps) == 3 and all(image.packed_file and image.size[0] > 100 for image in maps)
    compared_views(scene)
    found = json.loads((tmp_path / "work.lightsphere" / "compare_001" / "comparison.json").read_text())
    assert found["comparisons"]["new_lights"]["relight_rel_rmse"] < 0.2
    assert bpy.ops.lightsphere.capture() == {"FINISHED"}  # once more: beside the first, not over it
    assert Path(scene.lightsphere.capture_folder).name == "capture_002"
    assert (folder / "capture.json").is_file()
    assert (tmp_path / "work.blend").read_bytes() == before


def compared_views(scene: bpy.types.Scene) -> None:
    """Look at a comparison of 24x24 pixels split, side by side and apart."""
    shown, image = scene.lightsphere, bpy.data.images[part("comparison").IMAGE]
    shown.view_split = 0.0
    asset = pixels.array(image)[..., :3]
    shown.view_split = 1.0
    capture = pixels.array(image)[..., :3]
    assert asset.shape == capture.shape == (24, 24, 3)
    assert not np.array_equal(asset, capture)
    shown.view = "side"
    assert image.size[0] > 2 * 24
    shown.view = "difference"
    assert image.size[1] > 100  # with its scale
    shown.view_light, shown.view_kind = 2, "new_lights"
    assert bpy.ops.lightsphere.view_comparison() == {"FINISHED"}
    folder = Path(bpy.path.abspath(shown.comparison_folder))
    figures = json.loads((folder / "comparison.json").read_text())
    fewer = {"comparisons": {"captured": figures["comparisons"]["captured"]}}  # as of photographs, which have no scene
    (folder / "comparison.json").write_text(json.dumps(fewer))
    assert bpy.ops.lightsphere.view_comparison() == {"FINISHED"}
    (folder / "comparison.json").write_text("{")  # damaged
    with pytest.raises(RuntimeError, match="no comparison is there"):
        bpy.ops.lightsphere.view_comparison()
    (folder / "comparison.json").write_text(json.dumps(figures))
    (folder / "pictures").rename(folder / "elsewhere")
    with pytest.raises(RuntimeError, match="lost its pictures"):
        bpy.ops.lightsphere.view_comparison()
    shown.view_light = 1  # a choice alone says nothing
    (folder / "elsewhere").rename(folder / "pictures")


def test_photographs_become_a_capture(scene: bpy.types.Scene, tmp_path: Path) -> None:
    assert "No photographs are chosen" in part("runs").lacks("import_photographs", scene)
    scene.lightsphere.photographs = "//nowhere"
    assert "No photographs are there" in part("runs").lacks("import_photographs", scene)
    folder = tmp_path / "ball"
    folder.mkdir()
    lights = photographed.directions(4)
    for i, picture in enumerate(photographed.lambert(lights)):
        photographed.png(folder / f"IMG_{i}.png", np.round(65535 * picture).astype(np.uint16))
    (tmp_path / "dome.txt").write_text(photographed.listed(lights))
    scene.lightsphere.photographs = "//ball"
    scene.lightsphere.import_photographs.lights = "//dome.txt"
    assert bpy.ops.lightsphere.import_photographs() == {"FINISHED"}
    assert scene.lightsphere.capture_folder == "//work.lightsphere/import_photographs_001"
    assert bpy.data.images["import_photographs_001"].source == "SEQUENCE"
    made = Capture.open(Path(bpy.path.abspath(scene.lightsphere.capture_folder)))
    np.testing.assert_allclose(made.lights.position, lights, atol=1e-6)
    scene.lightsphere.import_photographs.response = "bright"
    with pytest.raises(RuntimeError, match="response bright is no file"):
        bpy.ops.lightsphere.import_photographs()


def test_escape_keeps_what_is_finished_and_the_button_continues(scene: bpy.types.Scene) -> None:
    runs, stages = part("runs"), part("stages")
    scene.lightsphere.capture.inner, scene.lightsphere.capture.resolution = 200, 100
    run = runs.Run(stages.STAGES["capture"], scene)
    assert "Esc" in runs.lacks("shape", scene)
    deadline = time.monotonic() + 60
    while not (run.task.stage == "render" and run.task.done >= 3):
        assert run.event("TIMER") == "running" and time.monotonic() < deadline
        time.sleep(0.01)
    assert run.event("ESC") == "running"  # the picture at hand is finished, the window does not wait for it
    while run.event("TIMER") == "running":
        time.sleep(0.01)
    assert run.task.stopped
    assert runs.running is None
    pictures = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in run.folder.glob("light_*.exr")}
    assert 3 <= len(pictures) < 220
    assert runs.stopped_capture() == run.folder
    assert bpy.ops.lightsphere.capture(resume=True) == {"FINISHED"}
    assert runs.stopped_capture() is None
    assert len(list(run.folder.glob("light_*.exr"))) == 220
    assert all(path.read_bytes() == content for path, (_, content) in pictures.items())
    again = [path for path, (written, _) in pictures.items() if path.stat().st_mtime_ns != written]
    assert len(again) <= 1  # the one that was finished when Esc came, not yet written down


def test_the_worker_s_complaint_reaches_the_artist(scene: bpy.types.Scene) -> None:
    scene.lightsphere.capture.radius_inner = 0.5
    with pytest.raises(RuntimeError, match="inside"):
        bpy.ops.lightsphere.capture()
    assert part("runs").running is None


def test_a_damaged_picture_is_named(scene: bpy.types.Scene) -> None:
    bpy.ops.lightsphere.capture()
    victim = Path(bpy.path.abspath(scene.lightsphere.capture_folder)) / "light_0007.exr"
    victim.write_bytes(victim.read_bytes()[:100])
    with pytest.raises(RuntimeError, match=r"light_0007\.exr"):
        bpy.ops.lightsphere.shape()


def test_closing_the_add_on_stops_the_worker(scene: bpy.types.Scene) -> None:
    runs, stages = part("runs"), part("stages")
    run = runs.Run(stages.STAGES["capture"], scene)
    addon_utils.disable(MODULE)
    assert not run.task.poll() and run.task.stopped
    addon_utils.enable(MODULE)


def test_the_words_of_a_run_are_kept_with_its_result(scene: bpy.types.Scene) -> None:
    runs, stages = part("runs"), part("stages")
    run = runs.Run(stages.STAGES["capture"], scene)
    run.stop()
    words = json.loads((run.folder / runs.COMMAND).read_text())
    assert words[0] == "capture" and "--inner=40" in words
    with pytest.raises(LightsphereError.__mro__[1]):
        run.bring()
