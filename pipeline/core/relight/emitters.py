"""Lights as points and directions that shine: near, distant, areas, spots and lines.

Whatever a light is, a picture under it is the sum of pictures under its emitters; their number is the light's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rig import GOLDEN_ANGLE, sphere
from .profiles import Profile, across


@dataclass(frozen=True)
class Emitter:
    """A point or a direction that shines.

    Parameters
    ----------
    place : (3,) float64
        Position in the world [m], or the unit direction to it where ``distant``.
    intensity : (3,) float64
        Near: radiant intensity [W/sr] where the profile is 1. Distant: irradiance of a surface that faces it [W/m^2].
    distant : bool
    facing : (3,) float64, optional
        Unit normal n of the surface element that it stands for: what it sends along w is times max(0, n.w).
    to_world : (3, 3) float64, optional
        Columns are the emitter's axes in the world, unit and at right angles; it shines along its z.
    profile : callable, optional
        Intensity over ``intensity``, (P,) or per colour (P, 3), in unit directions (P, 3) of the emitter's axes;
        1 everywhere if left out.
    """

    place: NDArray[np.float64]
    intensity: NDArray[np.float64]
    distant: bool = False
    facing: NDArray[np.float64] | None = None
    to_world: NDArray[np.float64] | None = None
    profile: Profile | None = None

    def irradiance(self, points: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the irradiance E (P, 3) [W/m^2] of surfaces at points (P, 3) that face the emitter, unshadowed."""
        if self.distant:
            return np.broadcast_to(self.intensity.astype(np.float32), points.shape)
        away = points - self.place
        d2 = (away**2).sum(axis=1)
        directions = away / np.sqrt(d2)[:, None]
        sent = self.intensity / d2[:, None]
        if self.facing is not None:
            sent *= np.maximum(directions @ self.facing, 0.0)[:, None]
        if self.profile is not None and self.to_world is not None:
            sent *= self.profile(directions @ self.to_world).reshape(len(points), -1)
        return np.asarray(sent, np.float32)


def point(position: Sequence[float], intensity: Sequence[float]) -> Emitter:
    """Return a near point light of radiant intensity (3,) [W/sr]."""
    return Emitter(np.array(position, np.float64), np.array(intensity, np.float64))


def distant(direction: Sequence[float], irradiance: Sequence[float]) -> Emitter:
    """Return a distant light, its direction of any length, of irradiance (3,) [W/m^2]."""
    towards = np.array(direction, np.float64)
    return Emitter(towards / np.linalg.norm(towards), np.array(irradiance, np.float64), distant=True)


def area(
    points: NDArray[np.float64], normals: NDArray[np.float64], areas: NDArray[np.float64], radiance: NDArray[np.float64]
) -> list[Emitter]:
    """Return the emitters of a surface of any shape that shines to its front with one radiance.

    Each element emits I(w) = L dA max(0, n.w); what the surface shadows of itself is not modelled.

    Parameters
    ----------
    points, normals : (N, 3) float64
        Places [m] and unit normals of its elements.
    areas : (N,) float64
        [m^2].
    radiance : (3,) float64
        [W/(m^2 sr)].
    """
    return [
        Emitter(place, radiance * size, facing=normal)
        for place, normal, size in zip(points, normals, areas, strict=True)
    ]


def rectangle(count: int) -> NDArray[np.float64]:
    """Return the centres of count x count equal squares of the unit square about 0, (count^2, 2)."""
    middles = (np.arange(count) + 0.5) / count - 0.5
    return np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)


def disk(count: int) -> NDArray[np.float64]:
    """Return points with equal shares of the disk of diameter 1 about 0, (count, 2): Vogel's spiral (1979)."""
    radius = 0.5 * np.sqrt((np.arange(count) + 0.5) / count)
    angle = GOLDEN_ANGLE * np.arange(count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def ball(position: NDArray[np.float64], radius: float, intensity: NDArray[np.float64], count: int) -> list[Emitter]:
    """Return the emitters of a ball of uniform radiance that shines like a point of some intensity [W/sr].

    I = L pi r^2: the ball's cross-section. Elements emit outwards only, so that half of them shine at a point.
    """
    normals = sphere(count)
    areas = np.full(count, 4 * np.pi * radius**2 / count)
    return area(position + radius * normals, normals, areas, intensity / (np.pi * radius**2))


def line(
    start: NDArray[np.float64], end: NDArray[np.float64], intensity: NDArray[np.float64], count: int
) -> list[Emitter]:
    """Return the emitters of a thin tube between two points, of radiant intensity [W/sr] at right angles to it.

    An element of a thin Lambertian cylinder emits I sin t, t the angle from the tube.
    """
    share = (np.arange(count) + 0.5) / count
    frame = axes_along((end - start) / np.linalg.norm(end - start))
    return [Emitter(start + s * (end - start), intensity / count, to_world=frame, profile=across) for s in share]


def axes_along(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a rotation (3, 3) whose third column is a unit axis."""
    side = np.cross([0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0], axis)
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side), axis], axis=1)
