"""How many closures a material takes for a time or an error: promised, made, and stated."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import cli
from pipeline.blender.material_goal import paced
from pipeline.core.brdf.files import write_npz
from pipeline.core.brdf.parametric import Ward
from pipeline.core.progress import Progress, Work
from pipeline.core.shape import Shape
from tests import synthetic


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A lobe that one closure hardly fits."""
    path = tmp_path_factory.mktemp("table") / "ward.npz"
    write_npz(path, Ward(np.array([0.3, 0.2, 0.1]), np.full(3, 0.3), 0.25, 0.25))
    return path


def run(table: Path, folder: Path, *words: str) -> dict[str, Any]:
    figures = folder / "figures.json"
    assert cli.main(["material", str(table), "-o", str(folder / "a.blend"), *words, "--json", str(figures)]) == 0
    found: dict[str, Any] = json.loads(figures.read_text())
    return found


def test_a_dry_run_shows_what_closures_buy_and_leaves_nothing(table: Path, tmp_path: Path) -> None:
    rows = run(table, tmp_path, "--dry-run")["trials"]
    assert [path.name for path in tmp_path.iterdir()] == ["figures.json"]
    errors = [row["material_rel_rms"] for row in rows]
    assert len(rows) >= 2 and errors[0] > errors[-1]
    assert all(row["seconds"] > 0 for row in rows)


@pytest.mark.slow
def test_the_fewest_that_reach_a_target_are_taken(table: Path, tmp_path: Path) -> None:
    rows = run(table, tmp_path, "--dry-run")["trials"]
    target = 100 * (rows[0]["material_rel_rms"] + rows[1]["material_rel_rms"]) / 2
    figures = run(table, tmp_path, "--target", str(target))
    kept = figures["promise"]
    assert kept["settings"] == {"lobes": rows[1]["lobes"]} and not kept["lacks"]
    assert kept["obtained"]["value"] == pytest.approx(kept["promised"]["value"]) and kept["obtained"]["value"] < target
    assert figures["condition"]["curves of a basis"]["median"] >= 1
    assert (tmp_path / "a.blend").is_file()


def test_a_lobe_per_pixel_has_nothing_to_choose(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shape = synthetic.ball(synthetic.camera(16))
    (tmp_path / "capture").mkdir()
    synthetic.write_capture(tmp_path / "capture", shape, np.array([0.6, 0.4, 0.2]), np.full(3, 0.2), 0.4)
    Shape(shape.camera, shape.depth, shape.normal, shape.confidence, {}, {"capture": "../capture"}).save(tmp_path / "s")
    assert cli.main(["reflectance", str(tmp_path / "s"), "-o", str(tmp_path / "r"), "--model", "ggx"]) == 0
    assert cli.main(["material", str(tmp_path / "r"), "-o", str(tmp_path / "a.blend"), "--budget", "9"]) == 2
    assert "there is nothing to choose" in capsys.readouterr().err
    assert not (tmp_path / "a.blend").exists()


def test_the_first_steps_tell_how_long_all_take(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that goes one second a picture, after three for the first."""
    now = [0.0]
    monkeypatch.setattr("pipeline.blender.material_goal.time.perf_counter", lambda: now[0])
    closed = []

    def pictures() -> Work[None]:
        try:
            for number in range(40):
                now[0] += 3.0 if not number else 1.0
                yield Progress("pictures", number + 1, 40)
        finally:
            closed.append(now[0])

    assert paced(pictures()) == pytest.approx(3 + 39)
    assert closed == [9.0]
