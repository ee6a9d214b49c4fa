"""Run inside a graphical Blender: install the zip, press the buttons of every stage, look at what the window does.

    blender --python drive.py -- ZIP FOLDER

Buttons are called as the panels call them (INVOKE_DEFAULT). Writes screenshots and ``window.json`` into the folder: for
every stage how long it took, the longest time that the window stood still meanwhile and how often that was more than a
tenth of a second; how long Esc took to stop one, and a moved light to be seen.
"""

from __future__ import annotations

import json
import os
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import addon_utils
import bpy

MODULE = "bl_ext.user_default.lightsphere"
ARCHIVE, FOLDER = sys.argv[sys.argv.index("--") + 1 :][:2]
SHOT = os.environ.get("GUI_SHOT", "import -silent -window root")
TICK = 0.02  # [s] between two beats of the window
LATE = 0.1  # [s] between two beats
LONGEST = 600.0  # [s] that a stage may take
CAPTURE = {"inner": 120, "outer": 30, "resolution": 100, "radius_inner": 2.5, "radius_outer": 4.0}

found: dict[str, Any] = {"stages": {}}
beats: dict[str, Any] = {"last": time.monotonic(), "apart": []}


def steps() -> Iterator[float]:
    """Do everything; every number yielded is a time for the window to go on [s]."""
    bpy.context.preferences.view.show_splash = False
    bpy.ops.extensions.package_install_files(filepath=ARCHIVE, repo="user_default", enable_on_install=True)
    assert addon_utils.check(MODULE) == (True, True)  # the operator says FINISHED even when it failed
    yield 1.0
    scene = set_up()
    yield 1.0
    yield from show_tab()
    assert press("add_rig") == {"FINISHED"}
    yield 1.0
    shot("rig")
    yield from escaped(scene)
    yield from estimated(scene, "capture", "draft")
    shot("presets")
    yield from pressed("plan")
    found["planned"] = [effect.name for effect in scene.lightsphere.plan if effect.simulated]
    yield from pressed("capture")
    look_from_camera(scene)
    yield from pressed("shape")
    shot("shape")
    for layer in ("normal", "confidence"):
        scene.lightsphere.layer = layer
        yield 1.0
        shot(f"layer_{layer}")
    yield from show_images()
    yield from plotted()
    yield 0.5
    shot("profile")
    scene.lightsphere.layer = "plain"
    for stage in ("reflectance", "material"):
        yield from pressed(stage)
    shot("material")
    assert press("show_bases") == {"FINISHED"}
    look_around()
    yield 20.0  # shaders are compiled first
    shot("bases")
    yield from pressed("relight")
    shot("relight")
    yield from live(scene)
    yield from pressed("keep")
    scene.lightsphere.compare.lights = 4
    yield from pressed("compare")
    scene.lightsphere.view_light = 3
    yield 1.0
    shot("compare_split")
    for view in ("side", "difference"):
        scene.lightsphere.view = view
        yield 1.0
        shot(f"compare_{view}")
    dropped(scene)
    yield from inverted(scene)


def set_up() -> bpy.types.Scene:
    """Make a scene with a head of two materials before a camera, and save it."""
    bpy.ops.wm.read_homefile(use_empty=False, use_factory_startup=True)
    scene = bpy.context.scene
    for item in [item for item in scene.objects if item.type == "MESH"]:
        bpy.data.objects.remove(item)
    bpy.ops.mesh.primitive_monkey_add(size=1.6)
    head = bpy.context.view_layer.objects.active
    head.modifiers.new("Smooth", "SUBSURF").levels = 2
    head.modifiers["Smooth"].render_levels = 2
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("Glaze")
    if material.node_tree is None:
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.75, 0.3, 0.12, 1.0)
    shader.inputs["Roughness"].default_value = 0.35
    metal = material.copy()
    metal.name, metal.node_tree.nodes["Principled BSDF"].inputs["Metallic"].default_value = "Metal", 1.0
    for one in (material, metal):
        head.data.materials.append(one)
    for face in head.data.polygons:
        face.material_index = int(face.center.z > 0.1)
    scene.camera.location, scene.camera.rotation_euler = (0.0, -4.0, 0.5), (1.45, 0.0, 0.0)
    light = next(item for item in scene.objects if item.type == "LIGHT")
    light.location, light.data.shadow_soft_size = (3.5, -3.0, 2.5), 0.0
    for name, value in CAPTURE.items():
        setattr(scene.lightsphere.capture, name, value)
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(FOLDER) / "head.blend"))
    return scene


