"""Polynomial texture maps, read back as their format says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.relight import ptm

HEIGHT, WIDTH = 5, 7


def read(path: Path) -> NDArray[np.float64]:
    """Return the coefficients (6, H, W, 3), the top row first, of a file of PTM_FORMAT_RGB."""
    data = path.read_bytes()
    *lines, body = data.split(b"\n", 6)
    assert lines[:2] == [b"PTM_1.2", b"PTM_FORMAT_RGB"]
    width, height = int(lines[2]), int(lines[3])
    scale, bias = np.array(lines[4].split(), float), np.array(lines[5].split(), int)
    assert len(body) == 18 * width * height
    assert ((bias >= 0) & (bias <= 255)).all()
    planes = np.frombuffer(body, np.uint8).reshape(3, height, width, 6)[:, ::-1]
    return ((planes - bias.astype(float)) * scale).transpose(3, 1, 2, 0)


def value(coefficients: NDArray[np.float64], towards: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what a viewer shows under a light."""
    u, v = towards[:2]
    return np.tensordot([u * u, v * v, u * v, u, v, 1.0], coefficients, 1)


def drawn(towards: NDArray[np.float64]) -> NDArray[np.float64]:
    """Facets that all slant otherwise, of coloured matt paint, without shadows: a plane in the light's u and v."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    slant = 0.3 + 0.05 * rows[..., None] * towards[0] - 0.02 * columns[..., None] * towards[1]
    return slant * np.array([1.0, 0.6, 0.3])


def test_what_is_a_polynomial_is_kept_to_the_bytes_of_its_coefficients(tmp_path: Path) -> None:
    lights = ptm.directions()
    assert len(lights) == ptm.LIGHTS
    assert (lights[:, 2] > 0).all()
    found = ptm.fitted(lights, (drawn(one) for one in lights))
    assert found.rms < 1e-6
    ptm.write(tmp_path / "a.ptm", found.coefficients)
    new = np.array([0.5, -0.3, 0.8])
    shown = value(read(tmp_path / "a.ptm"), new)
    assert np.abs(shown - 255 * drawn(new)).max() < 1.0
    assert np.abs(shown[::-1] - 255 * drawn(new)).max() > 5.0  # rows run from the bottom up


def test_how_far_a_polynomial_is_off_is_said() -> None:
    lights = ptm.directions()
    seen = [np.full((HEIGHT, WIDTH, 3), float(one[2] > 0.9)) for one in lights]  # a highlight
    found = ptm.fitted(lights, seen)
    missing = [255 * picture - value(found.coefficients, one) for one, picture in zip(lights, seen, strict=True)]
    assert found.rms == pytest.approx(np.sqrt(np.square(missing).mean()), rel=1e-9)
    assert found.rms > 10
