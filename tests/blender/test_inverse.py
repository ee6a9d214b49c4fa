"""Inverse on a small colour box: planted reflectances come back, other things are kept or refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from pipeline import cli
from pipeline.blender import cycles, exr
from pipeline.blender import scene as scenes
from pipeline.core import images
from scenes import colour_box

TRUE = {
    "Floor": colour_box.FLOOR,
    "White": colour_box.WHITE,
    "Red": colour_box.RED,
    "Green": colour_box.GREEN,
    "Tall": colour_box.TALL,
    "Short": colour_box.SHORT,
}
WITHIN = 0.08  # of reflectances, from 40x30 pixels in a few seconds: dim colours are the least certain


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The box as a .blend whose materials say nothing, and its picture; with a hidden and a shining thing in it."""
    made = tmp_path_factory.mktemp("box")
    scene = scenes.load("colour-box")
    scene.render.resolution_x, scene.render.resolution_y = 40, 30
    bpy.ops.mesh.primitive_cube_add(size=0.2, location=(0, 8, 0))  # behind the back wall
    bpy.context.object.data.materials.append(bpy.data.materials.new("Hidden"))
    bpy.ops.mesh.primitive_cube_add(size=0.05, location=(0.8, -1.0, 1.9))
    shining = bpy.data.materials.new("Shining")
    if bpy.app.version < (5, 0):
        shining.use_nodes = True
    shining.node_tree.nodes.new("ShaderNodeEmission")
    bpy.context.object.data.materials.append(shining)
    scene.cycles.samples, scene.cycles.seed, scene.cycles.use_adaptive_sampling = 1024, 99, False
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 24
    scene.render.use_file_extension = False
    with cycles.openexr(scene):
        cycles.render(scene, made / "photograph.exr")
    for material in bpy.data.materials:
        for node in material.node_tree.nodes if material.node_tree else ():
            if node.type == "BSDF_DIFFUSE":
                node.inputs["Color"].default_value = (0.9, 0.1, 0.9, 1)
    bpy.ops.wm.save_as_mainfile(filepath=str(made / "box.blend"))
    return made


@pytest.fixture(scope="module")
def found(box: Path) -> dict[str, Any]:
    before = (box / "box.blend").read_bytes()
    words = ["inverse", str(box / "box.blend"), str(box / "photograph.exr"), "-o", str(box / "out")]
    assert cli.main([*words, "--json", str(box / "found.json"), "--budget", "25"]) == 0
    assert (box / "box.blend").read_bytes() == before
    figures: dict[str, Any] = json.loads((box / "found.json").read_text())
    return figures


def test_every_wall_has_its_reflectance(found: dict[str, Any]) -> None:
    for name, rho in TRUE.items():
        group = found["groups"][name]
        assert group["level"] == "diffuse"
        assert group["rho_d"] == pytest.approx(rho, rel=WITHIN), name
        assert group["pixels"] > 10 and group["seen"] == "directly"
        assert max(group["deviation"]["diffuse"]) < WITHIN
    assert found["groups"]["Red"]["rho_d"] != pytest.approx(colour_box.GREEN, rel=0.5)
    assert found["renders"] > 10
    assert found["history"][-1]["error"] < 0.5 * found["history"][0]["error"]


def test_what_the_picture_does_not_tell_is_kept_and_said(found: dict[str, Any], box: Path) -> None:
    assert found["groups"]["Hidden"] == {
        "level": "kept", "seen": "not at all", "why": "the picture tells nothing of it"
    }  # fmt: skip
    assert found["groups"]["Shining"] == {"level": "kept", "why": "it shines"}
    scenes.load(str(box / "out" / "recovered.blend"))
    used = {slot.material.name for item in bpy.context.scene.objects for slot in item.material_slots}
    assert {"Hidden", "Shining"} <= used


def test_the_recovered_file_renders_the_photograph(found: dict[str, Any], box: Path, tmp_path: Path) -> None:
    scene = scenes.load(str(box / "out" / "recovered.blend"))
    scene.cycles.samples, scene.cycles.seed = 256, 5
    with cycles.openexr(scene):
        cycles.render(scene, tmp_path / "again.exr")
    channels = exr.read(tmp_path / "again.exr")
    again = np.stack([channels[letter] for letter in "RGB"], axis=-1)
    photograph = images.read_rgb(box / "photograph.exr")
    assert np.abs(again - photograph).mean() < 0.08 * photograph.mean()
    assert found["rerendered_rel_rmse"] < 0.08
    page = (box / "out" / "report.html").read_text()
    assert "What each group reflects" in page and "Tall" in page


@pytest.mark.parametrize("fault", ["aspect", "dark scene", "nothing", "exists", "no picture"])
def test_bad_input_is_told_on_one_line(
    box: Path, found: dict[str, Any], fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    blend, picture, out = box / "box.blend", box / "photograph.exr", tmp_path / "out"
    said = {
        "aspect": "aspect",
        "dark scene": "no light",
        "nothing": "no surface that only reflects",
        "exists": "--overwrite",
        "no picture": "missing",
    }[fault]
    if fault == "aspect":
        images.write_rgb(picture := tmp_path / "tall.exr", np.ones((40, 30, 3), np.float32))
    elif fault == "no picture":
        picture = tmp_path / "none.exr"
    elif fault == "exists":
        out = box / "out"
    else:
        scene = scenes.load(str(box / "box.blend"))
        for item in list(scene.objects):
            shines = any(slot.material.name == "Shining" for slot in item.material_slots if slot.material)
            if (fault == "dark scene" and (item.type == "LIGHT" or shines)) or (
                fault == "nothing" and item.type == "MESH" and not shines
            ):
                bpy.data.objects.remove(item)
        bpy.ops.wm.save_as_mainfile(filepath=str(blend := tmp_path / "other.blend"))
        capsys.readouterr()
    assert cli.main(["inverse", str(blend), str(picture), "-o", str(out)]) == 2
    told = capsys.readouterr().err.strip()
    assert said in told
    assert len(told.splitlines()) == 1
