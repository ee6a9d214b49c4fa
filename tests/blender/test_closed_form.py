"""Pictures in closed form are those of Cycles, and where they would not be Cycles renders."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import bpy
import numpy as np
import pytest

from pipeline import cli
from pipeline.blender import capture, closed_form, cycles
from pipeline.blender import scene as scenes
from pipeline.blender.closed_form import capture as choosing
from pipeline.blender.olat import pictures
from pipeline.core.capture import Capture
from pipeline.core.capture_settings import CaptureSettings
from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from tests.blender import small_scenes
from tests.tolerances import CLOSED_FORM_LIGHT, CLOSED_FORM_PIXEL

LIGHTS = 6
GLOSSY, PRINCIPLED = "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfPrincipled"


def both(scene: bpy.types.Scene, rig: str = "double-sphere", side: int = 48) -> tuple[np.ndarray, np.ndarray]:
    """Return pictures (L, H, W, 3) by Cycles and in closed form."""
    settings = CaptureSettings(rig=rig, inner=LIGHTS, outer=LIGHTS, radius_inner=2.5, radius_outer=4, resolution=side)
    described = capture.describe(scene, "test", Path(), settings)
    form = closed_form.prepare(scene, described.camera)
    chosen = range(len(described))
    rendered = np.stack(list(pictures(scene, described.camera, cycles.DIRECT, described.lights, chosen)))
    return rendered, np.stack([form.picture(described.lights, i) for i in chosen])


def agree(rendered: np.ndarray, made: np.ndarray) -> bool:
    """Whether nearly all pixels are the same to float32, and the light that differs is that of a few pixels."""
    lit = rendered > 1e-4 * rendered.max()
    pixel = abs(made[lit] / rendered[lit] - 1)
    light = abs(made - rendered).sum() / rendered.sum()
    return bool(np.percentile(pixel, 99) < CLOSED_FORM_PIXEL and light < CLOSED_FORM_LIGHT)


def mixed() -> bpy.types.Material:
    """Return a material of textured closures, mixed and added."""
    made = small_scenes.material("Mixed", "ShaderNodeBsdfDiffuse", {})
    nodes, link = made.node_tree.nodes, made.node_tree.links.new
    diffuse = next(node for node in nodes if node.type == "BSDF_DIFFUSE")
    output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    glossy, principled = nodes.new(GLOSSY), nodes.new(PRINCIPLED)
    mix, add = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeAddShader")
    waves, noise = nodes.new("ShaderNodeTexWave"), nodes.new("ShaderNodeTexNoise")
    glossy.distribution = "GGX"
    noise.inputs["Scale"].default_value = 3
    link(noise.outputs["Color"], diffuse.inputs["Color"])
    link(noise.outputs["Color"], principled.inputs["Base Color"])
    link(noise.outputs[0], glossy.inputs["Roughness"])
    link(waves.outputs["Fac"], mix.inputs[0])
    link(diffuse.outputs[0], mix.inputs[1])
    link(principled.outputs[0], mix.inputs[2])
    link(mix.outputs[0], add.inputs[0])
    link(glossy.outputs[0], add.inputs[1])
    link(add.outputs[0], output.inputs["Surface"])
    return made


@pytest.mark.parametrize(
    ("node", "inputs", "attributes"),
    [
        ("ShaderNodeBsdfDiffuse", {"Color": (0.2, 0.5, 0.8, 1)}, {}),
        (GLOSSY, {"Color": (0.2, 0.5, 0.8, 1), "Roughness": 0.3}, {"distribution": "GGX"}),
        (GLOSSY, {"Color": (0.2, 0.5, 0.8, 1), "Roughness": 0.9}, {"distribution": "MULTI_GGX"}),
        (GLOSSY, {"Color": (0.2, 0.5, 0.8, 1), "Roughness": 0.4}, {"distribution": "BECKMANN"}),
        (PRINCIPLED, {"Base Color": (0.2, 0.5, 0.8, 1), "Roughness": 0.2}, {}),
        (PRINCIPLED, {"Base Color": (0.2, 0.5, 0.8, 1), "Roughness": 0.7, "IOR": 1.8, "Specular IOR Level": 0.9}, {}),
        (PRINCIPLED, {"Base Color": (0.9, 0.6, 0.2, 1), "Roughness": 0.5, "Metallic": 1.0}, {}),
        (PRINCIPLED, {"Base Color": (0.9, 0.6, 0.2, 1), "Roughness": 0.5, "Metallic": 1.0}, {"distribution": "GGX"}),
    ],
)
def test_closures_are_those_of_cycles(node: str, inputs: dict[str, object], attributes: dict[str, str]) -> None:
    rendered, made = both(small_scenes.ball(node, inputs, **attributes))
    assert agree(rendered, made)
    assert not agree(rendered, 1.001 * made)
    assert not agree(rendered, made[:, :, ::-1])


def test_roughness_is_found_out() -> None:
    scene = small_scenes.ball(GLOSSY, {"Roughness": 0.3}, distribution="GGX")
    rendered, _ = both(scene)
    node = next(n for n in bpy.data.materials["Ball"].node_tree.nodes if n.type == "BSDF_GLOSSY")
    node.inputs["Roughness"].default_value = 0.301
    assert not agree(rendered, both(scene)[1])


@pytest.mark.parametrize("rig", ["double-sphere", "distant"])
@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_textures_mixtures_and_shadows(rig: str, kind: str) -> None:
    """Two bodies that shade each other, one scaled, flat and without a material of its own kind."""
    scene = small_scenes.ball("ShaderNodeBsdfDiffuse", {})
    ball = next(item for item in scene.objects if item.type == "MESH")
    ball.data.materials[0] = mixed()
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0.9, -0.8, 0.4), rotation=(0.3, 0.5, 0.2))
    cube = bpy.context.object
    cube.scale = (0.5, 1.0, 0.8)
    cube.modifiers.new("Bevel", "BEVEL").segments = 3
    cube.data.materials.append(small_scenes.material("Cube", PRINCIPLED, {"Roughness": 0.4}))
    scene.camera.data.type, scene.camera.data.ortho_scale = kind, 3.5
    assert agree(*both(scene, rig, side=64))


def test_start_of_shadow_rays_is_lifted() -> None:
    scene = scenes.load("thin")
    described = capture.describe(scene, "thin", Path(), CaptureSettings(inner=LIGHTS, outer=LIGHTS, resolution=64))
    form = closed_form.prepare(scene, described.camera)
    flat = dataclasses.replace(form, surface=dataclasses.replace(form.surface, lift=0 * form.surface.lift))
    rendered = np.stack(list(pictures(scene, described.camera, cycles.DIRECT, described.lights, range(2 * LIGHTS))))
    assert not agree(rendered, np.stack([flat.picture(described.lights, i) for i in range(2 * LIGHTS)]))


@pytest.mark.parametrize("name", ["gourd", "teapot-plastic", "thin"])
def test_built_in_scenes(name: str) -> None:
    scene = scenes.load(name)
    settings = CaptureSettings(inner=LIGHTS, outer=LIGHTS, resolution=64)
    described = capture.describe(scene, name, Path(), settings)
    form = closed_form.prepare(scene, described.camera)
    rendered = np.stack(list(pictures(scene, described.camera, cycles.DIRECT, described.lights, range(len(described)))))
    assert agree(rendered, np.stack([form.picture(described.lights, i) for i in range(len(described))]))


def glass(scene: bpy.types.Scene, ball: bpy.types.Object) -> None:
    ball.data.materials[0] = small_scenes.material("Glass", "ShaderNodeBsdfGlass", {})


def coat(scene: bpy.types.Scene, ball: bpy.types.Object) -> None:
    ball.data.materials[0] = small_scenes.material("Coat", PRINCIPLED, {"Coat Weight": 0.5})


def rough_diffuse(scene: bpy.types.Scene, ball: bpy.types.Object) -> None:
    ball.data.materials[0] = small_scenes.material("Clay", "ShaderNodeBsdfDiffuse", {"Roughness": 0.5})


def no_material(scene: bpy.types.Scene, ball: bpy.types.Object) -> None:
    ball.data.materials.clear()


def bumps(scene: bpy.types.Scene, ball: bpy.types.Object) -> None:
    tree = ball.data.materials[0].node_tree
    diffuse = next(node for node in tree.nodes if node.type == "BSDF_DIFFUSE")
    tree.links.new(tree.nodes.new("ShaderNodeBump").outputs[0], diffuse.inputs["Normal"])


def unseen(scene: bpy.types.Scene, ball: bpy.types.Object) -> None:
    ball.visible_shadow = False


def hair(scene: bpy.types.Scene, ball: bpy.types.Object) -> None:
    scene.collection.objects.link(bpy.data.objects.new("Hair", bpy.data.hair_curves.new("Hair")))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (glass, "Glass BSDF in the material Glass"),
        (coat, "Coat Weight of Principled BSDF"),
        (rough_diffuse, "Roughness of Diffuse BSDF"),
        (no_material, "without a material"),
        (bumps, "the normals of Diffuse BSDF"),
        (unseen, "which some rays do not see"),
        (hair, "the object Hair, which is not a surface"),
    ],
)
def test_what_has_no_closed_form_is_said(change: object, reason: str) -> None:
    scene = small_scenes.ball("ShaderNodeBsdfDiffuse", {})
    change(scene, next(item for item in scene.objects if item.type == "MESH"))
    with pytest.raises(closed_form.Inexact, match=reason):
        closed_form.prepare(scene, capture.camera_of(scene, 16))


def test_materials_are_as_before() -> None:
    scene = scenes.load("gourd")
    materials = sorted((m.name, len(m.node_tree.nodes), m.pass_index) for m in bpy.data.materials)
    slots = [slot.material.name for item in scene.objects for slot in item.material_slots]
    closed_form.prepare(scene, capture.camera_of(scene, 16))
    assert materials == sorted((m.name, len(m.node_tree.nodes), m.pass_index) for m in bpy.data.materials)
    assert slots == [slot.material.name for item in scene.objects for slot in item.material_slots]
    assert not len(scene.view_layers[0].aovs)


# Captures.

WORDS = ["--inner", "24", "--outer", "8", "--resolution", "32", "--effects", "direct"]


def test_captures_agree_and_say_how(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder, extra in (("closed", []), ("cycles", ["--renderer", "cycles"]), ("again", ["--workers", "1"])):
        assert cli.main(["capture", "teapot-plastic", "-o", str(tmp_path / folder), *WORDS, *extra]) == 0
    assert "in closed form" in capsys.readouterr().out
    closed, rendered, again = (Capture.open(tmp_path / name) for name in ("closed", "cycles", "again"))
    assert closed.notes["renderer"]["name"] == "closed form" and len(closed.notes["renderer"]["checked"]) == 4
    assert closed.notes["renderer"]["differs_pct"] < 0.01
    assert rendered.notes["renderer"] == {
        "name": "cycles",
        "reason": "asked for by --renderer",
        "checked": [],
        "differs_pct": None,
    }
    assert closed.checksums == again.checksums
    stacks = [np.stack([one.image(i) for i in range(len(one))]) for one in (rendered, closed)]
    assert agree(*stacks)


def test_stopped_capture_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    settings = CaptureSettings(inner=24, outer=8, resolution=24, effects="direct")
    whole = finish(capture.capture(scenes.load("steps"), "steps", tmp_path / "whole", settings))
    work = capture.capture(scenes.load("steps"), "steps", tmp_path / "stopped", settings)
    while next(work).stage != "render":
        pass
    work.close()
    before = sorted((tmp_path / "stopped").glob("light_*"))
    assert 0 < len(before) < len(whole)
    resumed = finish(capture.capture(scenes.load("steps"), "steps", tmp_path / "stopped", settings))
    assert resumed.checksums == whole.checksums
    assert not list((tmp_path / "stopped").glob(".*.part"))


def test_capture_that_cannot_go_on_without_cycles_says_so(tmp_path: Path) -> None:
    settings = CaptureSettings(inner=24, outer=8, resolution=24, effects="direct")
    made = finish(capture.capture(scenes.load("steps"), "steps", tmp_path, settings))
    (tmp_path / made.files[3]).unlink()
    scene = scenes.load("steps")
    scene.objects[0].visible_shadow = False
    with pytest.raises(LightsphereError, match="made without Cycles, which now has to render, for the object"):
        finish(capture.capture(scene, "steps", tmp_path, settings))


def test_surface_without_closures_is_black() -> None:
    scene = small_scenes.ball("ShaderNodeBsdfDiffuse", {})
    tree = bpy.data.materials["Ball"].node_tree
    tree.links.remove(tree.links[0])
    rendered, made = both(scene, side=16)
    assert rendered.max() == made.max() == 0


def test_cycles_renders_where_both_disagree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choosing, "AGREES", 0.0)
    settings = CaptureSettings(inner=24, outer=8, resolution=24, effects="direct", workers=1)
    made = finish(capture.capture(scenes.load("steps"), "steps", tmp_path, settings))
    assert made.notes["renderer"]["name"] == "cycles" and "differ from Cycles" in made.notes["renderer"]["reason"]


def test_half_floats_are_written(tmp_path: Path) -> None:
    settings = CaptureSettings(inner=24, outer=8, resolution=24, effects="direct", pixel_type="half")
    made = finish(capture.capture(scenes.load("steps"), "steps", tmp_path, settings))
    assert made.notes["renderer"]["name"] == "closed form"
    image = made.image(0)
    assert (image == image.astype(np.float16)).all() and image.max() > 0


def test_light_below_the_ground_lights_nothing_above() -> None:
    scene = scenes.load("teapot-lambert")
    form = closed_form.prepare(scene, capture.camera_of(scene, 32))
    below = Lights("near", np.array([[0.0, 0, -3.0]]), np.ones((1, 3)), np.zeros(1, np.int64))
    assert form.picture(below, 0).max() == 0
