"""A comparison in the Image Editor: what was captured and what the asset renders, split, or beside each other."""

from __future__ import annotations

import contextlib
import functools
import json
from pathlib import Path
from typing import Any

import bpy

from ..pipeline.blender import pixels
from ..pipeline.core import images
from ..pipeline.core.errors import BROKEN_JSON, LightsphereError
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
    """Return the relative RMSE of each kind of pictures in a comparison, none where there is no comparison."""
    return {name: one["relight_rel_rmse"] for name, one in _figures(folder).items()}


def errors_of_bases(scene: bpy.types.Scene) -> dict[str, float]:
    """Return the relative RMSE of the chosen pictures where the asset shows most of each basis; none for one."""
    figures = _figures(_folder(scene))
    return dict(figures[scene.lightsphere.view_kind]["bases"]) if scene.lightsphere.view_kind in figures else {}


def _figures(folder: Path) -> dict[str, dict[str, Any]]:
    path = folder / FIGURES
    return _read(path, path.stat().st_mtime_ns) if path.is_file() else {}


@functools.lru_cache(maxsize=16)
def _read(path: Path, written: int) -> dict[str, dict[str, Any]]:
    """Return the figures of known age of every kind of pictures: panels ask with every redraw."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))["comparisons"]
        return {name: {"bases": {}, **one, "relight_rel_rmse": one["relight_rel_rmse"]} for name, one in found.items()}
    except BROKEN_JSON:  # damaged, so there is none
        return {}


def kinds(scene: bpy.types.Scene) -> list[str]:
    """Return the kinds of pictures in the scene's comparison, none where there is no comparison."""
    return list(errors(_folder(scene)))


def show(scene: bpy.types.Scene) -> None:
    """Draw the chosen pictures of the scene's comparison, and show them where an Image Editor is open.

    A kind that an earlier comparison had, and this one has not, is the first one's.

    Raises
    ------
    LightsphereError
        When the scene's comparison is not there, or its pictures are missing or damaged.
    """
    shown, there = scene.lightsphere, kinds(scene)
    if not there:
        raise LightsphereError("no comparison is there; compare with the capture first")
    kind = shown.view_kind if shown.view_kind in there else there[0]
    pairs = sorted((_folder(scene) / "pictures").glob(f"{kind}_[0-9]*_reference.exr"))
    if not pairs:
        raise LightsphereError(f"{_folder(scene)} has lost its pictures; compare with the capture again")
    path = pairs[min(shown.view_light, len(pairs)) - 1]
    reference, picture = images.read_rgb(path), images.read_rgb(path.with_name(path.name.replace("_reference", "")))
    if shown.view == "split":
        drawn = beside.split(picture, reference, shown.view_split)
    elif shown.view == "side":
        drawn = beside.side_by_side(picture, reference)
    else:
        drawn = beside.difference(picture, reference)
    results.show_image(pixels.screen_image(IMAGE, drawn))


def items(_: bpy.types.PropertyGroup, context: bpy.types.Context) -> list[tuple[str, str, str]]:
    """Return the kinds of pictures for a menu."""
    _items[:] = [(kind, kind.replace("_", " ").title(), "") for kind in kinds(context.scene)]
    return _items


def refresh(_: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Draw anew after a choice was changed."""
    with contextlib.suppress(LightsphereError):  # the button beside the choices says it
        show(context.scene)


def _folder(scene: bpy.types.Scene) -> Path:
    return Path(bpy.path.abspath(scene.lightsphere.comparison_folder))
