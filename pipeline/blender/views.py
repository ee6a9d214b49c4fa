"""Pictures for people: a scene from a new view, the true object or the recovered one in its place."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ..core.camera import Camera
from ..core.lights import Lights
from ..core.progress import Progress, Work
from ..core.shape import Shape
from . import asset, cycles, devices, exr, olat
from .ball import dress
from .camera import add_camera
from .geometry import hide_object
from .materials import Recovered, surface_material

STUDIO = {
    "filter_width": 1.5,
    "max_bounces": 4,
    "use_denoising": False,
    "use_adaptive_sampling": False,
}


def exchange(scene: bpy.types.Scene, shape: Shape, recovered: Recovered) -> bpy.types.Object:
    """Put the recovered object in the place of the scene's own, which is hidden; its surroundings stay."""
    hide_object(scene)
    added, normals = asset.add_relief(scene, shape, "Recovered")
    dress(added, surface_material("Recovered", recovered, normals))
    return added


def light_studio(scene: bpy.types.Scene, camera: Camera, centre: NDArray[np.float64], extent: float) -> None:
    """Replace the scene's light by the asset's: two area lights that stand as a camera sees them, and a faint sky."""
    for item in scene.objects:
        if item.type == "LIGHT":
            item.hide_render = True
    rotation = camera.to_world[:3, :3]
    for name, direction, size, radiance in asset.STUDIO:
        towards = Vector(rotation @ np.array(direction))
        asset.add_light(scene, name, towards, Vector(centre), extent, size, radiance)
    scene.world = asset.sky()


def picture(scene: bpy.types.Scene, camera: Camera, passes: int, samples: int) -> Work[NDArray[np.float32]]:
    """Render a scene as it is lit from a camera, in passes that are averaged, so that progress can be told.

    Returns
    -------
    (H, W, 3) float32
        Linear radiance.
    """
    add_camera(scene, camera)
    width, height = camera.resolution
    size = {"engine": "CYCLES", "resolution_x": width, "resolution_y": height, "resolution_percentage": 100}
    size |= {"use_file_extension": False, "film_transparent": False, "use_persistent_data": True}
    total = np.zeros((height, width, 3))
    with tempfile.TemporaryDirectory() as folder, cycles.changed(scene.render, size), cycles.openexr(scene):
        path = Path(folder) / "view.exr"
        for number in range(passes):
            with cycles.changed(scene.cycles, STUDIO | devices.cycles_values() | {"samples": samples, "seed": number}):
                cycles.render(scene, path)
            total += exr.read_rgb(path)
            yield Progress("render", number + 1, passes, "passes")
    return (total / passes).astype(np.float32)


def under_lights(
    scene: bpy.types.Scene,
    camera: Camera,
    lights: Lights,
    transport: cycles.Transport = cycles.DIRECT,
    seed: int = 0,
) -> Work[NDArray[np.float32]]:
    """Render a scene under one light at a time as a capture does, (L, H, W, 3)."""
    add_camera(scene, camera)
    pictures = []
    for picture in olat.pictures(scene, camera, transport, lights, range(len(lights)), seed):
        pictures.append(picture)
        yield Progress("render", len(pictures), len(lights), "pictures")
    return np.stack(pictures)
