"""What the recovered mesh shows in the viewport: itself, or what is known of its pixels."""

from __future__ import annotations

import bpy

from ..pipeline.blender import overlays

PLAIN = "plain"
ITEMS = (
    (PLAIN, "Plain", "The mesh as it is"),
    ("confidence", "Confidence", "How sure each depth is: yellow sure, blue a guess"),
    ("expected_error", "Expected Error", "How far off each depth is expected to be: yellow little, blue much"),
    ("depth", "Depth", "Distance from the camera: blue near, yellow far"),
    ("normal", "Normals", "Direction of the surface, as the camera sees it: red right, green up, blue towards it"),
)
FLAT = {"type": "SOLID", "light": "FLAT", "color_type": "VERTEX"}  # shading that shows a colour as it is

_before: dict[int, dict[str, str]] = {}  # of every viewport: its shading before a layer was shown


def show(scene: bpy.types.Scene) -> None:
    """Let the scene's recovered meshes show the chosen layer, and the viewports show it as it is."""
    layer = scene.lightsphere.layer
    if layer != PLAIN:
        for item in scene.objects:
            if item.get(overlays.MARK):
                overlays.show(item, layer)
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                shade(area, layer == PLAIN)


def shade(area: bpy.types.Area, plain: bool) -> None:
    """Shade a viewport flat, or as it was before."""
    shading = area.spaces.active.shading
    place = area.as_pointer()
    if not plain:
        _before.setdefault(place, {name: getattr(shading, name) for name in ("light", "color_type", "type")})
    for name, value in (_before.pop(place, {}) if plain else FLAT).items():
        setattr(shading, name, value)


def shown(scene: bpy.types.Scene) -> bool:
    """Return whether the scene has a mesh whose layers can be shown."""
    return any(item.get(overlays.MARK) for item in scene.objects)
