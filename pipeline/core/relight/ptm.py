"""Polynomial texture maps, which viewers for reflectance transformation imaging show: ``.ptm``, version 1.2.

Every colour of a pixel is a polynomial of the light's direction, c = a0 u^2 + a1 v^2 + a2 uv + a3 u + a4 v + a5, (u, v)
the unit vector to it along the picture's right and up (Malzbender, Gelb and Wolters 2001). A coefficient is kept in a
byte, (byte - bias) scale. What a polynomial of second degree cannot follow - narrow highlights, edges of shadows - is
smoothed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import images
from ..rig import hemisphere

LIGHTS = 64
WHITE = 255.0


@dataclass(frozen=True)
class Polynomials:
    """Coefficients (6, H, W, 3) of values from 0 to 255, and how far off they are: the root mean square of a value."""

    coefficients: NDArray[np.float64]
    rms: float


def directions() -> NDArray[np.float64]:
    """Return the unit directions (LIGHTS, 3) to the lights of a fit, in camera space: evenly before the picture."""
    return hemisphere(LIGHTS)


def fitted(lights: NDArray[np.float64], pictures: Iterable[NDArray[Any]]) -> Polynomials:
    """Return the polynomials that are nearest to pictures.

    Parameters
    ----------
    lights : (N, 3) float64
        Unit directions, camera space.
    pictures : iterable of (H, W, 3)
        As they are displayed, 0 to 1.
    """
    terms = _terms(lights)
    count = terms.shape[1]
    triangle, rotated = np.zeros((count, count)), [np.zeros(())] * count
    square, values = 0.0, 0
    # by Givens' rotations of one picture after the other: a difference of sums of squares would lose small misfits
    for term, picture in zip(terms, pictures, strict=True):
        row, rest = term.copy(), WHITE * np.asarray(picture, np.float64)
        values += rest.size
        for i in range(count):
            if row[i] == 0.0:
                continue
            c, s = np.array([triangle[i, i], row[i]]) / np.hypot(triangle[i, i], row[i])
            triangle[i], row = c * triangle[i] + s * row, c * row - s * triangle[i]
            rotated[i], rest = c * rotated[i] + s * rest, c * rest - s * rotated[i]
        square += float((rest**2).sum())
    coefficients = np.tensordot(np.linalg.pinv(triangle), np.stack(np.broadcast_arrays(*rotated)), 1)
    return Polynomials(coefficients, float(np.sqrt(square / values)))


def write(path: Path, coefficients: NDArray[np.float64]) -> None:
    """Write coefficients (6, H, W, 3) as PTM_FORMAT_RGB: red, green, then blue, rows from the bottom up."""
    low = np.minimum(coefficients.min(axis=(1, 2, 3)), 0.0)
    scale = np.maximum(np.maximum(coefficients.max(axis=(1, 2, 3)), 0.0) - low, 1e-6) / 255
    bias = np.round(-low / scale).astype(int)
    of_term = (slice(None), None, None, None)
    steps = np.clip(np.round(coefficients / scale[of_term] + bias[of_term]), 0, 255).astype(np.uint8)
    height, width = coefficients.shape[1:3]
    lines = ["PTM_1.2", "PTM_FORMAT_RGB", str(width), str(height)]
    lines += [" ".join(f"{value:.9g}" for value in scale), " ".join(map(str, bias))]
    head = "\n".join(lines) + "\n"
    images.write_bytes(path, head.encode("ascii") + steps[:, ::-1].transpose(3, 1, 2, 0).tobytes())


def _terms(lights: NDArray[np.float64]) -> NDArray[np.float64]:
    u, v = lights[:, 0], lights[:, 1]
    return np.stack([u * u, v * v, u * v, u, v, np.ones_like(u)], axis=1)
