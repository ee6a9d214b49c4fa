"""Lights that a capture did not have, to judge by."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..lights import Lights

WIDEST = 70.0  # from the view [degrees]: lights further back show little of what the camera sees


def captured_lights(lights: Lights, camera: Camera, count: int) -> NDArray[np.int64]:
    """Return the indices of at most so many captured lights, evenly out of those on the camera's side."""
    _, towards = _about(lights, camera)
    front = np.flatnonzero(towards >= min(np.cos(np.radians(WIDEST)), towards.max()))
    return np.unique(front[np.linspace(0, len(front) - 1, count).round().astype(int)])


def new_lights(lights: Lights, camera: Camera, count: int) -> Lights:
    """Return lights on the camera's side that fill the cone of the captured ones, none where one of them was.

    Near lights stand midway between the two surfaces, or on the one that there is; their directions are a spiral of
    equal areas about the view. Strengths are the mean of the captured ones.

    Parameters
    ----------
    lights : Lights
        L near or distant ones.
    camera : Camera
        What looks at the object.
    count : int
    """
    reach, towards = _about(lights, camera)
    lowest = max(np.cos(np.radians(WIDEST)), float(towards.min()))
    position = _spiral(count, lowest) @ camera.to_world[:3, :3].T
    if lights.kind == "near":
        surfaces = [reach[lights.surface == surface].mean() for surface in np.unique(lights.surface)]
        position = lights.position.mean(axis=0) + np.mean(surfaces) * position
    intensity = np.tile(lights.intensity.mean(axis=0), (count, 1))
    return Lights(lights.kind, position, intensity, np.full(count, 2))


def _about(lights: Lights, camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far lights are from their middle, and the cosine between their direction and that of the camera."""
    centre = lights.position.mean(axis=0) if lights.kind == "near" else np.zeros(3)
    reach = np.linalg.norm(lights.position - centre, axis=1)
    return reach, (lights.position - centre) @ camera.to_world[:3, 2] / np.maximum(reach, 1e-30)


def _spiral(count: int, lowest: float) -> NDArray[np.float64]:
    """Return directions (N, 3) whose z is above the lowest, each for an equal area of the sphere."""
    z = 1 - (np.arange(count) + 0.5) / count * (1 - lowest)
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    return np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=-1)
