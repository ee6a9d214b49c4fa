"""What the pixels of photographs see, each by itself or as the mean of a block."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, convolve

from ...camera import Camera
from ..integration import integrate
from ..photometric.sight import Sight

Array = NDArray[np.float64]

SHADOWED = 0.1  # of a pixel's 90th percentile; below it a light is taken for shadowed
USUAL = 0.6  # quantile of the lit values that is a pixel's usual one
BRIGHT, BRIGHT_ALBEDO = 0.95, 0.8  # quantile of the pixels' usual values, and the albedo that it is taken for
#: Takes off every plane; its coefficients' squares add up to 36 (Immerkaer 1996).
DIFFERENCE = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])


@dataclass(frozen=True)
class Pictures:
    """What P pixels see, without lights.

    Parameters
    ----------
    mask : (H, W) bool
        Where the pixels are; numbered in row order.
    camera : Camera
        Of pictures of the mask's size.
    values : (P, L, 3) float64
        Radiance in any unit.
    usable : (P, L) float64
        0 where saturated or not a number, 1 where trusted.
    noise : float
        Standard deviation of the noise of a value of one colour.
    """

    mask: NDArray[np.bool_]
    camera: Camera
    values: Array
    usable: Array
    noise: float

    @cached_property
    def rays(self) -> Array:
        """Origins and unit directions (P, 6) of the pixels' rays, camera space."""
        origins, directions = (part[self.mask] for part in self.camera.rays())
        to_camera = self.camera.to_world[:3, :3]
        return np.concatenate([(origins - self.camera.to_world[:3, 3]) @ to_camera, directions @ to_camera], axis=1)

    @property
    def pinhole(self) -> bool:
        """Whether the rays leave one point."""
        return self.camera.model == "pinhole"

    @cached_property
    def views(self) -> Array:
        """Unit directions to the camera (P, 3)."""
        return np.ascontiguousarray(-self.rays[:, 3:])

    @cached_property
    def gray(self) -> Array:
        """Return the mean of the colours (P, L)."""
        return np.asarray(self.values.mean(axis=2))

    @cached_property
    def lit(self) -> Array:
        """Return how far each value can be used (P, L): 0 in shadow."""
        bright = np.quantile(np.where(self.usable > 0, self.gray, 0.0), 0.9, axis=1, keepdims=True)
        return np.where(self.gray > SHADOWED * bright, self.usable, 0.0)

    @cached_property
    def usual(self) -> Array:
        """Return each pixel's usual value (P,)."""
        seen = np.where(self.lit > 0, self.gray, np.inf)
        seen[~(self.lit > 0).any(axis=1)] = 1.0
        place = USUAL * (np.isfinite(seen).sum(axis=1, keepdims=True) - 1)
        seen.sort(axis=1)  # quicker than numpy's quantile of rows with gaps
        low, high = (np.take_along_axis(seen, end(place).astype(np.int64), axis=1) for end in (np.floor, np.ceil))
        return np.asarray(low + (place - np.floor(place)) * (high - low))[:, 0]

    @property
    def white(self) -> float:
        """What a white surface usually shows; the pictures leave it open."""
        return float(np.quantile(self.usual, BRIGHT)) / BRIGHT_ALBEDO


def surface_points(pictures: Pictures, normals: Array) -> Array:
    """Return the points (P, 3), camera space, of the surface through the pixels' normals (P, 3)."""
    normal = np.full((*pictures.mask.shape, 3), np.nan)
    normal[pictures.mask] = normals
    depth = integrate(normal, pictures.mask, pictures.camera)[pictures.mask]
    return np.asarray(pictures.rays[:, :3] + depth[:, None] * pictures.rays[:, 3:])


def pictures_of(camera: Camera, mask: NDArray[np.bool_], sight: Sight, unit: Array) -> Pictures:
    """Return what a camera's pixels see of L lights, in units (L, 3)."""
    values = sight.values / unit
    return Pictures(mask, camera, values, sight.usable.astype(np.float64), noise_of(mask, values))


def reduced(full: Pictures, side: int) -> Pictures:
    """Return the means of square blocks of pixels within the mask."""
    mask = blocks(full.mask, side).all(axis=(1, 3))
    count = full.values.shape[1]
    values, usable = np.empty((int(mask.sum()), count, 3)), np.empty((int(mask.sum()), count))
    picture, used = np.zeros((*full.mask.shape, 3)), np.zeros(full.mask.shape)
    for light in range(count):
        picture[full.mask], used[full.mask] = full.values[:, light], full.usable[:, light]
        values[:, light] = blocks(picture, side).mean(axis=(1, 3))[mask]
        usable[:, light] = blocks(used, side).min(axis=(1, 3))[mask]
    return Pictures(mask, full.camera.binned(side), values, usable, full.noise / side)


def blocks(picture: NDArray[np.generic], side: int) -> NDArray[np.generic]:
    """Return a picture (H, W, ...) as (H / side, side, W / side, side, ...); what does not fill a block is left out."""
    height, width = picture.shape[0] // side, picture.shape[1] // side
    return picture[: height * side, : width * side].reshape(height, side, width, side, *picture.shape[2:])


def noise_of(mask: NDArray[np.bool_], values: NDArray[np.float64]) -> float:
    """Return the standard deviation of the noise that does not grow with the light.

    Told from the darker half of each picture's pixels, by the median, so that edges and highlights do not count.

    Parameters
    ----------
    mask : (H, W) bool
    values : (P, L, 3) float64
        Of its pixels under L lights.
    """
    inner = binary_erosion(mask, np.ones((3, 3)))
    if not inner.any():
        return 0.0
    picture, found = np.zeros((*mask.shape, 3)), []
    for light in range(values.shape[1]):
        picture[mask] = values[:, light]
        seen = picture[inner]
        dark = seen <= np.median(seen, axis=0)
        rest = np.abs(np.stack([convolve(picture[..., c], DIFFERENCE)[inner] for c in range(3)], axis=-1))
        found.append(float(np.median(rest[dark])))
    return 1.4826 / 6.0 * float(np.median(found))
