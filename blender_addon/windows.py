"""Blender's windows: the areas that they show."""

from __future__ import annotations

from collections.abc import Iterator

import bpy


def areas(kind: str) -> Iterator[tuple[bpy.types.Window, bpy.types.Area]]:
    """Yield every area of a kind, such as ``"VIEW_3D"``, with its window."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == kind:
                yield window, area
