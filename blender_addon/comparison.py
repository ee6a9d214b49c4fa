"""A comparison in the Image Editor: what was captured and what the asset renders, split, or beside each other."""

from __future__ import annotations

import json
from pathlib import Path

import bpy

from ..pipeline.blender import pixels
from ..pipeline.core import images
from ..pipeline.core.errors import LightsphereError
from ..pipeline.report import beside
from . import results

FIGURES = "comparison.json"
IMAGE = "Lightsphere Comparison"
VIEWS = (
    ("split", "Split", "The capture to the left of a line that you move, the asset to its right"),
    ("side", "Side by Side", "The capture, and to its right the asset"),
    ("difference", "Difference", "Where they differ, in per cent, with a scale"),
)

_items: list[tuple[str, str, str]] = []  # of the menu: Blender wants them to live on


def errors(folder: Path) -> dict[str, float]:
    """Return the relative RMSE of each kind of pictures in a comparison."""
    figures = json.loads((folder / FIGURES).read_text(encoding="utf-8"))
    return {name: one["relight_rel_rmse"] for name, one in figures["comparisons"].items()}


def kinds(scene: bpy.types.Scene) -> list[str]:
    """Return the kinds of pictures in the scene's comparison, none where there is no comparison."""
    try:
        return list(errors(_folder(scene)))
    except (OSError, ValueError, KeyError, TypeError):  # not there, or damaged
        return []


def show(scene: bpy.types.Scene) -> None:
    """Draw the chosen pictures of the scene's comparison, and show them where an Image Editor is open.

    Raises
    ------
    LightsphereError
        When the scene's comparison is not there.
    """
    shown = scene.lightsphere
    if shown.view_kind not in kinds(scene):
        raise LightsphereError("no comparison is there; compare with the capture first")
    pairs = sorted((_folder(scene) / "pictures").glob(f"{shown.view_kind}_[0-9]*_reference.exr"))
    reference = pairs[min(shown.view_light, len(pairs)) - 1]
    picture, true = images.read_rgb(reference.with_name(reference.name.replace("_reference", ""))), reference
    if shown.view == "split":
        drawn = beside.split(picture, images.read_rgb(true), shown.view_split)
    elif shown.view == "side":
        drawn = beside.side_by_side(picture, images.read_rgb(true))
    else:
        drawn = beside.difference(picture, images.read_rgb(true))
    results.show_image(pixels.screen_image(IMAGE, drawn))


def items(_: bpy.types.PropertyGroup, context: bpy.types.Context) -> list[tuple[str, str, str]]:
    """Return the kinds of pictures for a menu."""
    _items[:] = [(kind, kind.replace("_", " ").title(), "") for kind in kinds(context.scene)]
    return _items


def refresh(_: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Draw anew after a choice was changed."""
    if kinds(context.scene):
        show(context.scene)


def _folder(scene: bpy.types.Scene) -> Path:
    return Path(bpy.path.abspath(scene.lightsphere.comparison_folder))
