"""How results arrive in the artist's file: as new objects and images, never in place of what is there."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
from pathlib import Path

import bpy

from ..pipeline.blender import asset as asset_files
from ..pipeline.blender import capture, meshes, overlays, rig
from ..pipeline.core import reflectance
from ..pipeline.core.capture import Capture
from ..pipeline.core.capture_settings import CaptureSettings
from ..pipeline.core.errors import LightsphereError
from ..pipeline.core.shape import Shape
from ..pipeline.core.shape.ply import read_ply
from . import settings, windows

ASSET = "asset.blend"
OWN_RIG = "scene"  # the rig setting that stands for the scene's rig object


def rigs(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the scene's rig objects."""
    return [item for item in scene.objects if item.get(rig.MARK)]


def add_rig(scene: bpy.types.Scene, chosen: CaptureSettings) -> bpy.types.Object:
    """Add the lights that the settings ask for as an object; raise LightsphereError where they cannot stand."""
    if chosen.rig == OWN_RIG:
        chosen = dataclasses.replace(chosen, rig=CaptureSettings.rig)
    lights = capture.describe(scene, scene.name, Path(), chosen).lights
    if lights.kind != "near":
        raise LightsphereError("distant lights stand nowhere, so they make no rig object; capture with them directly")
    item = rig.add(scene, lights, chosen)
    for other in bpy.context.selected_objects:
        other.select_set(False)
    item.select_set(True)
    bpy.context.view_layer.objects.active = item
    return item


def follow(shown: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Let the scene's rigs follow the settings; where the surfaces would intersect, they stay."""
    for item in rigs(context.scene):
        with contextlib.suppress(LightsphereError):  # the panel says so
            rig.follow(item, settings.values(shown, CaptureSettings))


def intersect(scene: bpy.types.Scene) -> bool:
    """Return whether the settings' outer sphere is not larger than the inner one."""
    shown = scene.lightsphere.capture
    return bool(shown.radius_inner >= shown.radius_outer)


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
    picture(folder / files[0], folder.name).source = "SEQUENCE"
    return len(files)


def suited_method(folder: Path) -> str:
    """Return the method of shape that a capture's lights suit."""
    lights = Capture.open(folder).lights
    if lights.kind == "unknown":
        return "uncalibrated"
    return "double-sphere" if len(lights.on("inner")) and len(lights.on("outer")) else "acls"


def mesh(scene: bpy.types.Scene, folder: Path) -> bpy.types.Object:
    """Add a recovered mesh to the scene, its layers (depth, normal, confidence) with it and as an image."""
    picture(folder / "shape.exr", f"{folder.name} layers")
    mesh = read_ply(folder / "mesh.ply")
    item = meshes.add_mesh(scene, folder.name, mesh, None)
    overlays.add(item, mesh, Shape.open(folder))
    return item


def picture(path: Path, name: str) -> bpy.types.Image:
    """Open a picture as an image of this file."""
    image = bpy.data.images.load(str(path))
    image.name = name
    return image


def show_image(image: bpy.types.Image) -> None:
    """Show a whole image in every Image Editor that is open."""
    for window, area in windows.areas("IMAGE_EDITOR"):
        area.spaces.active.image = image
        region = next(region for region in area.regions if region.type == "WINDOW")
        with bpy.context.temp_override(window=window, area=area, region=region):
            if bpy.ops.image.view_all.poll():
                bpy.ops.image.view_all(fit_view=True)
        area.tag_redraw()


def shining(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the scene's lights that renders show."""
    return [item for item in scene.objects if item.type == "LIGHT" and not item.hide_render]


def reflectance_error(folder: Path) -> float:
    """Return the relative error of a reflectance on lights held out [%]."""
    notes = json.loads((folder / reflectance.FILE).read_text(encoding="utf-8"))["notes"]
    return 100 * float(notes["material_rel_rms"])


def assets(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the objects of the scene that are an asset's."""
    return [item for item in scene.objects if asset_files.MARK in item]


def error_maps(folder: Path) -> None:
    """Open the error maps of a comparison as images of this file."""
    for path in sorted(folder.glob("*_error.png")):
        picture(path, f"{folder.name} {path.stem}").pack()


def asset(scene: bpy.types.Scene, path: Path) -> bpy.types.Object:
    """Append the recovered object of an asset to the scene, its material marked as one that the asset browser shows.

    Its camera and light stay behind. Recovered meshes, which stand in the same place, are hidden in the viewport.
    """
    for drawn in path.parent.glob(f"{path.stem}_bases.png"):  # not there for one lobe per pixel
        image = picture(drawn, f"{path.parent.name} bases")
        image.pack()
        show_image(image)
    for plain in [item for item in scene.objects if item.get(overlays.MARK)]:
        plain.hide_set(True)
    item = asset_files.append(scene, path)[0]
    for slot in item.material_slots:
        if slot.material is not None:
            slot.material.asset_mark()
            slot.material.asset_data.description = "Recovered by Lightsphere"
            slot.material.asset_data.tags.new("Lightsphere", skip_if_exists=True)
    return item
