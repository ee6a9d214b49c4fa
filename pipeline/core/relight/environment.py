"""Environment maps as distant lights: regions of about equal power, each one light (Debevec 2005, median cut).

A map is equirectangular as Blender's: the top row looks along world +z, the middle column along +x, and from left to
right the longitude falls, phi = pi - 2 pi (column + 1/2) / width.
"""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from ..errors import LightsphereError
from .emitters import Emitter

Region = tuple[int, int, int, int]  # top, bottom, left, right
COUNT = 256
WIDEST = 1024  # columns beyond which a map is averaged before it is cut


def emitters_of(radiance: NDArray[np.float32], count: int = COUNT) -> list[Emitter]:
    """Return at most so many distant emitters with the power of an environment map.

    Each region's emitter stands in the direction of its power's centroid and has the irradiance
    E = integral of L over the region's solid angle.

    Parameters
    ----------
    radiance : (H, W, 3) float32
        [W/(m^2 sr)], rows top-down.
    count : int

    Raises
    ------
    LightsphereError
        When a value is negative or not a number, or the map is black.
    """
    if not np.isfinite(radiance).all():
        bad = int((~np.isfinite(radiance).all(axis=-1)).sum())
        raise LightsphereError(f"the environment has {bad} pixels that are not numbers; repair the map")
    if (radiance < 0).any():
        bad = int((radiance < 0).any(axis=-1).sum())
        raise LightsphereError(f"the environment has {bad} pixels with negative light; repair the map")
    if not radiance.any():
        raise LightsphereError("the environment is black; choose another map")
    values = _averaged(radiance.astype(np.float64))
    directions, solid_angles = sky(*values.shape[:2])
    power = values * solid_angles[:, None, None]
    regions = _cut(power.sum(axis=-1), solid_angles, count)
    found = []
    for top, bottom, left, right in regions:
        part = power[top:bottom, left:right]
        if not part.any():
            continue
        towards = np.einsum("hwk,hw->k", directions[top:bottom, left:right], part.sum(axis=-1))
        found.append(Emitter(towards / np.linalg.norm(towards), part.sum(axis=(0, 1)), distant=True))
    return found


def sky(height: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the direction to every pixel of a map, (H, W, 3), and a pixel's solid angle in each row, (H,) [sr]."""
    theta = np.pi * np.arange(height + 1) / height
    middle = (theta[1:] + theta[:-1]) / 2
    phi = np.pi - 2 * np.pi * (np.arange(width) + 0.5) / width
    directions = np.empty((height, width, 3))
    directions[..., 0] = np.sin(middle)[:, None] * np.cos(phi)
    directions[..., 1] = np.sin(middle)[:, None] * np.sin(phi)
    directions[..., 2] = np.cos(middle)[:, None]
    return directions, (np.cos(theta[:-1]) - np.cos(theta[1:])) * 2 * np.pi / width


def _averaged(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the map with whole blocks of pixels averaged to at most WIDEST columns."""
    height, width = values.shape[:2]
    size = max((n for n in range(1, width // WIDEST + 2) if width % n == 0 and height % n == 0), default=1)
    return values.reshape(height // size, size, width // size, size, 3).mean(axis=(1, 3))


def _cut(power: NDArray[np.float64], solid_angles: NDArray[np.float64], count: int) -> list[Region]:
    """Cut the heaviest region in two of equal power until there are so many.

    A region weighs its power times the square root of its solid angle: a dim half of the sky is cut before a sun that
    is nearly a point.
    """
    rows, columns = power.shape
    table = np.zeros((rows + 1, columns + 1))
    table[1:, 1:] = power.cumsum(axis=0).cumsum(axis=1)
    height = np.concatenate([[0.0], np.cumsum(solid_angles)])

    def heap_entry(region: Region) -> tuple[float, Region]:
        top, bottom, left, right = region
        inside = table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left]
        single = bottom - top == 1 and right - left == 1
        return (0.0 if single else -inside * np.sqrt((height[bottom] - height[top]) * (right - left))), region

    regions = [heap_entry((0, rows, 0, columns))]
    while len(regions) < count and regions[0][0] < 0.0:
        for half in _halves(heapq.heappop(regions)[1], table):
            heapq.heappush(regions, heap_entry(half))
    return [region for _, region in regions]


def _halves(region: Region, table: NDArray[np.float64]) -> tuple[Region, Region]:
    """Cut a region across its longer side where half of its power is."""
    top, bottom, left, right = region
    rows = table.shape[0] - 1
    width = (right - left) * np.sin(np.pi * (top + bottom) / (2 * rows))  # rows and columns are of one angle
    if bottom - top > 1 and (bottom - top >= width or right - left == 1):
        sums = table[top : bottom + 1, right] - table[top : bottom + 1, left]
        cut = top + _half(sums)
        return (top, cut, left, right), (cut, bottom, left, right)
    sums = table[bottom, left : right + 1] - table[top, left : right + 1]
    cut = left + _half(sums)
    return (top, bottom, left, cut), (top, bottom, cut, right)


def _half(sums: NDArray[np.float64]) -> int:
    """Return the inner place at which rising sums are nearest to the middle between the first and the last."""
    return 1 + int(np.argmin(np.abs(sums[1:-1] - (sums[0] + sums[-1]) / 2)))
