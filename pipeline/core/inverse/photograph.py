"""The photograph as it is compared: linear, of the size that is rendered, with what cannot be trusted left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, uniform_filter

from ..errors import LightsphereError
from ..photographs.response import response_of

SATURATED = 0.985  # of full scale, of pictures of integers
ASPECT = 0.02  # relative difference of aspects that a rounded size makes


@dataclass(frozen=True)
class Photograph:
    """A picture of the scene.

    Parameters
    ----------
    pixels : (H, W, 3) float64
        Linear radiance.
    trusted : (H, W) bool
        False where the picture is saturated or not a number.
    averaged : bool
        Whether each pixel is the mean of several of the picture's own; else it is one of them, with its filter.
    """

    pixels: NDArray[np.float64]
    trusted: NDArray[np.bool_]
    averaged: bool = False


def prepared(pixels: NDArray[np.float32], bits: int, response: str, size: tuple[int, int], width: int) -> Photograph:
    """Return a photograph as it is compared.

    Parameters
    ----------
    pixels : (H, W, 3) float32
        As stored; integers are scaled to 1.
    bits : int
        32 for floats.
    response : str
        See :func:`pipeline.core.photographs.response.response_of`.
    size : (int, int)
        Width and height of the scene's own pictures, whose aspect the photograph must have.
    width : int
        Of the result, unless the photograph is smaller.

    Raises
    ------
    LightsphereError
        For another aspect, or a picture that is black, negative or broken for the most part.
    """
    tall, wide = pixels.shape[:2]
    if abs(wide / tall * size[1] / size[0] - 1) > ASPECT:
        raise LightsphereError(
            f"the photograph has {wide}x{tall} pixels, the scene's camera {size[0]}x{size[1]}; "
            "set the scene's resolution to the photograph's aspect"
        )
    trusted = np.isfinite(pixels).all(axis=-1)
    if bits < 32:
        trusted &= (pixels < SATURATED).all(axis=-1)
    trusted &= (pixels >= 0).all(axis=-1)
    linear = response_of(response, bits).decode(np.where(np.isfinite(pixels), pixels, 0)).astype(np.float64)
    width = min(width, wide)
    height = max(1, round(width * tall / wide))
    linear = averaged(averaged(linear, height, 0), width, 1)
    good = averaged(averaged(trusted.astype(np.float64), height, 0), width, 1) > 1 - 1e-9
    if not (linear[good] > 0).any() or good.mean() < 0.1:
        raise LightsphereError("the photograph is black, saturated or broken nearly everywhere; give another one")
    return Photograph(linear, good, width < wide)


def averaged(values: NDArray[np.float64], count: int, axis: int) -> NDArray[np.float64]:
    """Return values averaged over an axis' equal parts, exactly."""
    values = np.moveaxis(values, axis, 0)
    whole = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    place = np.linspace(0, len(values), count + 1)
    below = np.minimum(place.astype(int), len(values) - 1)
    share = (place - below).reshape(-1, *(1,) * (values.ndim - 1))
    at = whole[below] + share * (whole[below + 1] - whole[below])
    return np.moveaxis(np.diff(at, axis=0) * (count / len(values)), 0, axis)


def weights(photograph: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what makes squared differences relative: 1 over the squared radiance about each pixel, (H, W, 3).

    A third of the colour's own mean is added, so that dark corners do not rule. Weights depend on the photograph alone.
    """
    about = uniform_filter(photograph, (5, 5, 0))
    return np.asarray(1 / (about + photograph.mean(axis=(0, 1)) / 3) ** 2)


def inner(index: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return the pixels that are not at the edge of their group, (H, W): small errors of geometry do no harm there."""
    kept = np.zeros(index.shape, bool)
    for number in np.unique(index):
        kept |= binary_erosion(index == number, np.ones((3, 3)), border_value=1)
    return kept
