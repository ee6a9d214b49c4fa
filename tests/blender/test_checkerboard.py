"""A checkerboard tells the lens that photographed it; photographs that do not are refused."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline import cli
from pipeline.blender.checkerboard import Lens, lens
from pipeline.core.capture import Capture
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from tests import photographed as drawn
from tests import tolerances
from tests.photographed import png

WIDTH, HEIGHT, FOCAL, INNER = 480, 360, 620.0, 3  # [px], and samples of a pixel along each side
TILTS = [(0.5, 0.1, 0.0), (-0.4, 0.3, 0.4), (0.1, -0.55, -0.3), (0.35, 0.45, 0.8), (-0.5, -0.35, 0.2)]


def photograph(tilt: tuple[float, float, float], distance: float = 19.0) -> NDArray[Any]:
    """A board of 8x6 unit squares, 7x5 inner corners, on a white sheet, by rays through the pixels."""
    x, y, z = tilt
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    turn = about_z @ about_y @ about_x
    u = (np.arange(WIDTH * INNER) + 0.5) / INNER - WIDTH / 2
    v = (np.arange(HEIGHT * INNER) + 0.5) / INNER - HEIGHT / 2
    rays = np.stack([*np.meshgrid(u / FOCAL, v / FOCAL), np.ones((len(v), len(u)))], axis=-1)
    centre = np.array([0.4, -0.3, distance])
    place = (rays * (centre @ turn[:, 2] / (rays @ turn[:, 2]))[..., None] - centre) @ turn[:, :2]
    square = np.floor(place + np.array([4, 3])).astype(int)
    on = (square >= 0).all(axis=-1) & (square < [8, 6]).all(axis=-1)
    white = np.where(on, square.sum(axis=-1) % 2, 1)
    shown = 0.05 + 0.8 * white.reshape(HEIGHT, INNER, WIDTH, INNER).mean(axis=(1, 3))
    noisy = shown + 0.01 * np.random.default_rng(int(1000 * (x + 1))).standard_normal(shown.shape)
    return np.round(255 * np.clip(noisy, 0, 1)).astype(np.uint8)


def told(folder: Path, tilts: list[tuple[float, float, float]], corners: str = "7x5") -> Lens:
    for number, tilt in enumerate(tilts):
        png(folder / f"board_{number}.png", np.repeat(photograph(tilt)[..., None], 3, axis=2))
    return finish(lens(folder, corners))


def test_the_focal_length_comes_back(tmp_path: Path) -> None:
    found = told(tmp_path, TILTS)
    true = FOCAL * 36 / WIDTH
    assert found.focal == pytest.approx(true, rel=tolerances.FOCAL)
    assert abs(found.focal - true) < 5 * found.deviation < 0.1 * true
    assert (found.seen, found.size) == (len(TILTS), (WIDTH, HEIGHT))


def test_an_import_takes_the_lens(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    photographs, board = tmp_path / "ball", tmp_path / "board"
    photographs.mkdir()
    board.mkdir()
    for number, picture in enumerate(drawn.lambert(drawn.directions())):
        wide = np.pad(drawn.colours(picture), ((0, 0), (16, 16), (0, 0)))  # of the board's proportions
        png(photographs / f"IMG_{number:04d}.png", np.round(wide * 65535).astype(np.uint16))
    for number, tilt in enumerate(TILTS):
        png(board / f"board_{number}.png", photograph(tilt))
    words = ["import", str(photographs), "--checkerboard", str(board), "--corners", "7x5", "-o"]
    assert cli.main([*words, str(tmp_path / "capture")]) == 0
    assert "mm by the checkerboard" in capsys.readouterr().out
    made = Capture.open(tmp_path / "capture")
    assert made.camera.model == "pinhole"
    assert made.camera.focal[0] == pytest.approx(FOCAL * 128 / WIDTH, rel=tolerances.FOCAL)
    assert made.notes["found"]["checkerboards"] == len(TILTS)
    assert cli.main([*words, str(tmp_path / "twice"), "--focal", "50"]) != 0
    assert "leave --checkerboard out, or --focal" in capsys.readouterr().err
    png(board / "board_0.png", photograph(TILTS[0])[:300])
    assert cli.main([*words, str(tmp_path / "torn")]) != 0
    assert "is of another size" in capsys.readouterr().err


def test_a_board_that_is_never_tilted_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LightsphereError, match="too few sides"):
        told(tmp_path, [(0.0, 0.0, 0.1 * turn) for turn in range(4)])


def test_photographs_of_another_board_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LightsphereError, match="9x6 inner corners was found in 0 of 3"):
        told(tmp_path, TILTS[:3], "9x6")


@pytest.mark.parametrize("corners", ["9", "9x", "2x6", "nine x six"])
def test_what_is_no_board_is_told(tmp_path: Path, corners: str) -> None:
    with pytest.raises(LightsphereError, match="is no board"):
        finish(lens(tmp_path, corners))


def test_without_opencv_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(LightsphereError, match=r"pip install lightsphere\[checkerboard\]"):
        finish(lens(tmp_path, "9x6"))