def show_tab() -> Iterator[float]:
    """Open the sidebar with the tab."""
    area = next(area for area in window().screen.areas if area.type == "VIEW_3D")
    area.spaces[0].show_region_ui = True
    yield 0.5
    region = next(region for region in area.regions if region.type == "UI")
    region.active_panel_category = "Lightsphere"
    area.tag_redraw()
    yield 1.0


def look_around() -> None:
    """Let the viewport show all that is not hidden, as it is lit."""
    area = next(area for area in window().screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    area.spaces[0].region_3d.view_perspective = "PERSP"
    area.spaces[0].shading.type = "MATERIAL"
    with bpy.context.temp_override(window=window(), area=area, region=region):
        bpy.ops.view3d.view_all()


def look_from_camera(scene: bpy.types.Scene) -> None:
    """Let the viewport show what the camera sees, without what was captured: what is recovered stands in its place."""
    area = next(area for area in window().screen.areas if area.type == "VIEW_3D")
    area.spaces[0].region_3d.view_perspective = "CAMERA"
    for item in scene.objects:
        if item.type == "MESH":
            item.hide_set(True)


def plotted() -> Iterator[float]:
    """Ask by a click why a depth is what it is."""
    area = next(area for area in window().screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    assert press("profile") == {"RUNNING_MODAL"}
    x, y = region.x + region.width // 2, region.y + region.height // 2
    for kind, value in (("MOUSEMOVE", "NOTHING"), ("LEFTMOUSE", "PRESS"), ("LEFTMOUSE", "RELEASE")):
        window().event_simulate(type=kind, value=value, x=x, y=y)
        yield 0.3
    beats["last"], beats["apart"] = time.monotonic(), []
    yield from ended("profile")


def show_images() -> Iterator[float]:
    """Open an Image Editor beside the viewport."""
    area = next(area for area in window().screen.areas if area.type == "VIEW_3D")
    with bpy.context.temp_override(window=window(), area=area):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.4)
    yield 0.5
    min(
        (area for area in window().screen.areas if area.type == "VIEW_3D"), key=lambda area: area.width
    ).type = "IMAGE_EDITOR"
    yield 0.5


def escaped(scene: bpy.types.Scene) -> Iterator[float]:
    """Start a capture, press Esc, and see how soon it is stopped."""
    start("capture")
    run = runs().running
    while not (run.task.stage == "render" and run.task.done >= 3):
        assert runs().running is run, run.task.log
        yield TICK
    window().event_simulate(type="ESC", value="PRESS", x=300, y=300)
    pressed_at = time.monotonic()
    while runs().running is not None:
        assert time.monotonic() - pressed_at < 30
        yield TICK
    found["seconds_to_stop"] = time.monotonic() - pressed_at
    assert bpy.ops.lightsphere.capture.poll()
    yield 0.5
    shot("stopped")


def estimated(scene: bpy.types.Scene, stage: str, preset: str) -> Iterator[float]:
    """Estimate a stage and choose a preset."""
    press("estimate", stage=stage)
    yield from ended("estimate")
    assert press("preset", stage=stage, preset=preset) == {"FINISHED"}
    yield 0.5


def pressed(stage: str) -> Iterator[float]:
    """Press a stage's button and wait for its end, the window going on meanwhile."""
    start(stage)
    yield 1.0
    if stage == "capture":
        while runs().running is not None and runs().running.task.stage != "render":
            yield TICK
        yield 2.0
        shot("running")
    yield from ended(stage)


def start(stage: str) -> None:
    """Press a stage's button."""
    state = press(stage)
    assert state == {"RUNNING_MODAL"}, (stage, state)
    beats["last"], beats["apart"] = time.monotonic(), []


def press(button: str, **properties: Any) -> set[str]:
    """Call an operator as its button does, from the 3D viewport."""
    area = next(area for area in window().screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window(), area=area, region=region):
        return getattr(bpy.ops.lightsphere, button)("INVOKE_DEFAULT", **properties)


def ended(stage: str) -> Iterator[float]:
    """Wait until the worker has ended and its result is in the file."""
    began = time.monotonic()
    while runs().running is not None:
        assert time.monotonic() - began < LONGEST, stage
        yield TICK
    run = runs().last
    assert not run.task.error, (stage, run.task.error)
    late = sum(apart > LATE for apart in beats["apart"])
    found["stages"][stage] = {
        "seconds": time.monotonic() - began,
        "longest_still": max(beats["apart"]),
        "late_pct": 100 * late / len(beats["apart"]),
    }
    yield 1.0


def live(scene: bpy.types.Scene) -> Iterator[float]:
    """Move a light and see how soon the picture follows."""
    press("relight_live")
    session = part("live").session
    began = time.monotonic()
    while session.told:
        assert time.monotonic() - began < 60, session.told
        yield TICK
    light = next(item for item in scene.objects if item.type == "LIGHT")
    times = []
    for _ in range(5):
        light.location.x -= 1.0
        written = session.path.stat().st_mtime_ns
        moved = time.monotonic()
        while session.path.stat().st_mtime_ns == written:
            assert time.monotonic() - moved < 30
            yield TICK
        times.append(time.monotonic() - moved)
    found["live_seconds"] = sorted(times)[2]
    yield 0.5
    shot("live")
    press("relight_live")


def dropped(scene: bpy.types.Scene) -> None:
    """Drop the first capture's file on the viewport."""
    path = bpy.path.abspath(scene.lightsphere.capture_folder)
    scene.lightsphere.capture_folder = ""
    assert press("open_capture", filepath=str(Path(path) / "capture.json")) == {"FINISHED"}
    assert Path(bpy.path.abspath(scene.lightsphere.capture_folder)) == Path(path)


def inverted(scene: bpy.types.Scene) -> Iterator[float]:
    """Take a photograph of the scene, recover its groups from it, apply one and take it back."""
    photograph = Path(FOLDER) / "photograph.exr"
    render = scene.render
    render.engine, render.resolution_x, render.resolution_y, scene.cycles.samples = "CYCLES", 64, 48, 64
    render.image_settings.file_format, render.filepath = "OPEN_EXR", str(photograph)
    for item in scene.objects:  # the head alone, as it was before anything was recovered
        item.hide_render = item.type == "MESH" and not item.name.startswith("Suzanne")
    bpy.ops.render.render(write_still=True)
    scene.lightsphere.photograph = str(photograph)
    scene.lightsphere.inverse.budget = 20.0
    assert press("list_groups") == {"FINISHED"}
    yield from pressed("inverse")
    groups = scene.lightsphere.groups
    found["groups"] = {group.name: group.told for group in groups}
    assert any(group.recovered for group in groups)
    show_alone("LIGHTSPHERE_PT_inverse")
    yield 1.0
    shot("inverse")
    assert press("apply_group") == {"FINISHED"} and any(group.is_applied for group in groups)
    yield 0.5
    assert press("apply_group", revert=True) == {"FINISHED"} and not any(group.is_applied for group in groups)


def show_alone(name: str) -> None:
    """Let the tab show one panel alone, unfolded."""
    for panel in part("panels").CLASSES:
        if getattr(panel, "bl_space_type", "") == "VIEW_3D":
            bpy.utils.unregister_class(panel)
    panel = getattr(part("panels"), name)
    panel.bl_idname, panel.bl_options = f"{name}_alone", set()  # as another panel, which was never folded
    bpy.utils.register_class(panel)


def part(name: str) -> Any:
    """Return a module of the add-on."""
    return sys.modules[f"{MODULE}.blender_addon.{name}"]


def runs() -> Any:
    """Return the module that holds the running stage."""
    return part("runs")


def window() -> bpy.types.Window:
    """Return Blender's window."""
    return bpy.context.window_manager.windows[0]


def shot(name: str) -> None:
    """Take a picture of the screen."""
    assert os.system(f'{SHOT} "{Path(FOLDER) / name}.png"') == 0
    beats["last"] = time.monotonic()  # the window stood still for the picture


going = steps()
resume_at = 0.0


def tick() -> float | None:
    """Beat: note how long the window stood still, and do the next step when its time has come."""
    global resume_at
    now = time.monotonic()
    if MODULE in bpy.context.preferences.addons and runs().running is not None:  # bringing a result is not waited for
        beats["apart"].append(now - beats["last"])
    beats["last"] = now
    if now < resume_at:
        return TICK
    try:
        resume_at = time.monotonic() + next(going)
        beats["last"] = time.monotonic()
        return TICK
    except StopIteration:
        print("WINDOW DRIVEN", bpy.app.version_string, flush=True)
        status = 0
    except BaseException:
        traceback.print_exc()
        shot("failed")
        status = 1
    (Path(FOLDER) / "window.json").write_text(json.dumps(found, indent=1))
    part("runs").stop()
    part("live").stop()
    os._exit(status)  # Blender would ask whether to save


bpy.app.timers.register(tick, first_interval=1.0, persistent=True)
