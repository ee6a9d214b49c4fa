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
from pipeline.blender.inverse.solve import Search
from pipeline.core import images
from pipeline.core.inverse import Model
from scenes import colour_box, rooms

TRUE = {
    "Floor": colour_box.FLOOR,
    "White": colour_box.WHITE,
    "Red": colour_box.RED,
    "Green": colour_box.GREEN,
    "Tall": colour_box.TALL,
    "Short": colour_box.SHORT,
}
SIDE = 8.0  # power of the second lamp [W]
WITHIN = 0.08  # of reflectances, from 40x30 pixels in a few seconds: dim colours are the least certain


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The box, its materials and one lamp wrong, with a hidden and a shining thing in it; and its true picture."""
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
    side = bpy.data.objects.new("Side", bpy.data.lights.new("Side", "POINT"))
    side.data.energy, side.data.shadow_soft_size, side.location = SIDE, 0.1, (-0.5, -0.6, 0.6)
    scene.collection.objects.link(side)
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
    side.data.energy = 4 * SIDE
    bpy.ops.wm.save_as_mainfile(filepath=str(made / "box.blend"))
    return made


@pytest.fixture(scope="module")
def found(box: Path) -> dict[str, Any]:
    before = (box / "box.blend").read_bytes()
    words = ["inverse", str(box / "box.blend"), str(box / "photograph.exr"), "-o", str(box / "out")]
    words += ["--json", str(box / "found.json"), "--budget", "25", "--unknown-lamps", "Side"]
    assert cli.main(words) == 0
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


def test_the_lamp_has_its_power(found: dict[str, Any], box: Path) -> None:
    (lamp,) = found["lamps"]
    assert lamp["name"] == "Side"
    assert lamp["power"] == pytest.approx(SIDE, rel=WITHIN)  # 4 times as much in the file
    assert 0 < lamp["deviation"] < WITHIN
    scenes.load(str(box / "out" / "recovered.blend"))
    assert bpy.data.lights["Side"].energy == pytest.approx(lamp["power"])


def test_error_bars_come_however_short_the_budget(box: Path, tmp_path: Path) -> None:
    words = ["inverse", str(box / "box.blend"), str(box / "photograph.exr"), "-o", str(tmp_path)]
    known = "White=" + ",".join(map(str, colour_box.WHITE))
    words += ["--json", str(tmp_path / "found.json"), "--budget", "1", "--known", f"{known};Hidden=.2,.3,.4"]
    assert cli.main(words) == 0
    groups = json.loads((tmp_path / "found.json").read_text())["groups"]
    assert groups["White"]["known"] and groups["White"]["rho_d"] == pytest.approx(colour_box.WHITE)
    assert groups["Hidden"]["known"] and groups["Hidden"]["rho_d"] == pytest.approx([0.2, 0.3, 0.4])  # though unseen
    for name in TRUE.keys() - {"White"}:
        assert min(groups[name]["deviation"]["diffuse"]) > 0


@pytest.mark.slow
def test_a_dry_run_says_how_sure_reflectances_will_be(box: Path, tmp_path: Path, found: dict[str, Any]) -> None:
    words = ["inverse", str(box / "box.blend"), str(box / "photograph.exr"), "-o", str(tmp_path / "out"), "--dry-run"]
    words += ["--json", str(tmp_path / "found.json"), "--unknown-lamps", "Side", "--target", "0.05"]
    assert cli.main(words) == 0
    assert not (tmp_path / "out").exists()
    figures = json.loads((tmp_path / "found.json").read_text())
    rows = figures["trials"]
    errors = [row["reflectance_expected_pct"] for row in rows]
    assert errors == sorted(errors, reverse=True) and errors[0] > errors[-1] > 0  # no time reaches that target soon
    assert [row["seconds"] for row in rows] == sorted(row["seconds"] for row in rows)
    kept = found["promise"]
    assert kept["error"] == "reflectance_expected_pct" and kept["settings"]["budget"] == 25
    largest = max(max(group["deviation"]["diffuse"]) for group in found["groups"].values() if "deviation" in group)
    assert kept["obtained"]["value"] == pytest.approx(100 * largest)
    assert 1 / 3 < np.interp(25, [row["budget"] for row in rows], errors) / kept["obtained"]["value"] < 3


@pytest.mark.slow
def test_the_sources_own_method_goes_by_ratios(box: Path, tmp_path: Path) -> None:
    scenes.load(str(box / "box.blend"))
    bpy.data.lights["Side"].energy = SIDE  # it takes lamps as known
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "lit.blend"))
    words = ["inverse", str(tmp_path / "lit.blend"), str(box / "photograph.exr"), "-o", str(tmp_path)]
    words += ["--json", str(tmp_path / "found.json"), "--method", "source", "--levels", "diffuse", "--budget", "20"]
    assert cli.main(words) == 0
    source = json.loads((tmp_path / "found.json").read_text())
    for name, rho in TRUE.items():
        assert source["groups"][name]["rho_d"] == pytest.approx(rho, rel=WITHIN), name
        assert not source["groups"][name]["deviation"]  # it has no account of noise


def test_an_interrupted_search_writes_what_it_knows(
    box: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(search: Search) -> Any:
        search.room.show(0, Model("diffuse", np.full(3, 0.123), np.zeros(3)))  # amid a trial
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(Search, "_levels", interrupted)
    words = ["inverse", str(box / "box.blend"), str(box / "photograph.exr"), "-o", str(tmp_path)]
    words += ["--json", str(tmp_path / "found.json"), "--unknown-lamps", "Side"]
    assert cli.main(words) == 130
    told = capsys.readouterr().err
    assert "interrupted" in told
    assert "found so far is in" in told
    groups = json.loads((tmp_path / "found.json").read_text())["groups"]
    for name, rho in TRUE.items():
        assert groups[name]["level"] == "diffuse"
        assert groups[name]["rho_d"] != pytest.approx([0.123] * 3)
        assert groups[name]["rho_d"] == pytest.approx(rho, rel=0.5)
    assert (tmp_path / "recovered.blend").is_file() and (tmp_path / "report.html").is_file()


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
    for words in ("What each group reflects", "Every group diffuse", "A mirror ball put in", "taken away", "Side"):
        assert words in page


def test_where_all_is_known_nothing_is_moved(tmp_path: Path) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    corners = [(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)]
    rooms.quad(scene, "Card", corners, rooms.surface("Card", (0.5, 0.5, 0.5)))
    rooms.lamp(scene, (0, -1, 2), (0.5, 0.5), 20.0)
    rooms.camera(scene, (0, -3, 0), (0, 0, 0), 30.0)
    scene.render.resolution_x, scene.render.resolution_y = 16, 12
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "card.blend"))
    images.write_rgb(tmp_path / "grey.exr", np.full((12, 16, 3), 0.2, np.float32))
    words = ["inverse", str(tmp_path / "card.blend"), str(tmp_path / "grey.exr"), "-o", str(tmp_path / "out")]
    assert cli.main([*words, "--json", str(tmp_path / "found.json"), "--known", "Card=.3,.4,.5"]) == 0
    card = json.loads((tmp_path / "found.json").read_text())["groups"]["Card"]
    assert card["known"] and card["rho_d"] == pytest.approx([0.3, 0.4, 0.5])


@pytest.mark.parametrize(
    "fault",
    ["aspect", "dark scene", "nothing", "exists", "no picture", "no such group", "no such lamp", "source", "limits"],
)
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
        "no such group": "there is no group 'Sky'; there are",
        "no such lamp": "there is no lamp 'Sun'; there are",
        "source": "takes all lamps as known",
        "limits": "write four numbers",
    }[fault]
    more = {
        "no such group": ["--known", "Sky=.5,.5,.5"],
        "no such lamp": ["--unknown-lamps", "Sun"],
        "source": ["--unknown-lamps", "Side", "--method", "source"],
        "limits": ["--thresholds", "5, 50", "--method", "source"],
    }.get(fault, [])
    if fault == "aspect":
        images.write_rgb(picture := tmp_path / "tall.exr", np.ones((40, 30, 3), np.float32))
    elif fault == "no picture":
        picture = tmp_path / "none.exr"
    elif fault == "exists":
        out = box / "out"
    elif not more:
        scene = scenes.load(str(box / "box.blend"))
        for item in list(scene.objects):
            shines = any(slot.material.name == "Shining" for slot in item.material_slots if slot.material)
            if (fault == "dark scene" and (item.type == "LIGHT" or shines)) or (
                fault == "nothing" and item.type == "MESH" and not shines
            ):
                bpy.data.objects.remove(item)
        bpy.ops.wm.save_as_mainfile(filepath=str(blend := tmp_path / "other.blend"))
        capsys.readouterr()
    assert cli.main(["inverse", str(blend), str(picture), "-o", str(out), *more]) == 2
    told = capsys.readouterr().err.strip()
    assert said in told
    assert len(told.splitlines()) == 1
