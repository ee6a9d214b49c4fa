"""Photographs before they are decoded: which file shows which light, and what is known beside them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..lights import Lights

FLOAT_BITS = 32


@dataclass(frozen=True)
class Picture:
    """A picture as its file holds it.

    Parameters
    ----------
    pixels : (H, W, 3) float32
        Rows top-down, in units of the largest number that an integer file can hold, without any transfer curve
        applied or taken off; the numbers themselves for a file of floats.
    bits : int
        Bits of a number in the file, 32 for floats.
    seconds : float, optional
        Exposure time that the file states [s].
    focal : float, optional
        Focal length that the file states, as if the picture's longer side were 36 mm [mm].
    """

    pixels: NDArray[np.float32]
    bits: int
    seconds: float | None = None
    focal: float | None = None


Reader = Callable[[Path], Picture]


@dataclass(frozen=True)
class Shot:
    """One photograph, read when it is needed.

    Parameters
    ----------
    name : str
        For messages and records.
    read : callable
        Returns the picture.
    path : Path, optional
        Its file, where it has one of its own.
    seconds : float, optional
        Exposure time by its name or a list [s]; it goes before what the file itself states.
    """

    name: str
    read: Callable[[], Picture]
    path: Path | None = None
    seconds: float | None = None


@dataclass(frozen=True)
class Photographs:
    """Everything that was found about a set of photographs.

    Parameters
    ----------
    format : str
        One of :data:`.settings.FORMATS`.
    shots : tuple of tuple of Shot
        For each of the L lights, its exposures.
    lights : Lights
    mask : Shot, optional
        A picture that is bright where the object is.
    ambient : Shot, optional
        A picture without any of the lights.
    camera : Camera, optional
        Where it is known; otherwise the view is orthographic.
    normal : (H, W, 3) float32, optional
        True normals, camera space, for figures alone; NaN where not known.
    assumed : tuple of str
        What was not stated and had to be assumed, in words for a user.
    notes : dict
        Whatever else belongs into the capture's notes.
    """

    format: str
    shots: tuple[tuple[Shot, ...], ...]
    lights: Lights
    mask: Shot | None = None
    ambient: Shot | None = None
    camera: Camera | None = None
    normal: NDArray[np.float32] | None = None
    assumed: tuple[str, ...] = ()
    notes: dict[str, Any] = field(default_factory=dict)


def distant(direction: NDArray[np.float64], intensity: NDArray[np.float64] | None = None) -> Lights:
    """Return distant lights; without irradiances (L, 3) each is pi, a white Lambertian surface facing it being 1."""
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    stated = np.full((len(direction), 3), np.pi) if intensity is None else intensity
    return Lights("distant", direction / length, stated, np.full(len(direction), 2))


def unknown(count: int) -> Lights:
    """Return lights of which nothing is known."""
    return Lights("unknown", np.zeros((count, 3)), np.ones((count, 3)), np.full(count, 2))
