"""The plan switches on what contributes, says so, and is found out where it is wrong."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import cli
from pipeline.blender import capture, cycles, plan
from pipeline.blender import scene as scenes
from pipeline.blender.olat import pictures
from pipeline.blender.plan import contents, effects
from pipeline.blender.plan.probe import Groups, Trial, differences
from pipeline.core.capture import Capture
from pipeline.core.capture_settings import CaptureSettings, PlanSettings
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from tests.blender import small_scenes

QUICK = PlanSettings(
    inner=6, outer=4, resolution=16, samples=32, workers=1, probes=2, probe_resolution=24, probe_samples=16
)
SMALL = ["--inner", "4", "--outer", "4", "--resolution", "24", "--samples", "8"]


def planned(scene: object, settings: PlanSettings = QUICK, **changes: object) -> plan.Plan:
    settings = dataclasses.replace(settings, **changes)
    return finish(plan.decide(scene, capture.describe(scene, "test", Path(), settings).lights, settings))


def rows(found: plan.Plan) -> dict[str, effects.Effect]:
    return {effect.effect: effect for effect in found.effects}


def simulated(found: plan.Plan) -> set[str]:
    return {effect.effect for effect in found.effects if effect.simulated}


# What a scene can show at all.


def test_nothing_bounces_on_one_convex_body() -> None:
    found = planned(small_scenes.lambert(0.8))
    assert found.transport == cycles.DIRECT and found.missing is None
    assert rows(found)["diffuse interreflection"].reason == "no surface faces another"
    assert simulated(found) == {"near-light fall-off"}


def test_two_convex_bodies_or_one_with_a_dent_face_each_other() -> None:
    import bpy

    scene = small_scenes.lambert(0.8)
    ball = next(item for item in scene.objects if item.type == "MESH")
    assert "diffuse interreflection" in contents.ruled_out(scene)
    ball.data.vertices[100].co *= 0.9
    assert "diffuse interreflection" not in contents.ruled_out(scene)
    ball.data.vertices[100].co /= 0.9
    ball.data.flip_normals()
    assert "diffuse interreflection" in contents.ruled_out(scene)
    other = bpy.data.objects.new("Other", ball.data)
    other.location.x = 3
    scene.collection.objects.link(other)
    assert "diffuse interreflection" not in contents.ruled_out(scene)


def test_surfaces_without_a_material_count_too() -> None:
    bounced = rows(planned(without_materials(), error=0.5))["diffuse interreflection"]
    assert bounced.simulated and bounced.group == "no material" and bounced.contribution_pct > 1


def without_materials() -> Any:
    import bpy

    scene = small_scenes.lambert(0.8)
    bpy.ops.mesh.primitive_plane_add(size=2.4, location=(0, 0, -1))
    for item in scene.objects:
        if item.type == "MESH":
            item.data.materials.clear()
    return scene


def test_an_open_bowl_faces_itself_and_a_plane_does_not() -> None:
    import bmesh
    import bpy

    scene = small_scenes.lambert(0.8)
    ball = next(item for item in scene.objects if item.type == "MESH")
    shape = bmesh.new()
    shape.from_mesh(ball.data)
    bmesh.ops.delete(shape, geom=[v for v in shape.verts if v.co.z > 0], context="VERTS")
    shape.to_mesh(ball.data)
    assert "diffuse interreflection" not in contents.ruled_out(scene)
    bpy.data.objects.remove(ball)
    bpy.ops.mesh.primitive_grid_add(rotation=(0.3, 0.5, 0.1))
    assert "diffuse interreflection" in contents.ruled_out(scene)


@pytest.mark.parametrize(
    ("node", "inputs", "present"),
    [
        ("ShaderNodeBsdfDiffuse", {}, {"diffuse interreflection"}),
        ("ShaderNodeBsdfMetallic", {}, {"glossy interreflection"}),
        ("ShaderNodeBsdfPrincipled", {}, {"diffuse interreflection", "glossy interreflection", "caustics"}),
        ("ShaderNodeBsdfPrincipled", {"Metallic": 1.0}, {"glossy interreflection"}),
        ("ShaderNodeBsdfPrincipled", {"Specular IOR Level": 0.0}, {"diffuse interreflection"}),
        ("ShaderNodeBsdfGlass", {}, {"glossy interreflection", "transmission"}),
        ("ShaderNodeSubsurfaceScattering", {}, {"diffuse interreflection", "subsurface"}),
        ("ShaderNodeEmission", {}, {"emission"}),
    ],
)
def test_effects_follow_from_the_closures(node: str, inputs: dict[str, object], present: set[str]) -> None:
    scene = small_scenes.lambert(0.8)
    ball = next(item for item in scene.objects if item.type == "MESH")
    ball.data.vertices[100].co *= 0.9
    ball.data.materials[0] = small_scenes.material("Tried", node, inputs)
    of_camera = {"depth of field", "motion blur"}
    of_material = {*effects.SWITCHES, *effects.INSIDE} - of_camera
    assert of_material - set(contents.ruled_out(scene)) == present


def test_light_below_the_surface_leaves_it_elsewhere() -> None:
    scene = small_scenes.lambert(0.8)
    assert "diffuse interreflection" in contents.ruled_out(scene)
    ball = next(item for item in scene.objects if item.type == "MESH")
    ball.data.materials[0] = small_scenes.material("Wax", "ShaderNodeSubsurfaceScattering", {})
    assert "diffuse interreflection" not in contents.ruled_out(scene)


def test_instances_hair_and_smoke_count() -> None:
    import bpy

    scene = small_scenes.lambert(0.8)
    hair = bpy.data.objects.new("Hair", bpy.data.hair_curves.new("Hair"))
    scene.collection.objects.link(hair)
    assert "diffuse interreflection" not in contents.ruled_out(scene)
    bpy.data.objects.remove(hair)
    assert {"diffuse interreflection", "volumes", "transmission"} <= contents.ruled_out(scene).keys()
    smoke = bpy.data.objects.new("Smoke", bpy.data.volumes.new("Smoke"))
    scene.collection.objects.link(smoke)
    assert "volumes" not in contents.ruled_out(scene)
    bpy.data.objects.remove(smoke)
    ball = next(item for item in scene.objects if item.type == "MESH")
    glass = bpy.data.objects.new("Glass", ball.data.copy())
    glass.data.materials[0] = small_scenes.material("Glass", "ShaderNodeBsdfGlass", {})
    away = bpy.data.collections.new("Away")
    away.objects.link(glass)
    holder = bpy.data.objects.new("Holder", None)
    holder.instance_type, holder.instance_collection = "COLLECTION", away
    scene.collection.objects.link(holder)
    assert "transmission" not in contents.ruled_out(scene)


def test_lens_and_motion_count_where_the_scene_has_them() -> None:
    scene = small_scenes.lambert(0.8)
    scene.camera.data.dof.use_dof = scene.render.use_motion_blur = True
    assert contents.ruled_out(scene)["motion blur"] == "nothing moves"
    assert "depth of field" not in contents.ruled_out(scene)
    next(item for item in scene.objects if item.type == "MESH").keyframe_insert("location", frame=1)
    assert "motion blur" not in contents.ruled_out(scene)


def test_a_lens_that_blurs_is_simulated_in_the_scenes_own_light() -> None:
    import bpy

    scene = small_scenes.lambert(0.8)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.location, lamp.data.energy = (2, -4, 4), 500
    scene.collection.objects.link(lamp)
    lens = scene.camera.data.dof
    lens.use_dof, lens.focus_distance = True, 1.0
    for stop, wanted in ((0.05, True), (64.0, False)):
        lens.aperture_fstop = stop
        found = finish(plan.decide(scene, None, QUICK))
        assert found.transport.depth_of_field == wanted
        assert ("depth of field" in simulated(found)) == wanted


# What the probe measures.


def test_difference_holds_no_noise_on_average() -> None:
    """A known difference is found under noise ten times as large; the plain root mean square would be the noise."""
    rng = np.random.default_rng(1)
    shape = (2, 3, 40, 40, 3)
    light = np.ones(shape)
    groups = Groups({1: "one"}, np.ones((1, 40, 40), np.int64))
    for change in (0.0, 0.05):
        pattern = change * rng.choice([-1, 1], shape[1:])  # changes pixels, not their sum
        noisy = [light + 0.5 * rng.standard_normal(shape) for _ in range(2)]
        (found,) = differences(Trial(noisy[0], 1, 1), Trial(noisy[1] - pattern, 1, 1), groups)
        assert abs(found.share - change) < 3 * found.deviation
        assert found.deviation < 0.08
    (found,) = differences(Trial(light, 1, 1), Trial(light - 0.05, 1, 1), groups)
    assert found.share == pytest.approx(0.05) and found.deviation < 1e-9


def test_a_group_is_judged_by_itself() -> None:
    light = np.ones((2, 1, 10, 10, 3))
    index = np.ones((1, 10, 10), np.int64)
    index[0, 0, 0] = 2
    without = light.copy()
    without[:, 0, 0, 0] = 0.5
    groups = Groups({1: "a", 2: "b", 3: "never seen"}, index)
    found = differences(Trial(light, 1, 1), Trial(without, 1, 1), groups)
    assert {one.group: one.share for one in found} == {"a": 0, "b": 0.5}


def test_window_shows_the_picture_there() -> None:
    scene = scenes.load("thin")
    described = capture.describe(scene, "thin", Path(), dataclasses.replace(QUICK, resolution=37))
    view = (scene, described.camera, cycles.DIRECT, described.lights, [3], 0)
    whole = next(pictures(*view))
    for window in ((slice(3, 20), slice(7, 9)), (slice(0, 37), slice(36, 37)), (slice(36, 37), slice(0, 1))):
        # Rays are rounded from other numbers: a few pixels at edges change.
        assert np.isclose(next(pictures(*view, window=window)), whole[window], rtol=1e-3, atol=1e-5).mean() > 0.97


# What is decided.


def test_lambert_teapot_needs_diffuse_bounces_alone() -> None:
    found = planned(scenes.load("teapot-lambert"))
    row = rows(found)["diffuse interreflection"]
    assert row.contribution_pct > 3 and row.group == "Lambert"
    assert rows(found)["cast shadows"].contribution_pct > 3
    assert rows(found)["glossy interreflection"].reason == "no glossy material"
    assert (found.transport.diffuse, found.transport.glossy, found.transport.transmission) == (True, False, False)
    assert 1 <= found.transport.bounces < plan.MOST_BOUNCES and found.transport.samples == 32


def test_metal_teapot_needs_glossy_bounces() -> None:
    found = planned(scenes.load("teapot-metal"))
    assert rows(found)["glossy interreflection"].contribution_pct > 3 and found.transport.glossy


def test_error_asked_for_decides() -> None:
    found = planned(scenes.load("teapot-lambert"), error=99.0, probe_samples=4)
    assert found.transport == cycles.DIRECT
    assert rows(found)["diffuse interreflection"].reason.startswith("less than 33 %")
    assert found.missing.contribution_pct > 3


def test_user_decides_otherwise() -> None:
    scene = scenes.load("teapot-plastic")
    found = planned(scene, simulate="glossy", leave_out=" diffuse", error=99.0)
    assert rows(found)["glossy interreflection"].reason == "asked for by --simulate"
    assert rows(found)["diffuse interreflection"].reason == "left out by --leave-out"
    assert found.transport.glossy and found.transport.bounces and not found.transport.diffuse
    with pytest.raises(LightsphereError, match="'fog' cannot be simulated"):
        CaptureSettings(simulate="fog")
    with pytest.raises(LightsphereError, match="once at most"):
        CaptureSettings(simulate="glossy", leave_out="glossy")


def test_direct_is_not_probed_and_full_takes_everything() -> None:
    scene = scenes.load("teapot-plastic")
    direct = planned(scene, effects="direct")
    assert direct.transport == cycles.DIRECT
    assert {effect.contribution_pct for effect in direct.effects} == {None}
    full = planned(scene, effects="full", error=99.0)
    assert {"diffuse interreflection", "glossy interreflection", "caustics"} <= simulated(full)
    assert full.transport.bounces >= 2


# What a capture keeps of it, and the audit.


def test_capture_writes_down_what_it_simulated(tmp_path: Path) -> None:
    words = ["capture", "teapot-lambert", *SMALL]
    for choice in ("auto", "direct"):
        assert cli.main([*words, "-o", str(tmp_path / choice), "--effects", choice]) == 0
    auto, direct = Capture.open(tmp_path / "auto"), Capture.open(tmp_path / "direct")
    assert auto.notes["transport"]["diffuse"] and auto.notes["transport"]["samples"] == 8
    taken = [e["effect"] for e in auto.notes["effects"] if e["simulated"]]
    assert taken == ["cast shadows", "near-light fall-off", "diffuse interreflection"]
    assert direct.notes["transport"]["bounces"] == 0
    mask = auto.mask()
    light = [np.mean([c.image(i)[mask].mean() for i in range(len(c))]) for c in (auto, direct)]
    assert 1.02 < light[0] / light[1] < 1.5
    assert auto.notes["audit"]["held"] and "audit" not in direct.notes


def test_audit_finds_out_a_wrong_decision(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["capture", "teapot-lambert", *SMALL, "-o", str(tmp_path / "c"), "--leave-out", "diffuse"]
    assert cli.main(words) == 0
    audit = Capture.open(tmp_path / "c").notes["audit"]
    assert not audit["held"] and audit["error_pct"] > 3 + 2 * audit["uncertainty_pct"] and audit["group"] == "Lambert"
    assert "WARNING: the audit with everything on finds" in capsys.readouterr().out


def test_audit_looks_at_surfaces_without_a_material(tmp_path: Path) -> None:
    import bpy

    without_materials()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "bare.blend"))
    words = ["capture", str(tmp_path / "bare.blend"), *SMALL, "-o", str(tmp_path / "c"), "--leave-out", "diffuse"]
    assert cli.main([*words, "--error", "0.5"]) == 0
    audit = Capture.open(tmp_path / "c").notes["audit"]
    assert not audit["held"] and audit["group"] == "no material" and audit["error_pct"] > 0.5


def test_older_captures_go_on(tmp_path: Path) -> None:
    """Settings that came later have their defaults in a capture made before."""
    words = ["capture", "steps", *SMALL, "-o", str(tmp_path), "--effects", "direct"]
    assert cli.main(words) == 0
    made = Capture.open(tmp_path)
    for name in ("error", "simulate", "leave_out"):
        del made.notes["settings"][name]
    made.save()
    assert cli.main(words) == 0
    assert cli.main([*words, "--error", "1"]) == 2


def test_command_prints_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["plan", "thin", "--probes", "1", "--probe-resolution", "16", "--probe-samples", "4"]
    assert cli.main([*words, "--json", str(tmp_path / "plan.json")]) == 0
    out = capsys.readouterr().out
    assert "caustics" in out and "%" in out
    figures = json.loads((tmp_path / "plan.json").read_text())
    assert figures["lights"] == "rig" and len(figures["effects"]) >= 13
    assert figures["seconds"]["everything"] > 0
    assert cli.main(["plan", "colour-box", *words[2:], "--json", str(tmp_path / "room.json")]) == 0
    assert json.loads((tmp_path / "room.json").read_text())["lights"] == "own"
