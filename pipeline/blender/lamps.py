"""One Blender light that takes the place of each light of a capture in turn."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import bpy
import numpy as np
from mathutils import Vector

from ..core.lights import Lights


@contextlib.contextmanager
def lamp(scene: bpy.types.Scene, kind: str) -> Iterator[bpy.types.Object]:
    """Add a light without extent for a while: a point for ``"near"`` lights, a sun for ``"distant"`` ones."""
    data = bpy.data.lights.new("Lightsphere", "SUN" if kind == "distant" else "POINT")
    if kind == "distant":
        data.angle = 0.0
    else:
        data.shadow_soft_size = 0.0
    item = bpy.data.objects.new("Lightsphere", data)
    scene.collection.objects.link(item)
    try:
        yield item
    finally:
        bpy.data.objects.remove(item)
        bpy.data.lights.remove(data)


def shine(item: bpy.types.Object, lights: Lights, index: int) -> None:
    """Let the lamp stand for one light.

    A point light of W watts has the radiant intensity I = W / (4 pi) [W/sr]; a sun's strength is its irradiance E.
    """
    strength = lights.intensity[index].max()
    item.data.color = lights.intensity[index] / strength
    if lights.kind == "distant":
        item.data.energy = strength
        item.rotation_euler = Vector(lights.position[index]).to_track_quat("Z", "Y").to_euler()
    else:
        item.data.energy = 4 * np.pi * strength
        item.location = lights.position[index]
