"""How results arrive in the artist's file: as new objects and images, never in place of what is there."""

from __future__ import annotations

import dataclasses
import functools
import json
from pathlib import Path

import bpy

from ..pipeline.blender import asset as asset_files
from ..pipeline.blender import capture, meshes, rig
from ..pipeline.core.capture import Capture
from ..pipeline.core.capture_settings import CaptureSettings
from ..pipeline.core.errors import LightsphereError
from ..pipeline.core.shape.ply import read_ply

ASSET = "asset.blend"
FIGURES = "comparison.json"
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


def assets(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the objects of the scene that are an asset's."""
    return [item for item in scene.objects if asset_files.MARK in item]


def errors(folder: Path) -> dict[str, float]:
    """Return the relative RMSE of each kind of pictures in a comparison."""
    figures = json.loads((folder / FIGURES).read_text(encoding="utf-8"))
    return {name: one["relight_rel_rmse"] for name, one in figures["comparisons"].items()}


def error_maps(folder: Path) -> list[bpy.types.Image]:
    """Open the error maps of a comparison as images of this file; an Image Editor that is empty shows the first."""
    maps = []
    for path in sorted(folder.glob("*_error.png")):
        maps.append(bpy.data.images.load(str(path)))
        maps[-1].name = f"{folder.name} {path.stem}"
        maps[-1].pack()
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR" and area.spaces.active.image is None:
                area.spaces.active.image = maps[0]
    return maps


def asset(scene: bpy.types.Scene, path: Path) -> bpy.types.Object:
    """Append the recovered object of an asset, with its material, to the scene; its camera and light stay behind."""
    return asset_files.append(scene, path)[0]
