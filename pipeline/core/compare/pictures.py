"""A picture against another: error map and figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from ..errors import LightsphereError

WINDOW = 1.5  # standard deviation of the window in which structure is compared [px]
STABLE = (0.01**2, 0.03**2)  # keep the ratios of dark and of even windows from being noise


@dataclass(frozen=True)
class Comparison:
    """Pictures of one kind beside those that they should be.

    Parameters
    ----------
    name : str
        As figures are called.
    words : str
        What the pictures show.
    pictures, references : (L, H, W, 3) float32
        Linear radiance under single lights.
    mask : (H, W) bool
        The pixels of the object, which alone count.
    noise : float
        What render noise of both sides adds to the relative RMSE; 0 for direct light.
    parts : mapping of str to (H, W) bool, optional
        Where the asset shows most of each of its bases, by their names.
    """

    name: str
    words: str
    pictures: NDArray[np.float32]
    references: NDArray[np.float32]
    mask: NDArray[np.bool_]
    noise: float = 0.0
    parts: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)

    @property
    def relative_rmse(self) -> float:
        """Mean over the lights of the relative RMSE."""
        pairs = zip(self.pictures, self.references, strict=True)
        return float(np.mean([relative_rmse(a, b, self.mask) for a, b in pairs]))

    @property
    def errors_of_parts(self) -> dict[str, float]:
        """RMS of the difference over the references' RMS, over all lights and the pixels of each part that is lit."""
        found = {}
        for name, part in self.parts.items():
            there = self.mask & part
            if self.references[:, there].any():
                found[name] = relative_rmse(self.pictures[:, there], self.references[:, there])
        return found

    @property
    def error(self) -> NDArray[np.float64]:
        """RMS over lights and colours of the difference over the references' RMS, (H, W); NaN off the object."""
        error = picture_error(self.pictures[:, self.mask], self.references[:, self.mask])
        shown = np.full(self.mask.shape, np.nan)
        shown[self.mask] = np.sqrt((error**2).mean(axis=0))
        return shown


def relative_rmse(picture: NDArray[Any], reference: NDArray[Any], mask: NDArray[np.bool_] | None = None) -> float:
    """Return the root mean square difference of two pictures over the root mean square of the reference.

    Parameters
    ----------
    picture, reference : (H, W, 3) float
        Linear radiance.
    mask : (H, W) bool, optional
        The pixels that count; all where it is left out.

    Returns
    -------
    float
        0 for equal pictures, 1 for a black picture; ``relight_rel_rmse`` is this figure.

    Raises
    ------
    LightsphereError
        When the pictures differ in size, or the reference is black.

    Examples
    --------
    >>> relative_rmse(np.full((2, 2, 3), 1.05), np.ones((2, 2, 3)))  # doctest: +ELLIPSIS
    0.05...
    """
    if picture.shape != reference.shape:
        raise LightsphereError(f"the pictures are {_size(picture)} and {_size(reference)} pixels; compare equal sizes")
    a, b = picture.astype(np.float64), reference.astype(np.float64)
    if mask is not None:
        a, b = a[mask], b[mask]
    power = float(np.mean(b**2)) if b.size else 0.0
    if power == 0:
        raise LightsphereError("the reference picture is black where it is compared; choose another reference")
    return float(np.sqrt(np.mean((a - b) ** 2) / power))


def picture_error(picture: NDArray[Any], reference: NDArray[Any]) -> NDArray[np.float64]:
    """Return the difference of pictures (..., 3) per pixel, (...): RMS over the colours over the reference's RMS."""
    a, b = picture.astype(np.float64), reference.astype(np.float64)
    level = max(float(np.sqrt(np.mean(b**2))), float(np.finfo(np.float64).tiny))
    return np.asarray(np.sqrt(np.mean((a - b) ** 2, axis=-1)) / level)


def structural_similarity(picture: NDArray[Any], reference: NDArray[Any]) -> NDArray[np.float64]:
    """Return how alike two pictures are in brightness, contrast and structure about every pixel.

    Parameters
    ----------
    picture, reference : (H, W, 3) float
        Display values, 0 to 1.

    Returns
    -------
    (H, W) float64
        SSIM in a Gaussian window, the mean over the colours: 1 for equal pictures, less for others.

    References
    ----------
    Wang, Bovik, Sheikh and Simoncelli 2004, equation 13.

    Examples
    --------
    Even pictures of .5 and .25 give (2 x .125 + .0001) / (.3125 + .0001).
    """
    a, b = picture.astype(np.float64), reference.astype(np.float64)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(gaussian_filter(values, (WINDOW, WINDOW, 0)))

    mean_a, mean_b = mean(a), mean(b)
    variance = mean(a * a) - mean_a**2 + mean(b * b) - mean_b**2
    covariance = mean(a * b) - mean_a * mean_b
    brightness = (2 * mean_a * mean_b + STABLE[0]) / (mean_a**2 + mean_b**2 + STABLE[0])
    return np.asarray((brightness * (2 * covariance + STABLE[1]) / (variance + STABLE[1])).mean(axis=-1))


def _size(picture: NDArray[Any]) -> str:
    return f"{picture.shape[1]}x{picture.shape[0]}"
