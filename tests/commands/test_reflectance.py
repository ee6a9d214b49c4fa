"""`lightsphere reflectance` as a user runs it, by both models, on a small drawn capture."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import cli
from pipeline.core.reflectance import Reflectance
from pipeline.core.reflectance.bivariate import Bivariate
from tests import synthetic, tolerances


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of a glossy ball and its shape."""
    made = tmp_path_factory.mktemp("reflectance")
    shape = synthetic.ball(synthetic.camera(20))
    (made / "capture").mkdir()
    synthetic.write_capture(made / "capture", shape, np.array([0.6, 0.4, 0.2]), np.full(3, 0.1), 0.5)
    dataclasses.replace(shape, notes={"capture": "../capture"}).save(made / "shape")
    return made


def run(folder: Path, output: Path, *words: str) -> dict[str, Any]:
    figures = output / "figures.json"
    assert cli.main(["reflectance", str(folder / "shape"), "-o", str(output), "--json", str(figures), *words]) == 0
    found: dict[str, Any] = json.loads(figures.read_text())
    return found


def test_tables_are_the_default(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figures = run(folder, tmp_path, "--bases", "2")
    assert "basis BRDFs 1; material_rel_rms" in capsys.readouterr().out
    found = Bivariate.open(tmp_path)
    assert found.table.shape[2] == figures["bases"] == 1
    assert (tmp_path / found.notes["shape"]).resolve() == (folder / "shape").resolve()
    assert figures["material_rel_rms"] == found.notes["material_rel_rms"] < 2 * tolerances.TABLES_HELD_OUT
    assert 0.3 < figures["nodes_seen"] < 1


def test_one_lobe_is_nearer_where_the_material_is_one(folder: Path, tmp_path: Path) -> None:
    figures = run(folder, tmp_path, "--model", "ggx")
    assert Reflectance.open(tmp_path).notes["model"] == "diffuse + GGX"
    assert figures["material_rel_rms"] < tolerances.HELD_OUT
    assert "bases" not in figures


@pytest.mark.parametrize(("word", "value"), [("--model", "ward"), ("--bases", "5")])
def test_wrong_settings_are_one_line_and_status_two(
    word: str, value: str, folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["reflectance", str(folder / "shape"), "-o", str(tmp_path), word, value]) == 2
    error = capfd.readouterr().err
    assert word[2:] in error and value in error and error.count("\n") == 1
