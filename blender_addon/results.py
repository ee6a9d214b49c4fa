"""How results arrive in the artist's file: as new objects and images, never in place of what is there."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path

import bpy

from ..pipeline.blender import capture, meshes, rig
from ..pipeline.core.capture import Capture
from ..pipeline.core.capture_settings import CaptureSettings
from ..pipeline.core.errors import LightsphereError
from ..pipeline.core.shape.ply import read_ply

ASSET = "asset.blend"
OWN_RIG = "scene"  # the rig setting that stands for the scene's rig object


def rigs(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the scene's rig objects."""
    return [item for item in scene.objects if item.get(rig.MARK)]


def add_rig(scene: bpy.types.Scene, settings: CaptureSettings) -> bpy.types.Object:
    """Add the lights that the settings ask for as an object; raise LightsphereError where they cannot stand."""
    if settings.rig == OWN_RIG:
        settings = dataclasses.replace(settings, rig=CaptureSettings.rig)
    lights = capture.describe(scene, scene.name, Path(), settings).lights
    if lights.kind != "near":
        raise LightsphereError("distant lights stand nowhere, so they make no rig object; capture with them directly")
    return rig.add(scene, lights)


def finished(folder: Path) -> bool:
    """Return whether a folder holds a capture with all its pictures."""
    path = folder / "capture.json"
    return path.is_file() and _complete(folder, path.stat().st_mtime_ns)


@functools.lru_cache(maxsize=16)
def _complete(folder: Path, written: int) -> bool:
    """Return the same for a description of known age: panels ask with every redraw."""
    try:
        return all(Capture.open(folder).checksums)
    except LightsphereError:  # damaged, so not finished
        return False


def pictures(folder: Path) -> int:
    """Open a capture's pictures as one image sequence, a frame for every light; return their number."""
    files = Capture.open(folder).files
    image = bpy.data.images.load(str(folder / files[0]))
    image.name = folder.name
    image.source = "SEQUENCE"
    return len(files)


def mesh(scene: bpy.types.Scene, folder: Path) -> bpy.types.Object:
    """Add a recovered mesh to the scene, and its layers (depth, normal, confidence) as an image."""
    layers = bpy.data.images.load(str(folder / "shape.exr"))
    layers.name = f"{folder.name} layers"
    return meshes.add_mesh(scene, folder.name, read_ply(folder / "mesh.ply"), None)


def asset(scene: bpy.types.Scene, path: Path) -> bpy.types.Object:
    """Append the recovered object of an asset, with its material, to the scene; its camera and light stay behind."""
    with bpy.data.libraries.load(str(path), link=False) as (there, here):
        here.objects = there.objects
    recovered, others = [], []
    for item in here.objects:
        (recovered if item.type == "MESH" else others).append(item)
    bpy.data.batch_remove(others)
    for item in recovered:
        scene.collection.objects.link(item)
    return recovered[0]
