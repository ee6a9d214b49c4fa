"""`lightsphere relight` as a user runs it, on a small drawn capture."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import bpy
import numpy as np
import pytest

from pipeline import cli
from pipeline.commands.relight import middle
from pipeline.core import images
from pipeline.core.compare.pictures import relative_rmse
from pipeline.core.lights import Lights
from tests import oracles, synthetic
from tests.drawn import draw, ggx


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of a ball with true depth, its shape, a shape of another camera, maps, and a scene without lights."""
    made = tmp_path_factory.mktemp("relight")
    shape = synthetic.ball(synthetic.camera(16))
    (made / "capture").mkdir()
    capture = synthetic.write_capture(made / "capture", shape, np.array([0.6, 0.4, 0.2]), np.full(3, 0.2), 0.4)
    truth = {"depth.V": shape.depth} | {f"normal.{axis}": shape.normal[..., i] for i, axis in enumerate("XYZ")}
    images.write_channels(made / "capture" / "truth.exr", truth)
    dataclasses.replace(capture, notes={"diameter": 1.6}).save()
    dataclasses.replace(shape, notes={"capture": "../capture"}).save(made / "shape")
    dataclasses.replace(synthetic.ball(synthetic.camera(18)), notes={"capture": "../capture"}).save(made / "other")
    for name, value in (("sky", 1.0), ("nan", np.nan), ("negative", -1.0)):
        radiance = np.ones((8, 16, 3), np.float32)
        radiance[2, 3] = value
        images.write_rgb(made / f"{name}.exr", radiance)
    (made / "lights.txt").write_text("2 -1 2 10\n0 3 2 10\n")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(made / "dark.blend"))
    data = bpy.data.lights.new("Lamp", "POINT")
    data.energy, data.shadow_soft_size = 40 * np.pi, 0.0
    lamp = bpy.data.objects.new("Lamp", data)
    lamp.location = (2, -1, 2)
    bpy.context.scene.collection.objects.link(lamp)
    bpy.ops.wm.save_as_mainfile(filepath=str(made / "lit.blend"))
    return made


def relit(folder: Path, output: Path, *words: str) -> np.ndarray:
    assert cli.main(["relight", str(folder / "shape"), "-o", str(output), *words]) == 0
    assert (output / "relit.png").read_bytes().startswith(b"\x89PNG")
    return images.read_rgb(output / "relit.exr")


def test_a_point_a_list_and_a_scene_agree(folder: Path, tmp_path: Path) -> None:
    by_point = relit(folder, tmp_path / "a", "--point", "2 -1 2 10", "--lights", str(folder / "lights.txt"))
    by_scene = relit(folder, tmp_path / "b", "--scene", str(folder / "lit.blend"))
    assert by_point.max() > 0
    assert relative_rmse(by_scene, by_point) < 1e-5
    assert np.array_equal(images.read_rgb(tmp_path / "a" / "relit_0000.exr"), by_point)
    assert (tmp_path / "a" / "relit_0001.png").is_file()


def test_lights_shine_together(folder: Path, tmp_path: Path) -> None:
    point = relit(folder, tmp_path / "a", "--point", "2 -1 2 10")
    sky = relit(folder, tmp_path / "b", "--environment", str(folder / "sky.exr"), "--distant", "0 0 1 0.5")
    words = ("--point", "2 -1 2 10", "--environment", str(folder / "sky.exr"), "--distant", "0 0 1 0.5")
    assert relative_rmse(relit(folder, tmp_path / "c", *words), point + sky) < 1e-6


def test_true_depth_stands_in_for_a_shape(folder: Path, tmp_path: Path) -> None:
    words = ["relight", str(folder / "capture"), "-o", str(tmp_path / "t"), "--true-depth", "--point", "2 -1 2 10"]
    assert cli.main(words) == 0
    recovered = relit(folder, tmp_path / "a", "--point", "2 -1 2 10")
    assert relative_rmse(images.read_rgb(tmp_path / "t" / "relit.exr"), recovered) < 1e-6


def test_a_small_file_and_a_map_for_viewers_are_written(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["relight", str(folder / "shape"), "-o", str(tmp_path / "f"), "--compact", "2", "--ptm"]
    assert cli.main([*words, "--json", str(tmp_path / "f.json")]) == 0
    told = json.loads((tmp_path / "f.json").read_text())
    small = tmp_path / "f" / "relightable.npz"
    assert told["compact"]["bytes"] == small.stat().st_size
    assert (tmp_path / "f" / "relit.ptm").read_bytes().startswith(b"PTM_1.2\nPTM_FORMAT_RGB\n16\n16\n")
    assert told["ptm_rms"] < 20
    assert cli.main(["relight", str(small), "-o", str(tmp_path / "s"), "--point", "2 -1 2 10"]) == 0
    by_file = images.read_rgb(tmp_path / "s" / "relit.exr")
    assert relative_rmse(by_file, relit(folder, tmp_path / "a", "--point", "2 -1 2 10")) < 0.05
    capsys.readouterr()
    assert cli.main(["relight", str(small), "-o", str(tmp_path / "t"), "--true-depth", "--point", "2 -1 2"]) == 2
    assert "keeps no true depth" in capsys.readouterr().err


def test_a_film_is_encoded(folder: Path, tmp_path: Path) -> None:
    figures = tmp_path / "figures.json"
    words = ["relight", str(folder / "shape"), "-o", str(tmp_path), "--film", "--json", str(figures)]
    assert cli.main(words) == 0
    count = json.loads(figures.read_text())["pictures"]
    clip = bpy.data.movieclips.load(str(tmp_path / "film.mp4"))
    assert clip.frame_duration == count == len(list(tmp_path.glob("film_*.exr")))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["shape"], "no light is given"),
        (["shape", "--point", "0 0 0.4"], "inside the object"),
        (["shape", "--point", "0 0 0"], "inside the object"),
        (["shape", "--point", "1 2"], "is no light"),
        (["shape", "--distant", "0 0 0"], "is no direction"),
        (["shape", "--point", "1 2 3 -1"], "no positive strength"),
        (["shape", "--environment", "nan.exr"], "not numbers"),
        (["shape", "--environment", "negative.exr"], "negative light"),
        (["shape", "--environment", "nowhere.exr"], "is missing"),
        (["shape", "--scene", "dark.blend"], "no light that renders"),
        (["other", "--point", "2 0 2"], "depth map is not of"),
        (["capture", "--point", "2 0 2"], "is not a shape"),
    ],
)
def test_wrong_input_is_one_line_and_status_two(
    folder: Path, words: list[str], message: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert cli.main(["relight", words[0], "-o", "out", *words[1:]]) == 2
    error = capfd.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not (folder / "out").exists()


def test_lights_are_about_the_object_where_the_captures_are_at_infinity() -> None:
    """Unit directions are no places: a light of no stated strength is as strong as the object's distance asks for."""
    shape = synthetic.ball(synthetic.camera(16))
    directions = oracles.unit(np.array([[0.3, 0.1, 1.0], [-0.2, 0.4, 1.0], [0.1, -0.5, 1.0]]))
    far = draw(shape, Lights("distant", directions, np.ones((3, 3)), np.full(3, 2)), ggx)
    close = draw(shape, Lights("near", 2 * directions, np.ones((3, 3)), np.full(3, 2)), ggx)
    np.testing.assert_allclose(middle(far, shape), shape.points()[np.isfinite(shape.depth)].mean(axis=0))
    np.testing.assert_allclose(middle(close, shape), 2 * directions.mean(axis=0))
