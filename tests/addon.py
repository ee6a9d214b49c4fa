"""The add-on as Blender loaded it."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import bpy

MODULE = "bl_ext.user_default.lightsphere"


def part(name: str) -> Any:
    """Return a module of it."""
    return importlib.import_module(f"{MODULE}.blender_addon.{name}")


def ball_before_camera(path: Path) -> bpy.types.Scene:
    """Make a file with a sphere before a camera, saved, and settings for a small capture."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=1.0)
    bpy.ops.object.camera_add(location=(0, -5, 0), rotation=(1.5707963, 0, 0))
    scene.camera = bpy.context.object
    for name, value in {"inner": 40, "outer": 20, "resolution": 24, "effects": "direct", "workers": 1}.items():
        setattr(scene.lightsphere.capture, name, value)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return scene
