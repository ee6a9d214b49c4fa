"""A Blender camera as the data model's."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.camera import Camera
from ..core.errors import LightsphereError


def camera_of(scene: bpy.types.Scene, resolution: int) -> Camera:
    """Return the scene's camera for square pictures; raise LightsphereError when there is none of a known kind."""
    if scene.camera is None:
        raise LightsphereError(f"the scene {scene.name!r} has no camera; add one that sees the object")
    data = scene.camera.data
    matrix = np.array(scene.camera.matrix_world.normalized(), np.float64)
    centre = ((0.5 - data.shift_x) * resolution, (0.5 + data.shift_y) * resolution)
    if data.type == "PERSP":
        sensor = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
        focal = resolution * data.lens / sensor
        return Camera("pinhole", matrix, (resolution, resolution), (focal, focal), centre)
    if data.type == "ORTHO":
        scale = resolution / data.ortho_scale
        return Camera("orthographic", matrix, (resolution, resolution), (scale, scale), centre)
    raise LightsphereError(f"the camera {scene.camera.name!r} is a {data.type}; use a perspective or orthographic one")
