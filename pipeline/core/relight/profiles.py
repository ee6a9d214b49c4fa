"""How much a light sends in a direction of its own axes, relative to its intensity: tubes, spots, grids, tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

Profile = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def across(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the profile of an element of a thin Lambertian tube along z, sin."""
    return np.sqrt(np.maximum(1.0 - directions[:, 2] ** 2, 0.0))


@dataclass(frozen=True)
class SpotProfile:
    """The cone of Blender's spot lights.

    ``smoothstep((cos t - cos(angle / 2)) / (blend (1 - cos(angle / 2))))``, t the angle from the axis after the
    cone's cross-section was stretched.

    Parameters
    ----------
    angle : float
        Full angle of the cone [rad].
    blend : float
        Share of the cone that is soft, 0 to 1.
    stretch : (float, float)
        Widths of the cone along the emitter's x and y, relative to that along its z.
    """

    angle: float
    blend: float
    stretch: tuple[float, float] = (1.0, 1.0)

    def __call__(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the relative intensity of unit directions (P, 3)."""
        local = directions / np.array([*self.stretch, 1.0])
        cosines = local[:, 2] / np.linalg.norm(local, axis=1)
        edge = np.cos(self.angle / 2)
        t = np.clip((cosines - edge) / max((1 - edge) * self.blend, 1e-6), 0.0, 1.0)
        return np.asarray(t * t * (3 - 2 * t))


@dataclass(frozen=True)
class SpreadProfile:
    """The grid before an area light of Blender, ``max(0, tan(s / 2) - tan t) / (tan(s / 2) - s / 2)``.

    t is the angle from its normal. The openings of a grid of slats let through less the more slanted the light is,
    and nothing beyond half the spread; the power that leaves is the same.

    Parameters
    ----------
    spread : float
        Full angle s [rad], below pi.
    """

    spread: float

    def __call__(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the relative radiance of unit directions (P, 3)."""
        slant = np.hypot(directions[:, 0], directions[:, 1]) / np.maximum(directions[:, 2], 1e-12)
        half = self.spread / 2
        return np.asarray(np.maximum(np.tan(half) - slant, 0.0) / (np.tan(half) - half))


@dataclass(frozen=True)
class TableProfile:
    """What was measured of a light: an equirectangular picture about it, as :func:`.environment.sky` lays it out.

    Parameters
    ----------
    values : (H, W, 3) float64
        Radiant intensity [W/sr] in the emitter's axes.
    """

    values: NDArray[np.float64]

    def __call__(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the intensity (P, 3) in unit directions (P, 3), linear between pixels."""
        height, width = self.values.shape[:2]
        row = np.arccos(np.clip(directions[:, 2], -1.0, 1.0)) * height / np.pi - 0.5
        column = (np.pi - np.arctan2(directions[:, 1], directions[:, 0])) * width / (2 * np.pi) - 0.5
        ring = np.pad(self.values, ((0, 0), (1, 1), (0, 0)), mode="wrap")
        where = np.stack([row, column + 1])
        channels = [map_coordinates(ring[..., k], where, order=1, mode="nearest") for k in range(3)]
        return np.stack(channels, axis=-1)
