"""Open a built-in scene or a user's own .blend."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import bpy

from ..core.errors import LightsphereError
from .output import caught_output


def library() -> dict[str, Any]:
    """Return the built-in scenes by name."""
    scenes: dict[str, Any] = part("library").SCENES
    return scenes


def part(name: str) -> Any:
    """Return a module of the scenes' package, which lives beside this one, whatever it is called."""
    return importlib.import_module(f"{__package__.removesuffix('pipeline.blender')}scenes.{name}")


def empty() -> bpy.types.Scene:
    """Return a scene of nothing, in place of what is open."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.world = None
    return scene


def load(name: str) -> bpy.types.Scene:
    """Load a built-in scene by name or a .blend by path into this Blender, replacing what is open."""
    scenes = library()
    if name in scenes:
        scene = empty()
        scenes[name].build(scene)
        return scene
    path = Path(name)
    if path.suffix != ".blend":
        raise LightsphereError(f"there is no scene {name!r}; give a .blend file or one of {', '.join(scenes)}")
    if not path.is_file():
        raise LightsphereError(f"{path} does not exist; give a .blend file or one of {', '.join(scenes)}")
    try:
        with caught_output():
            bpy.ops.wm.open_mainfile(filepath=str(path.resolve()), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise LightsphereError(f"{path} cannot be opened ({reason}); save it again with this Blender") from error
    return bpy.context.scene


def save(path: Path) -> None:
    """Save a copy of what is open in this Blender; raise LightsphereError when it cannot be written."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with caught_output():
            bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), copy=True, compress=True)
    except RuntimeError as error:
        raise LightsphereError(f"{path} cannot be written ({error}); free space or choose another folder") from error
