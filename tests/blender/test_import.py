"""`lightsphere import` as a user runs it, on sets drawn here and, where they lie, on published ones."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import cli
from pipeline.core.capture import Capture
from tests import photographed as drawn
from tests.photographed import listed, png

LIGHTS = drawn.directions()
DATA = os.environ.get("LIGHTSPHERE_DATA", "")
published = pytest.mark.skipif(
    not DATA or not Path(DATA).is_dir(), reason="no data sets: LIGHTSPHERE_DATA does not name their folder"
)


def photographs(folder: Path) -> Path:
    folder.mkdir()
    for i, picture in enumerate(drawn.lambert(LIGHTS)):
        png(folder / f"IMG_{i:04d}.png", np.round(drawn.colours(picture) * 65535).astype(np.uint16))
    png(folder / "mask.png", 255 * np.isfinite(drawn.normals()[..., 0]).astype(np.uint8))
    return folder


def figures(source: Path, output: Path, *words: str) -> dict[str, Any]:
    path = output.with_suffix(".json")
    assert cli.main(["import", str(source), "-o", str(output), "--json", str(path), *words]) == 0
    return json.loads(path.read_text())


def least_squares_error(made: Capture) -> float:
    """Return the mean angular error of plain Lambertian photometric stereo against the capture's truth [degrees]."""
    mask, truth = made.mask(), made.truth()
    assert truth is not None
    pictures = np.array([made.image(i) / made.lights.intensity[i] for i in range(len(made))]).mean(axis=3)
    normal = drawn.least_squares(pictures, made.lights.position, mask)
    return float(np.nanmean(drawn.angles(normal, truth.normal[mask])))


def test_a_folder_with_a_list_of_lights(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = photographs(tmp_path / "ball")
    (source / "dome.lp").write_text("12\n" + listed(LIGHTS, [f"IMG_{i:04d}.jpg" for i in range(12)]))
    found = figures(source, tmp_path / "capture")
    assert (found["lights"], found["size"], found["bit_depth"], found["format"]) == (12, [96, 96], 16, "lp")
    said = capsys.readouterr().out
    assert said.count("\n") == 1 and "12 distant lights" in said and "16 bits are linear" in said
    made = Capture.open(tmp_path / "capture")
    assert made.changed() == [] and len(made.notes["photographs"]) == 13
    np.testing.assert_allclose(made.image(5)[..., 1], drawn.lambert(LIGHTS)[5], atol=1e-5)


def test_unknown_lights(tmp_path: Path) -> None:
    found = figures(photographs(tmp_path / "ball"), tmp_path / "capture")
    assert (found["format"], found["light_kind"]) == ("uncalibrated", "unknown")
    assert Capture.open(tmp_path / "capture").lights.kind == "unknown"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere"], "nowhere does not exist"),
        (["{ball}", "--lights", "no.lp"], "no.lp is missing"),
        (["{ball}", "--response", "bright"], "response bright is no file"),
        (["{ball}", "--format", "diligent"], "filenames.txt cannot be read"),
        (["{ball}", "--format", "sculpture"], "format is 'sculpture'"),
        (["{ball}", "--bracket", "5"], "no multiple of --bracket 5"),
        (["{ball}", "--gray", "nowhere"], "nowhere is no folder"),
    ],
)
def test_wrong_input_is_told_on_one_line(
    tmp_path: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    source = photographs(tmp_path / "ball")
    given = [word.format(ball=source) for word in words]
    assert cli.main(["import", *given, "-o", str(tmp_path / "capture")]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and said in err
    assert not (tmp_path / "capture" / "capture.json").exists()


def test_photographs_are_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = photographs(tmp_path / "ball")
    assert cli.main(["import", str(source), "-o", str(source)]) == 2
    assert "a folder of its own" in capsys.readouterr().err


def test_doubtful_lights_are_warned_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = photographs(tmp_path / "ball")
    (source / "lights.txt").write_text(listed(LIGHTS * [1, 1e-4, 1]))
    figures(source, tmp_path / "capture")
    assert "lie in one plane" in capsys.readouterr().err


@published
@pytest.mark.parametrize(
    ("path", "lights", "bits", "low", "high"),
    [
        ("diligent/ballPNG", 96, 16, 4.1, 4.3),  # the benchmark's own figure for least squares is 4.1
        ("diligent/catPNG", 96, 16, 8.3, 8.5),  # 8.4
        ("bunny/bunny_lambert.npz", 50, 32, 4.1, 4.3),  # cast shadows alone
    ],
)
def test_least_squares_on_published_sets(
    tmp_path: Path, path: str, lights: int, bits: int, low: float, high: float
) -> None:
    found = figures(Path(DATA, path), tmp_path / "capture")
    assert (found["lights"], found["bit_depth"]) == (lights, bits)
    assert low < least_squares_error(Capture.open(tmp_path / "capture")) < high


@published
def test_spheres_of_a_published_set(tmp_path: Path) -> None:
    psm = Path(DATA, "psm")
    words = ["--lights", str(psm / "lights.txt"), "--chrome", str(psm / "chrome"), "--gray", str(psm / "gray")]
    found = figures(psm / "buddha", tmp_path / "capture", *words)
    assert (found["lights"], found["size"], found["bit_depth"]) == (12, [512, 340], 8)
    assert found["response"] == "linear"
    assert found["directions"] == "mirror sphere"
    assert min(found["light_angles_deg"]) > 1 and max(found["light_angles_deg"]) < 9
    assert found["gray_error_pct"]["mirror sphere"] < found["gray_error_pct"]["list"] < 8


@published
def test_a_published_set_under_unknown_lights(tmp_path: Path) -> None:
    found = figures(Path(DATA, "mit_lab", "frog1"), tmp_path / "capture")
    assert (found["lights"], found["light_kind"], found["bit_depth"]) == (10, "unknown", 16)
