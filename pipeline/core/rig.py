"""Where the lights stand: evenly spread on an inner and an outer surface, or as measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from . import light_file
from .capture_settings import CaptureSettings
from .errors import LightsphereError
from .lights import Lights

SPHERES = ("double-sphere", "double-hemisphere")  # rigs of two concentric surfaces
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
# The outer lights are the same spiral turned by 1 rad, so that no outer light hides behind an inner one.
TURN = np.array([[1, 0, 0], [0, np.cos(1), -np.sin(1)], [0, np.sin(1), np.cos(1)]])
TURN_ABOUT_Z = TURN[::-1, ::-1]


def lights_for(settings: CaptureSettings, centre: NDArray[np.float64], view: NDArray[np.float64]) -> Lights:
    """Return the lights that the settings ask for.

    Parameters
    ----------
    settings : CaptureSettings
        ``rig`` names a layout or a file of measured lights.
    centre : (3,) float64
        Centre of generated surfaces, world [m].
    view : (3,) float64
        Unit direction from the object to the camera; a distant rig covers the hemisphere about it.

    Raises
    ------
    LightsphereError
        For surfaces that are not nested, an unknown rig, a light file that cannot be used, or lights that coincide.
    """
    if settings.rig in SPHERES:
        lights = double_sphere(settings, centre)
    elif settings.rig == "distant":
        lights = distant(settings.inner, view, settings.power)
    elif Path(settings.rig).is_file():
        lights = light_file.read(Path(settings.rig), centre)
    else:
        raise LightsphereError(
            f"the rig {settings.rig!r} is no layout and no file; give double-sphere, double-hemisphere, distant, "
            "scene or a file of measured lights"
        )
    check_apart(lights)
    return lights


def double_sphere(settings: CaptureSettings, centre: NDArray[np.float64]) -> Lights:
    """Return the lights of two concentric spheres, or of their upper halves.

    Every light has the radiant intensity I = p pi r^2 [W/sr], p the power and r the inner radius: a white Lambertian
    surface that faces it at the inner radius reflects a radiance of p.
    """
    if not settings.radius_inner < settings.radius_outer:
        raise LightsphereError(
            f"radius_inner is {settings.radius_inner} and radius_outer {settings.radius_outer}; "
            "the outer sphere must be the larger one"
        )
    half = settings.rig == "double-hemisphere"
    spread, turn = (hemisphere, TURN_ABOUT_Z) if half else (sphere, TURN)
    inner = settings.radius_inner * spread(settings.inner)
    outer = settings.radius_outer * spread(settings.outer) @ turn.T
    position = np.concatenate([inner, outer]) + centre
    intensity = np.full((len(position), 3), settings.power * np.pi * settings.radius_inner**2)
    return Lights("near", position, intensity, np.repeat([0, 1], [len(inner), len(outer)]))


def distant(count: int, axis: NDArray[np.float64], power: float) -> Lights:
    """Return distant lights over the hemisphere about an axis, each of irradiance pi times the power [W/m^2]."""
    direction = hemisphere(count) @ to_axis(axis).T
    return Lights("distant", direction, np.full((count, 3), power * np.pi), np.full(count, 2))


def sphere(count: int) -> NDArray[np.float64]:
    """Return unit directions (count, 3) spread evenly over the sphere, on a spiral of golden-angle turns.

    Each direction has the same share of the area: z falls evenly (Archimedes).
    """
    return _spiral(1 - (2 * np.arange(count) + 1) / count)


def hemisphere(count: int) -> NDArray[np.float64]:
    """Return unit directions (count, 3) spread evenly over the half sphere about z."""
    return _spiral(1 - (np.arange(count) + 0.5) / count)


def edges(points: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the edges (E, 2) of the triangles that join the points of a star-shaped surface about a centre.

    Points that span no volume have none.
    """
    rays = points - centre
    try:
        hull = ConvexHull(rays / np.linalg.norm(rays, axis=1, keepdims=True))
    except (QhullError, ValueError):  # too few, or all in one plane with the centre
        return np.empty((0, 2), np.int64)
    sides = np.concatenate([hull.simplices[:, [0, 1]], hull.simplices[:, [1, 2]], hull.simplices[:, [2, 0]]])
    return np.unique(np.sort(sides, axis=1), axis=0).astype(np.int64)


def check_apart(lights: Lights) -> None:
    """Raise LightsphereError when two lights coincide, naming them."""
    if len(lights) < 2:
        return
    size = float(np.ptp(lights.position, axis=0).max())
    distance, neighbour = cKDTree(lights.position).query(lights.position, k=2)
    first = int(np.argmin(distance[:, 1]))
    if distance[first, 1] <= 1e-9 * size:
        pair = sorted((first, *map(int, neighbour[first])))
        raise LightsphereError(f"lights {pair[0]} and {pair[-1]} stand in the same place; remove or correct one")


def _spiral(z: NDArray[np.float64]) -> NDArray[np.float64]:
    angle = GOLDEN_ANGLE * np.arange(len(z))
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)


def to_axis(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a rotation that takes z to a unit axis."""
    side = np.cross([0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0], axis)
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side), axis], axis=1)
