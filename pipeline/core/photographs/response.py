"""The camera's response: values as stored to values proportional to the light."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LightsphereError
from .tables import table

BY_EXPOSURES = "exposures"  # see :mod:`.measured`
GAMMA_RANGE = (0.2, 5.0)
LINEAR_FROM_BITS = 9  # more than 8 bits are stored linear by custom, 8 bits by a curve


@dataclass(frozen=True)
class Response:
    """A camera's response curve; 0 stays 0 and full scale stays 1.

    Parameters
    ----------
    name : str
        In words for a user.
    curve : callable
        Values as stored, of any shape, to linear ones.
    """

    name: str
    curve: Callable[[NDArray[Any]], NDArray[Any]]

    def decode(self, pixels: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return linear values."""
        return np.asarray(self.curve(pixels), np.float32)

    def rounding(self, pixels: NDArray[np.float32], bits: int) -> NDArray[np.float32]:
        """Return the standard deviation of the rounding to integers as it appears in the linear values."""
        half = 0.5 / (2.0 ** min(bits, 24) - 1)
        low, high = np.clip(pixels - half, 0, 1), np.clip(pixels + half, 0, 1)
        return np.asarray((self.curve(high) - self.curve(low)) / np.sqrt(12.0), np.float32)


def response_of(text: str, bits: int) -> Response:
    """Return the response that a user states.

    Parameters
    ----------
    text : str
        ``"auto"``, ``"linear"``, ``"srgb"``, a gamma g (light = value^g), or a file of two columns, value as stored
        and light, both rising; they are scaled so that the last row is full scale.
    bits : int
        Of the pictures, for ``"auto"``.

    Raises
    ------
    LightsphereError
        When it is none of these, or the file is not a rising curve.

    Examples
    --------
    >>> float(response_of("2.0", 8).curve(np.float64(0.5)))
    0.25
    """
    if text == "auto":
        text = "linear" if bits >= LINEAR_FROM_BITS else "srgb"
    if text == BY_EXPOSURES:
        raise LightsphereError("a response from exposures needs several of a thing; give a folder of them")
    if text == "linear":
        return Response("linear", lambda value: value)
    if text == "srgb":
        return Response("sRGB", srgb)
    try:
        gamma = float(text)
    except ValueError:
        return _from_file(Path(text))
    if not GAMMA_RANGE[0] <= gamma <= GAMMA_RANGE[1]:
        raise LightsphereError(f"the gamma {text} is not within {GAMMA_RANGE[0]} and {GAMMA_RANGE[1]}; correct it")
    return Response(f"gamma {gamma:g}", lambda value: np.maximum(value, 0) ** gamma)


def srgb(value: NDArray[Any]) -> NDArray[Any]:
    """Return the light of sRGB values (IEC 61966-2-1)."""
    return np.where(value <= 0.04045, value / 12.92, ((np.maximum(value, 0) + 0.055) / 1.055) ** 2.4)


def _from_file(path: Path) -> Response:
    try:
        is_there = path.is_file()
    except OSError:  # no name of a file, being too long
        is_there = False
    if not is_there:
        raise LightsphereError(f"the response {path} is no file; give linear, srgb, a gamma such as 2.2, or a file")
    points = table(path, 2)
    if len(points) < 2 or not (np.diff(points, axis=0) > 0).all() or (points[0] < 0).any():
        raise LightsphereError(f"{path} does not rise from 0 or more in both columns; a response curve must")
    stored, light = (points / points[-1]).T
    return Response(f"of {path.name}", lambda value: np.interp(value, stored, light))
