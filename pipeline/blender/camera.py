"""A Blender camera as the data model's."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from ..core.camera import Camera
from ..core.errors import LightsphereError


def camera_of(scene: bpy.types.Scene, width: int, height: int | None = None) -> Camera:
    """Return the scene's camera for pictures of a size, square ones where the height is left out.

    Raises
    ------
    LightsphereError
        When there is no camera of a known kind.
    """
    if scene.camera is None:
        raise LightsphereError(f"the scene {scene.name!r} has no camera; add one that sees the object")
    height = width if height is None else height
    data = scene.camera.data
    matrix = np.array(scene.camera.matrix_world.normalized(), np.float64)
    upright = data.sensor_fit == "VERTICAL" or (data.sensor_fit == "AUTO" and height > width)
    span = height if upright else width  # what sensor, shift and scale are of
    centre = (width / 2 - data.shift_x * span, height / 2 + data.shift_y * span)
    if data.type == "PERSP":
        sensor = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
        focal = span * data.lens / sensor
        return Camera("pinhole", matrix, (width, height), (focal, focal), centre)
    if data.type == "ORTHO":
        scale = span / data.ortho_scale
        return Camera("orthographic", matrix, (width, height), (scale, scale), centre)
    raise LightsphereError(f"the camera {scene.camera.name!r} is a {data.type}; use a perspective or orthographic one")


def add_camera(scene: bpy.types.Scene, camera: Camera, name: str = "Camera") -> bpy.types.Object:
    """Add a camera to a scene that sees what the data model's does, and make it the scene's.

    The inverse of :func:`camera_of`, for pictures of any size; a pixel that is not square becomes the
    scene's pixel aspect.
    """
    width, height = camera.resolution
    data = bpy.data.cameras.new(name)
    data.sensor_fit = "HORIZONTAL"
    if camera.model == "pinhole":
        data.lens = camera.focal[0] * data.sensor_width / width
    else:
        data.type = "ORTHO"
        data.ortho_scale = width / camera.focal[0]
    data.shift_x = 0.5 - camera.centre[0] / width
    data.shift_y = (camera.centre[1] - height / 2) * (camera.focal[0] / camera.focal[1]) / width
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = pixel_aspect(camera)
    made = bpy.data.objects.new(name, data)
    made.matrix_world = Matrix(camera.to_world.tolist())
    scene.collection.objects.link(made)
    scene.camera = made
    return made


def pixel_aspect(camera: Camera) -> tuple[float, float]:
    """Return the sides of a pixel as a Blender scene has them, the shorter one 1."""
    aspect = camera.focal[0] / camera.focal[1]
    return (1.0, aspect) if aspect >= 1 else (1 / aspect, 1.0)
