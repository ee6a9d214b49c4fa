"""A Blender camera as the data model's."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

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
