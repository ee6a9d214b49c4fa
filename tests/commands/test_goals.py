"""`--budget` and `--target` as a user gives them, on a small drawn capture."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import cli
from pipeline.core.capture import Capture
from pipeline.core.reflectance import Reflectance
from pipeline.core.shape import Shape
from tests import synthetic


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of a glossy ball, and its shape."""
    made = tmp_path_factory.mktemp("goals")
    shape = synthetic.ball(synthetic.camera(24))
    (made / "capture").mkdir()
    synthetic.write_capture(made / "capture", shape, np.array([0.6, 0.4, 0.2]), np.full(3, 0.1), 0.5)
    dataclasses.replace(shape, notes={"capture": "../capture"}).save(made / "shape")
    return made


def run(tmp_path: Path, *words: str) -> dict[str, Any]:
    assert cli.main([*words, "-o", str(tmp_path / "out"), "--json", str(tmp_path / "figures.json")]) == 0
    figures: dict[str, Any] = json.loads((tmp_path / "figures.json").read_text())
    kept = figures["promise"]
    for part in ("promised", "obtained"):
        assert set(kept[part]) == {"seconds", "value"}
        assert kept[part]["seconds"] > 0
    assert kept["obtained"]["seconds"] >= figures["solve_seconds"] if "solve_seconds" in figures else True
    return figures


def test_shape_within_a_budget(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures = run(tmp_path, "shape", str(folder / "capture"), "--budget", "600")
    kept = figures["promise"]
    assert (kept["budget"], kept["target"], kept["lacks"]) == (600, None, "")
    assert kept["error"] == "depth_expected_pct"
    found = Shape.open(tmp_path / "out")
    assert found.notes["settings"]["pictures"] == kept["settings"]["pictures"]
    assert "depth_expected_pct promised" in capsys.readouterr().out


def test_reflectance_for_a_target(folder: Path, tmp_path: Path) -> None:
    kept = run(tmp_path, "reflectance", str(folder / "shape"), "--target", "20")["promise"]
    assert kept["settings"] == {"model": "ggx", "clusters": 1}
    assert kept["obtained"]["value"] < 20
    assert Reflectance.open(tmp_path / "out").notes["material_rel_rms"] * 100 == pytest.approx(
        kept["obtained"]["value"]
    )


def test_relight_says_what_it_cannot_reach(folder: Path, tmp_path: Path) -> None:
    """Twelve pictures are held out, and the best settings use all the others."""
    words = ("relight", str(folder / "shape"), "--point", "2 -1 2", "--target", "1e-6")
    kept = run(tmp_path, *words)["promise"]
    assert kept["lacks"] == "no settings are expected to reach 1e-06 %: these are the best"
    assert kept["settings"]["interpolation"] == "model"
    assert kept["settings"]["pictures"] <= len(Capture.open(folder / "capture")) - 12
    assert 0 < kept["obtained"]["value"] < 100
    assert (tmp_path / "out" / "relit.exr").is_file()


def test_a_budget_that_is_too_short_is_said_and_work_done(folder: Path, tmp_path: Path) -> None:
    kept = run(tmp_path, "shape", str(folder / "capture"), "--budget", "0.001")["promise"]
    assert kept["lacks"] == "no settings are expected to end within 0.001 s: these are the quickest"
    assert (tmp_path / "out" / "mesh.ply").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["shape", "{}/capture", "--budget", "0"], "budget is 0; it must be more than 0"),
        (["relight", "{}/shape", "--point", "2 -1 2", "--target=-3"], "target is -3; it must be more than 0"),
        (["shape", "{}/capture", "--mesh", "a.ply", "--target", "1"], "leave --budget, --target and --dry-run out"),
        (["shape", "{}/capture", "--method", "uncalibrated", "--target", "1"], "do not serve the method uncalibrated"),
    ],
)
def test_goals_that_are_none_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert cli.main([*(word.format(folder) for word in words), "-o", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("words", [["shape", "{}/capture"], ["relight", "{}/shape", "--point", "2 -1 2"]])
def test_a_dry_run_says_what_settings_cost_and_leaves_nothing(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    given = [word.format(folder) for word in words]
    figures = tmp_path / "figures.json"
    assert cli.main([*given, "-o", str(tmp_path / "out"), "--dry-run", "--json", str(figures)]) == 0
    assert not (tmp_path / "out").exists()
    trials = json.loads(figures.read_text())["trials"]
    named = json.loads(figures.read_text())["presets"]
    assert list(named) == ["draft", "standard", "final"]
    assert all(one["label"] in {row["label"] for row in trials} for one in named.values())
    assert len({row["pictures"] for row in trials}) >= 3
    assert all(row["seconds"] > 0 for row in trials)
    told = capsys.readouterr().out
    assert "nothing chosen: give --budget or --target" in told
    assert all(row["label"] in told for row in trials)


def test_a_dry_run_for_a_goal_names_what_it_would_choose(folder: Path, tmp_path: Path) -> None:
    figures = tmp_path / "figures.json"
    words = ["reflectance", str(folder / "shape"), "-o", str(tmp_path / "out"), "--dry-run", "--target", "20"]
    assert cli.main([*words, "--json", str(figures)]) == 0
    assert json.loads(figures.read_text())["chosen"] == "lobe, 1 roughness"


def test_fewer_pictures_may_be_asked_for(folder: Path, tmp_path: Path) -> None:
    words = ["shape", str(folder / "capture"), "-o", str(tmp_path / "out"), "--pictures", "60"]
    assert cli.main(words) == 0
    assert Shape.open(tmp_path / "out").notes["settings"]["pictures"] == 60
