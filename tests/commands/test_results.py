"""The commands that make or judge results, as a user runs them, on a small drawn capture."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from pipeline import cli
from pipeline.commands.tradeoff import chosen_stage
from pipeline.core import images
from pipeline.core.progress import Progress, Work
from pipeline.core.reflectance import Reflectance
from pipeline.core.tradeoff import Variant
from tests import synthetic


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of a glossy ball with truth, and the shape of it, 8 mm off."""
    made = tmp_path_factory.mktemp("results")
    shape = synthetic.ball(synthetic.camera(24))
    (made / "capture").mkdir()
    capture = synthetic.write_capture(made / "capture", shape, np.array([0.6, 0.4, 0.2]), np.full(3, 0.2), 0.4)
    truth = {"depth.V": shape.depth, "material.V": np.isfinite(shape.depth).astype(np.float32)}
    for i, axis in enumerate("XYZ"):
        truth[f"normal.{axis}"] = shape.normal[..., i]
        truth[f"position.{axis}"] = shape.points()[..., i].astype(np.float32)
    images.write_channels(made / "capture" / "truth.exr", truth)
    dataclasses.replace(capture, notes={"diameter": 1.6}).save()
    off = dataclasses.replace(shape, depth=shape.depth + np.float32(0.008), notes={"capture": "../capture"})
    off.save(made / "shape")
    return made


def test_compare_states_a_shape_s_errors_and_draws_them(folder: Path, tmp_path: Path) -> None:
    picture, figures = tmp_path / "error.png", tmp_path / "figures.json"
    words = ["compare", str(folder / "shape"), str(folder / "capture"), "-o", str(picture), "--json", str(figures)]
    assert cli.main(words) == 0
    assert json.loads(figures.read_text())["depth_median_pct"] == pytest.approx(0.5, rel=1e-3)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_compare_states_how_far_pictures_are_apart(tmp_path: Path) -> None:
    reference = np.random.default_rng(0).uniform(0.1, 1, (6, 8, 3)).astype(np.float32)
    images.write_rgb(tmp_path / "a.exr", reference * np.float32(1.05))
    images.write_rgb(tmp_path / "b.exr", reference)
    figures = tmp_path / "figures.json"
    assert cli.main(["compare", str(tmp_path / "a.exr"), str(tmp_path / "b.exr"), "--json", str(figures)]) == 0
    assert json.loads(figures.read_text())["relight_rel_rmse"] == pytest.approx(0.05, rel=1e-4)
    assert (tmp_path / "a-error.png").is_file()


def test_reflectance_and_material_follow_the_shape_to_its_capture(folder: Path, tmp_path: Path) -> None:
    assert cli.main(["reflectance", str(folder / "shape"), "-o", str(tmp_path / "r"), "--model", "ggx"]) == 0
    assert Reflectance.open(tmp_path / "r").notes["material_rel_rms"] < 0.2
    blend, figures = tmp_path / "asset.blend", tmp_path / "figures.json"
    words = ["material", str(folder / "shape"), "-o", str(blend), "--json", str(figures)]
    assert cli.main(words) == 0
    assert json.loads(figures.read_text())["triangles"] > 100
    before = blend.read_bytes()
    assert cli.main(words) == 2
    assert blend.read_bytes() == before
    assert cli.main([*words, "--overwrite"]) == 0


def test_what_follows_on_the_source_is_tried_and_written_as_table_and_plot(folder: Path, tmp_path: Path) -> None:
    assert chosen_stage(str(folder / "shape"), "auto", None) == "reflectance"
    assert chosen_stage(str(folder / "capture"), "auto", None) == "shape"
    assert chosen_stage("gold.binary", "auto", None) == "material"
    assert chosen_stage("gourd", "auto", None) == "capture"
    assert chosen_stage("colour-box", "auto", Path("photograph.exr")) == "inverse"
    figures = tmp_path / "figures.json"
    words = ["tradeoff", str(folder / "shape"), "--stage", "relight", "-o", str(tmp_path), "--json", str(figures)]
    assert cli.main(words) == 0
    rows = json.loads(figures.read_text())["trials"]
    with (tmp_path / "tradeoff.csv").open(newline="") as file:
        assert [row["label"] for row in csv.DictReader(file)] == [row["label"] for row in rows]
    assert (tmp_path / "tradeoff.png").read_bytes().startswith(b"\x89PNG")
    by_model = {row["pictures"]: row["relight_rel_rmse"] for row in rows if row["interpolation"] == "model"}
    assert by_model[max(by_model)] < by_model[min(by_model)]  # lights make it better


def test_an_interrupted_tradeoff_keeps_what_was_done_and_nothing_is_replaced_unasked(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def quick() -> Work[float]:
        yield Progress("anything", 1, 1)
        return 0.25

    def interrupted() -> Work[float]:
        yield Progress("anything", 1, 2)
        raise KeyboardInterrupt

    works = {"quick": quick, "long": interrupted}
    made = [
        Variant(label, {"pictures": 1}, 1.0, work, lambda error: {"relight_rel_rmse": error})
        for label, work in works.items()
    ]
    monkeypatch.setattr("pipeline.core.tradeoff.relight.variants", lambda *_: made)
    words = ["tradeoff", str(folder / "shape"), "--stage", "relight", "-o", str(tmp_path)]
    assert cli.main(words) == 130
    with (tmp_path / "tradeoff.csv").open(newline="") as file:
        assert [row["label"] for row in csv.DictReader(file)] == ["quick"]
    assert (tmp_path / "tradeoff.png").is_file()
    assert cli.main(words) == 2
    assert "replace it with --overwrite" in capsys.readouterr().err
    assert cli.main([*words, "--overwrite"]) == 130


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["compare", "shape", "nowhere"], "cannot be compared"),
        (["material", "shape", "-o", "asset.gltf"], "no .blend file"),
        (["material", "capture", "-o", "asset.blend"], "is no shape"),
        (["reflectance", "shape", "-o", "r", "--held-out", "1"], "held_out is 1"),
        (["tradeoff", "shape", "--stage", "shape", "-o", "t"], "is not a capture"),
        (["tradeoff", "shape", "--stage", "film", "-o", "t"], "stage is 'film'; choose one of auto, capture"),
        (["tradeoff", "shape", "--stage", "inverse", "-o", "t"], "inverse needs one; give --photograph"),
        (["tradeoff", "shape", "--photograph", "a.exr", "--stage", "shape", "-o", "t"], "belongs to inverse"),
        (["tradeoff", ".", "-o", "t"], "is no capture, shape or reflectance"),
        (["tradeoff", "nothing", "-o", "t"], "there is no scene 'nothing'"),
    ],
)
def test_wrong_input_is_one_line_and_status_two(
    folder: Path, words: list[str], message: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert cli.main(words) == 2
    error = capfd.readouterr().err
    assert message in error and error.count("\n") == 1
