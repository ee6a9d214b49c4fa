"""The level that normals leave open: a surface's scale under a pinhole camera, its shift along the view under another.

A change of it is one number, a factor (pinhole) or a length [m], and moves near lights with the surface.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..lights import Lights

Depth = NDArray[Any]


def change(camera: Camera, depth: Depth, other: Depth) -> float:
    """Return the change that brings depths nearest to others of the same rays; none where no ray has both."""
    pinhole = camera.model == "pinhole"
    own = depth.astype(np.float64)
    apart = other / own if pinhole else other - own
    return float(np.nanmedian(apart)) if np.isfinite(apart).any() else float(pinhole)


def depth_at(camera: Camera, depth: Depth, level: float) -> NDArray[np.float64]:
    """Return depths after a change of level."""
    own = depth.astype(np.float64)
    return own * level if camera.model == "pinhole" else own + level


def lights_at(camera: Camera, lights: Lights, level: float) -> Lights:
    """Return the lights under which a surface looks the same after a change of level; distant ones are as they were."""
    if lights.kind != "near":
        return lights
    eye, view = camera.to_world[:3, 3], -camera.to_world[:3, 2]
    if camera.model == "pinhole":
        position, intensity = eye + level * (lights.position - eye), lights.intensity * level**2
        return dataclasses.replace(lights, position=position, intensity=intensity)
    return dataclasses.replace(lights, position=lights.position + level * view)
