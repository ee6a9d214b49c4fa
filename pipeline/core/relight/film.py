"""The source's moving light: it comes from infinity, turns about the object by 90 degrees and leaves.

Magda et al. 2001 show it as the test that separates relighting in a light field from relighting by distant light.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from .emitters import Emitter, distant, point

TURN = 90.0  # degrees
NEAREST = 1.6  # closest distance, in radii of the object
BESIDE = 45.0  # degrees to the left of the camera at which it comes, and to the right at which it leaves
RISE = 30.0  # degrees above the camera's horizon


def moving_light(camera: Camera, points: NDArray[np.float64], frames: int) -> list[Emitter]:
    """Return one light per frame, each of irradiance pi at the object's middle.

    In thirds: 1/distance rises from 0 to its largest as the light comes, stays while it turns about the vertical of
    the picture, and falls to 0.

    Parameters
    ----------
    camera : Camera
    points : (P, 3) float64
        Surface of the object [m].
    frames : int
        At least 3.
    """
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = float(np.linalg.norm(points - centre, axis=1).max())
    right, up, to_viewer = camera.to_world[:3, :3].T
    found = []
    for time in np.linspace(0.0, 3.0, frames):
        angle = np.radians(TURN * np.clip(time - 1.0, 0.0, 1.0) - BESIDE)
        nearness = min(time, 1.0, 3.0 - time) / (NEAREST * radius)
        level = np.sin(angle) * right + np.cos(angle) * to_viewer
        direction = np.cos(np.radians(RISE)) * level + np.sin(np.radians(RISE)) * up
        if nearness <= 0.0:
            found.append(distant(list(direction), [np.pi] * 3))
        else:
            place = centre + direction / nearness
            found.append(point(list(place), [np.pi / nearness**2] * 3))
    return found
