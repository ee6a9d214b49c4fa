"""Render an OLAT capture with Cycles: truth, then one picture per light, each written atomically."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..core import images
from ..core.capture import Capture
from ..core.lights import Lights
from ..core.progress import Progress, Work
from ..core.rig import CaptureSettings, double_sphere
from . import cycles, exr_header, truth
from .camera import camera_of

FAR = (1e4, 1e4, 1e4)
TINY = 1e-6


def capture(scene: bpy.types.Scene, name: str, folder: Path, settings: CaptureSettings) -> Work[Capture]:
    """Capture a scene into a folder.

    Yields
    ------
    Progress per picture.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scene.view_layers[0].update()
    camera = camera_of(scene, settings.resolution)
    lights = double_sphere(settings)
    files = tuple(f"light_{i:04d}.exr" for i in range(len(lights)))
    notes: dict[str, Any] = {"scene": name, "effects": settings.effects, "diameter": truth.diameter(scene)}
    effects, samples = settings.effects, settings.samples
    with (
        cycles.quiet(),
        cycles.measuring(scene, settings.resolution, effects, samples, settings.seed),
        own_lights_hidden(scene),
        meshes_cached(scene),
        point_light(scene) as lamp,
    ):
        truth.write(scene, camera, folder)
        checksums = []
        for i, file in enumerate(files):
            checksums.append(picture(scene, lamp, lights, i, folder / file))
            yield Progress("render", i + 1, len(files), "pictures")
    done = Capture(folder, camera, lights, files, tuple(checksums), notes)
    done.save()
    return done


def picture(scene: bpy.types.Scene, lamp: bpy.types.Object, lights: Lights, index: int, path: Path) -> str:
    """Render the picture under one light atomically and return its SHA-256."""
    lamp.location = lights.position[index]
    strength = lights.intensity[index].max()
    lamp.data.energy = 4 * np.pi * strength
    lamp.data.color = lights.intensity[index] / strength
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    cycles.render(scene, str(partial))
    exr_header.remove_times(partial)
    digest = images.checksum(partial)
    partial.replace(path)
    return digest


@contextlib.contextmanager
def point_light(scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    """Add a point light of radius 0 for a while: W watts make a radiant intensity of W / (4 pi) [W/sr]."""
    data = bpy.data.lights.new("Lightsphere", "POINT")
    data.shadow_soft_size = 0.0
    lamp = bpy.data.objects.new("Lightsphere", data)
    scene.collection.objects.link(lamp)
    try:
        yield lamp
    finally:
        bpy.data.objects.remove(lamp)
        bpy.data.lights.remove(data)


@contextlib.contextmanager
def own_lights_hidden(scene: bpy.types.Scene) -> Iterator[None]:
    """Hide the scene's own lights from renders for a while."""
    with contextlib.ExitStack() as stack:
        for item in scene.objects:
            if item.type == "LIGHT":
                stack.enter_context(cycles.changed(item, {"hide_render": True}))
        yield


@contextlib.contextmanager
def meshes_cached(scene: bpy.types.Scene) -> Iterator[None]:
    """Give every mesh a second user for a while, out of every ray's sight.

    Cycles bakes a mesh with one user into the scene's ray tree, which any change of a light then builds anew:
    25 ms a picture for 65,000 triangles. A mesh with two users keeps a tree of its own.
    """
    copies = []
    for item in truth.visible_meshes(scene):
        copy = item.copy()
        copy.parent = None
        copy.matrix_world = ((TINY, 0, 0, FAR[0]), (0, TINY, 0, FAR[1]), (0, 0, TINY, FAR[2]), (0, 0, 0, 1))
        for ray in ("camera", "diffuse", "glossy", "transmission", "shadow"):
            setattr(copy, f"visible_{ray}", False)
        scene.collection.objects.link(copy)
        copies.append(copy)
    try:
        yield
    finally:
        for copy in copies:
            bpy.data.objects.remove(copy)
