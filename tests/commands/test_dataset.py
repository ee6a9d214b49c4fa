"""`lightsphere dataset` and `verify` as a user gives them, with real processes and planted faults."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from pipeline import cli
from pipeline.core.dataset import folder as dataset
from pipeline.core.dataset.recipe import Recipe

RECIPE = """
name = "Small"
licence = "CC0-1.0"
seed = 11
count = 3
[camera]
resolution = 24
[lights]
count = 2
[render]
samples = 2
[output]
formats = ["capture", "webdataset"]
"""


def run(*words: object) -> int:
    return cli.main([str(word) for word in words])


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def recipe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recipe") / "recipe.toml"
    path.write_text(RECIPE)
    return path


@pytest.fixture(scope="module")
def made(recipe: Path) -> Path:
    """The recipe's dataset, by one process."""
    folder = recipe.with_name("made")
    assert run("dataset", recipe, "-o", folder, "--workers", 1, "--json", recipe.with_name("made.json")) == 0
    return folder


def figures(recipe: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(recipe.with_name("made.json").read_text())
    return found


def test_a_dataset_is_made_described_and_whole(recipe: Path, made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert figures(recipe)["samples"] == figures(recipe)["made"] == 3
    assert figures(recipe)["pictures"] == 6 and figures(recipe)["missing"] == {}
    sheet = (made / "datasheet.html").read_text()
    assert "Small" in sheet and "CC0-1.0" in sheet and sheet.count('class="pixels"') == 3
    assert run("verify", made) == 0
    assert run("verify", made / "capture" / "00000001") == 0
    assert "as they were written" in capsys.readouterr().out


def test_harm_is_found_and_mended_by_two_processes_byte_for_byte(
    recipe: Path, made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    harmed = tmp_path / "harmed"
    shutil.copytree(made, harmed)
    picture = harmed / "capture" / "00000001" / "light_0001.exr"
    picture.write_bytes(picture.read_bytes()[:300])
    dataset.finished_list(harmed, 2).unlink()
    (harmed / "datasheet.html").write_text("")
    (harmed / f".left{dataset.PART}").mkdir()
    assert run("verify", harmed, "--json", tmp_path / "wrong.json") == 2
    wrong = json.loads((tmp_path / "wrong.json").read_text())["wrong"]
    assert wrong[0] == "datasheet.html is damaged"
    assert "capture/00000001/light_0001.exr is damaged" in wrong
    assert "finished/00000002.sha256 is missing or empty" in wrong
    assert run("verify", harmed / "capture" / "00000001") == 2
    assert "faults" in capsys.readouterr().err
    assert run("dataset", "--resume", "-o", harmed, "--workers", 2) == 0
    assert contents(harmed) == contents(made)


def test_one_sample_alone_is_the_one_of_the_whole(
    recipe: Path, made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    alone = tmp_path / "alone"
    assert run("dataset", recipe, "-o", alone, "--only", 2) == 0
    kept = contents(alone / "capture")
    assert kept == {name: data for name, data in contents(made / "capture").items() if name.startswith("00000002")}
    (row,) = (alone / dataset.MANIFEST).read_text().splitlines()
    assert row in (made / dataset.MANIFEST).read_text().splitlines()
    assert run("dataset", recipe, "-o", alone, "--only", 3) == 2
    assert "from 0 to 2" in capsys.readouterr().err


def test_samples_that_cannot_be_made_are_listed_and_the_others_are_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = tmp_path / "broken.ply"
    mesh.write_bytes(b"ply\nformat ascii 1.0\nelement vertex 3\nend_header\n")
    (tmp_path / "recipe.toml").write_text(RECIPE + '[shape]\nsource = ["blob", "broken.ply"]\n')
    folder = tmp_path / "made"
    assert run("dataset", tmp_path / "recipe.toml", "-o", folder, "--json", tmp_path / "figures.json") == 2
    missing = json.loads((folder / dataset.MISSING).read_text())
    kept = Recipe.read(tmp_path / "recipe.toml")
    there = (folder / dataset.MANIFEST).read_text().splitlines()
    assert missing and there and len(missing) + len(there) == kept.count
    assert all("broken.ply" in why for why in missing.values())
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert {int(name): why for name, why in missing.items()} == {int(i): why for i, why in figures["missing"].items()}
    error = capsys.readouterr().err
    assert f"{len(missing)} of 3 samples are missing" in error and "--resume" in error


def test_a_dry_run_makes_nothing_and_counts_the_renders(
    recipe: Path, made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run("dataset", recipe, "-o", out, "--dry-run", "--json", tmp_path / "dry.json") == 0
    found = json.loads((tmp_path / "dry.json").read_text())
    assert found["renders"] == 6
    assert not out.exists()
    size = sum(len(data) for name, data in contents(made).items() if name.startswith(("capture", "webdataset")))
    assert found["expected_bytes"] == pytest.approx(size, rel=0.15)  # shards also end in empty blocks
    assert found["expected_seconds"] > 0 and found["bytes_a_sample"] == found["expected_bytes"] / 3
    assert "1,000,000" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("dataset",), "a recipe is missing; lightsphere dataset --template"),
        (("dataset", "none.toml"), "none.toml is missing"),
        (("dataset", "--resume", "-o", "nowhere"), "nowhere is no dataset"),
        (("verify", "nowhere"), "nowhere is no dataset"),
    ],
)
def test_what_is_missing_is_said(words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(*words) == 2
    assert said in capsys.readouterr().err


def test_the_template_is_printed(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run("dataset", "--template") == 0
    (tmp_path / "recipe.toml").write_text(capsys.readouterr().out)
    assert Recipe.read(tmp_path / "recipe.toml") == Recipe()
