"""An asset rendered beside its capture and the true scene: the true object has no error, a wrong one has its own."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import numpy as np
import pytest

from pipeline import cli
from pipeline.blender.asset import mark
from tests import tolerances
from tests.blender import small_scenes

ALBEDO = 0.5
SMALL = ["--lights=4", "--samples=16", "--bounces=2"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A captured scene of a ball on the ground, beside its capture."""
    made = tmp_path_factory.mktemp("compare")
    scene = small_scenes.lambert(ALBEDO)
    small_scenes.ground(scene, -1.0)
    bpy.ops.wm.save_as_mainfile(filepath=str(made / "ball.blend"))
    words = ["capture", str(made / "ball.blend"), "-o", str(made / "capture"), "--effects=direct", "--workers=1"]
    assert cli.main([*words, "--inner=40", "--outer=20", "--resolution=24"]) == 0
    return made


def asset(path: Path, albedo: float, radius: float = 1.0) -> Path:
    """Write a ball as an asset, with what must not be taken for it: a camera, a light and another mesh."""
    scene = small_scenes.lambert(albedo)
    item = next(item for item in scene.objects if item.type == "MESH")
    item.scale = 3 * (radius,)
    mark(scene, item)
    bpy.ops.mesh.primitive_cube_add(location=(0, -3, 0))
    bpy.ops.object.light_add(type="SUN")
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def compared(path: Path, folder: Path, *words: str) -> dict[str, dict[str, float]]:
    figures = path.with_suffix(".json")
    command = ["compare", str(path), str(folder / "capture"), "--json", str(figures), "--overwrite", *SMALL, *words]
    assert cli.main(command) == 0
    found: dict[str, dict[str, float]] = json.loads(figures.read_text())["comparisons"]
    return found


def test_the_true_object_has_no_error_but_noise(folder: Path, tmp_path: Path) -> None:
    found = compared(asset(tmp_path / "true.blend", ALBEDO), folder)
    assert list(found) == ["captured", "new_lights", "global_illumination", "new_view"]
    for name, one in found.items():
        noisy = name == "global_illumination"
        assert one["lights"] > 0
        assert (one["noise"] > 0) == noisy
        assert one["relight_rel_rmse"] < (1.5 * one["noise"] if noisy else tolerances.RADIANCE_LAMBERT)
        if noisy:
            assert one["relight_rel_rmse"] > 0.5 * one["noise"]  # seeds of its own on either side
        else:
            assert (one["flip"], one["ssim"]) == pytest.approx((0, 1), abs=1e-4)


def test_a_wrong_albedo_and_a_wrong_size_are_found(folder: Path, tmp_path: Path) -> None:
    brighter = compared(asset(tmp_path / "brighter.blend", 1.05 * ALBEDO), folder, "--bounces=0")
    for one in brighter.values():
        assert one["relight_rel_rmse"] == pytest.approx(0.05, rel=1e-3)
        assert one["flip"] > 0.01
    smaller = compared(asset(tmp_path / "smaller.blend", ALBEDO, 0.9), folder, "--bounces=0")
    for name, one in smaller.items():
        assert one["relight_rel_rmse"] > 0.1
        assert one["ssim"] < 0.99
        assert (tmp_path / "smaller-comparison" / f"{name}_error.png").read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "smaller-comparison" / "comparison.html").read_text()
    assert "seen 20 degrees from the side" in page


def test_without_the_scene_the_capture_alone_is_compared(folder: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "capture").symlink_to(folder / "capture")
    path = asset(tmp_path / "asset.blend", ALBEDO)
    assert list(compared(path, elsewhere)) == ["captured"]
    assert "the asset stands alone" in (tmp_path / "asset-comparison" / "comparison.html").read_text()
    assert len(compared(path, elsewhere, "--scene", str(folder / "ball.blend"))) == 4


def test_what_cannot_be_compared_is_refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, capture = asset(tmp_path / "asset.blend", ALBEDO), str(folder / "capture")
    small_scenes.empty()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "empty.blend"))
    (tmp_path / "text.blend").write_text("no blend")
    (tmp_path / "asset-comparison").mkdir()
    (tmp_path / "asset-comparison" / "comparison.html").write_text("mine")
    for words, said in (
        ([str(tmp_path / "empty.blend"), capture], "shows no mesh"),
        ([str(tmp_path / "text.blend"), capture], "cannot be opened"),
        ([str(tmp_path / "gone.blend"), capture], "gone.blend"),
        ([str(path), capture], "--overwrite"),
        ([str(path), capture, "--overwrite", "--scene", str(path)], "is not the file"),
        ([str(path), str(tmp_path)], "cannot be compared"),
    ):
        assert cli.main(["compare", *words, *SMALL]) == 2
        told = capsys.readouterr().err.strip()
        assert said in told
        assert len(told.splitlines()) == 1
    assert (tmp_path / "asset-comparison" / "comparison.html").read_text() == "mine"


def test_an_asset_that_the_artist_moved_is_compared_where_it_was(folder: Path, tmp_path: Path) -> None:
    path = asset(tmp_path / "moved.blend", ALBEDO)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    bpy.data.objects["Icosphere"].location = (3, 1, 2)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    found = compared(path, folder, "--bounces=0")
    assert max(one["relight_rel_rmse"] for one in found.values()) < tolerances.RADIANCE_LAMBERT


def test_the_artist_s_own_edit_counts(folder: Path, tmp_path: Path) -> None:
    path = asset(tmp_path / "edited.blend", ALBEDO)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    closure = next(n for n in bpy.data.materials["Ball"].node_tree.nodes if n.type == "BSDF_DIFFUSE")
    closure.inputs["Color"].default_value = (ALBEDO / 2, ALBEDO, ALBEDO, 1)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    found = compared(path, folder, "--bounces=0")
    np.testing.assert_allclose([one["relight_rel_rmse"] for one in found.values()], 0.5 / np.sqrt(3), rtol=1e-3)
