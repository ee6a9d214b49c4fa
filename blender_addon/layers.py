"""What the recovered mesh shows in the viewport: itself, or what is known of its pixels."""

from __future__ import annotations

import bpy
from bpy_extras import view3d_utils

from ..pipeline.blender import overlays
from . import windows

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
                item.hide_set(False)
                overlays.show(item, layer)
    for _, area in windows.areas("VIEW_3D"):
        shade(area, layer == PLAIN)


def shade(area: bpy.types.Area, plain: bool) -> None:
    """Shade a viewport flat, or as it was before."""
    shading = area.spaces.active.shading
    place = area.as_pointer()
    if not plain:
        _before.setdefault(place, {name: getattr(shading, name) for name in ("light", "color_type", "type")})
    for name, value in (_before.pop(place, {}) if plain else FLAT).items():
        setattr(shading, name, value)


def pixel_at(context: bpy.types.Context, x: float, y: float) -> tuple[int, int] | None:
    """Return row and column of the picture's pixel that a recovered mesh shows at a place of a viewport [px].

    None where no recovered mesh is there.
    """
    region, view = context.region, context.region_data
    origin = view3d_utils.region_2d_to_origin_3d(region, view, (x, y))
    direction = view3d_utils.region_2d_to_vector_3d(region, view, (x, y))
    for item in context.scene.objects:
        if item.get(overlays.MARK) and item.visible_get():
            to_local = item.matrix_world.inverted()
            hit, _, _, polygon = item.ray_cast(to_local @ origin, to_local.to_3x3() @ direction)
            if hit:
                return overlays.pixel_of(item, polygon)
    return None


def shown(scene: bpy.types.Scene) -> bool:
    """Return whether the scene has a mesh whose layers can be shown."""
    return any(item.get(overlays.MARK) for item in scene.objects)
