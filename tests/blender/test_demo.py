"""The demo at its smallest: everything it promises is there, and a second run does nothing twice."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from pipeline.commands.demo import DemoSettings
from pipeline.commands.demo_stages import Demo
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import Progress

SETTINGS = DemoSettings(scene="teapot-lambert", resolution=32, inner=48, outer=24)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("demo")


@pytest.fixture(scope="module")
def steps(folder: Path) -> list[Progress]:
    return list(Demo(folder, SETTINGS).work())


def test_everything_promised_is_there(folder: Path, steps: list[Progress]) -> None:
    metrics = json.loads((folder / "metrics.json").read_text())
    assert metrics["recovered_pct"] > 50
    assert metrics["depth_median_pct"] < 0.1
    assert metrics["material_rel_rms"] < 0.2
    assert metrics["relight_rel_rmse"] < 0.6  # coarse: at 32 px a fifth of the pixels are border
    assert [row["label"] for row in metrics["tradeoff"]][-1] == "48/24"
    assert metrics["effects"][0]["effect"] == "cast shadows"
    for name in ("asset.blend", "report.html", "teaser.png", "shape/mesh.ply"):
        assert (folder / name).stat().st_size > 1000
    page = (folder / "report.html").read_text()
    assert 'src="http' not in page and page.count("data:image/png") > 20


def test_the_bar_never_goes_back_and_ends_at_the_end(steps: list[Progress]) -> None:
    done = [step.done for step in steps]
    assert done == sorted(done)
    assert done[-1] == pytest.approx(100)
    assert all(step.total == 100 for step in steps)
    assert max(b - a for a, b in pairwise(done)) < 15  # no stage is one jump


def test_a_second_run_does_nothing(folder: Path, steps: list[Progress]) -> None:
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    assert list(Demo(folder, SETTINGS).work()) == []
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_a_lost_file_is_made_again_without_what_came_before(folder: Path, steps: list[Progress]) -> None:
    (folder / "report.html").unlink()
    assert {step.stage for step in run(folder)} == {"report"}
    assert (folder / "report.html").is_file()


def test_an_asset_that_the_artist_changed_is_not_replaced(folder: Path, steps: list[Progress]) -> None:
    asset, record = folder / "asset.blend", folder / "demo.json"
    before, recorded = asset.read_bytes(), record.read_text()
    changed = json.loads(recorded)
    del changed["seconds"]["material"]
    record.write_text(json.dumps(changed))
    asset.write_bytes(before + b"more")
    with pytest.raises(LightsphereError, match="was changed"):
        list(run(folder))
    assert asset.read_bytes() == before + b"more"
    asset.write_bytes(before)
    record.write_text(recorded)


def test_other_settings_need_another_folder(folder: Path, steps: list[Progress]) -> None:
    with pytest.raises(LightsphereError, match="other settings"):
        Demo(folder, DemoSettings(scene="teapot-metal", resolution=32, inner=48, outer=24))


def run(folder: Path) -> Iterator[Progress]:
    yield from Demo(folder, SETTINGS).work()
