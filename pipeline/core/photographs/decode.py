"""One light's photographs as one linear picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LightsphereError
from .exposures import merge
from .measured import measured
from .photographs import FLOAT_BITS, Picture, Shot
from .response import BY_EXPOSURES, Response, response_of

STEPS_TO_FULL = 1.5  # the last number below full scale counts as saturated, too: compression moves values by one


@dataclass(frozen=True)
class Decoded:
    """A linear picture.

    Parameters
    ----------
    linear : (H, W, 3) float32
        Full scale of the (shortest) exposure is 1.
    bits : int
        Of the file.
    seconds : float, optional
        The (shortest) exposure time, where it is known [s].
    times : tuple of float, optional
        Of all exposures that were merged [s].
    response : Response
        What was taken off.
    saturation : float
        Linear value from which a pixel is saturated, infinite for files of floats.
    focal : float, optional
        Focal length, where the file states it, as if the picture's longer side were 36 mm [mm].
    """

    linear: NDArray[np.float32]
    bits: int
    seconds: float | None
    times: tuple[float, ...]
    response: Response
    saturation: float
    focal: float | None = None


def decoded(shots: Sequence[Shot], response: str | Response) -> Decoded:
    """Read, decode and merge the exposures of one light; a response by name is told by :func:`.response_of`.

    Raises
    ------
    LightsphereError
        When they differ in size, hold values that are not numbers, or have no exposure times to merge them by.
    """
    pictures = [shot.read() for shot in shots]
    for shot, picture in zip(shots, pictures, strict=True):
        if picture.pixels.shape != pictures[0].pixels.shape:
            raise LightsphereError(
                f"{shot.name} is {size(picture.pixels)} pixels, {shots[0].name} {size(pictures[0].pixels)}; "
                "all photographs need the same size"
            )
        if not np.isfinite(picture.pixels).all():
            raise LightsphereError(f"{shot.name} holds values that are not numbers; export it again")
    times = tuple(shot.seconds or picture.seconds for shot, picture in zip(shots, pictures, strict=True))
    bits = min(picture.bits for picture in pictures)
    if response == BY_EXPOSURES:
        response = measured([shots])
    curve = response_of(response, bits) if isinstance(response, str) else response
    known = [t for t in times if t is not None]
    linear = curve.decode(pictures[0].pixels) if len(pictures) == 1 else _merged(shots, pictures, known, curve)
    shortest = min(known, default=None)
    return Decoded(linear, bits, shortest, tuple(known), curve, saturation(curve, bits), pictures[0].focal)


def _merged(
    shots: Sequence[Shot], pictures: Sequence[Picture], times: Sequence[float], curve: Response
) -> NDArray[np.float32]:
    if len(times) < len(pictures) or len(set(times)) < len(pictures):
        raise LightsphereError(
            f"the exposure times of {shots[0].name} to {shots[-1].name} are not known or not different; write them "
            "into exposures.txt, one NAME SECONDS a line, or give the folder of one object if these are several lights"
        )
    stored = np.stack([picture.pixels for picture in pictures])
    rounding = np.stack([curve.rounding(picture.pixels, picture.bits) for picture in pictures])
    return merge(curve.decode(stored), stored, rounding, np.array(times))


def saturation(curve: Response, bits: int) -> float:
    """Return the linear value from which a pixel is saturated."""
    if bits >= FLOAT_BITS:
        return float("inf")
    return float(curve.curve(np.array(1 - STEPS_TO_FULL / (2.0**bits - 1))))


def size(pixels: NDArray[Any]) -> str:
    """Return width x height in words."""
    return f"{pixels.shape[1]}x{pixels.shape[0]}"
