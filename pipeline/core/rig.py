"""Where the lights stand: evenly spread points on an inner and an outer surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .lights import Lights
from .settings import setting

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
TURN_OF_OUTER = 1.0


@dataclass(frozen=True)
class CaptureSettings:
    """What `lightsphere capture` can be told."""

    rig: str = setting("double-sphere", "double-sphere, hemisphere, distant, or a file of measured lights")
    inner: int = setting(320, "lights on the inner surface", low=4, high=100_000)
    outer: int = setting(80, "lights on the outer surface", low=4, high=100_000)
    radius_inner: float = setting(2.0, "radius of the inner sphere", unit="m", low=1e-6, high=1e6)
    radius_outer: float = setting(3.0, "radius of the outer sphere", unit="m", low=1e-6, high=1e6)
    resolution: int = setting(100, "width and height of the pictures", unit="px", low=2, high=16_384)
    effects: str = setting("auto", "light transport to simulate", choices=("auto", "direct", "full"))
    samples: int = setting(256, "samples a pixel where light bounces", low=1, high=1_000_000)
    seed: int = setting(0, "seed of the samples", low=0, high=2**31 - 1)
    depth: str = setting("float", "bits of a pixel", choices=("float", "half"))
    workers: int = setting(2, "processes that render", low=1, high=1024)


def fibonacci(count: int) -> NDArray[np.float64]:
    """Return unit directions (count, 3) spread evenly over the sphere along a spiral of golden-angle turns."""
    index = np.arange(count)
    z = 1 - (2 * index + 1) / count
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(GOLDEN_ANGLE * index), radius * np.sin(GOLDEN_ANGLE * index), z], axis=-1)


def double_sphere(settings: CaptureSettings) -> Lights:
    """Return the lights of two concentric spheres about the origin, none behind another.

    Every light has the radiant intensity that makes a white Lambertian surface facing it at the inner
    radius reflect a radiance of 1: I = pi r^2 [W/sr].
    """
    tilt = _rotation_x(TURN_OF_OUTER)
    position = np.concatenate(
        [settings.radius_inner * fibonacci(settings.inner), settings.radius_outer * fibonacci(settings.outer) @ tilt.T]
    )
    surface = np.repeat([0, 1], [settings.inner, settings.outer])
    intensity = np.full((len(position), 3), np.pi * settings.radius_inner**2)
    return Lights("near", position, intensity, surface)


def _rotation_x(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
