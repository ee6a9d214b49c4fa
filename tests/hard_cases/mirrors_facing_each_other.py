"""Two mirrors that face each other, a matt floor between them, one photograph.

Why: the picture shows mirrors in mirrors without end; what is wrong of a mirror is wrong to the power of its bounces.
Must: both are found to be mirrors, their reflectance within 5 %, the floor's within 4 %.
"""

from __future__ import annotations

import bpy
import numpy as np

from tests.blender import small_scenes
from tests.hard_cases.catalogue import Outcome
from tests.hard_cases.closed_white_box import HEIGHT, WIDTH, searched

SLOW = True
TRUE = {"Left": 0.85, "Right": 0.7, "Floor": 0.4}
WITHIN = {"Left": 0.05, "Right": 0.05, "Floor": 0.04}
BUDGET = 60.0  # seconds


def corridor() -> bpy.types.Scene:
    """A floor between two mirrors that stand 2 m apart, a lamp above, seen along them."""
    scene = small_scenes.empty()
    sharp = {"Roughness": 0.0}
    for name, side in (("Left", -1.0), ("Right", 1.0)):
        bpy.ops.mesh.primitive_plane_add(size=4, location=(side, 0, 1), rotation=(0, side * -np.pi / 2, 0))
        value = TRUE[name]
        inputs = {"Color": (value, value, value, 1), **sharp}
        bpy.context.object.data.materials.append(
            small_scenes.material(name, "ShaderNodeBsdfAnisotropic", inputs, distribution="BECKMANN")
        )
    bpy.ops.mesh.primitive_plane_add(size=1.9)
    bpy.context.object.data.materials.append(small_scenes.diffuse("Floor", TRUE["Floor"]))
    small_scenes.area_lamp(scene, (0.0, 0.0, 2.4), 0.6, 60.0)
    small_scenes.aim(scene, (0.4, -2.6, 1.6), 1.0)
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    return scene


def run() -> list[Outcome]:
    room, found = searched(corridor(), BUDGET)
    outcomes = []
    for group, model in zip(room.groups, found.models, strict=True):
        value = model.diffuse if group.name == "Floor" else model.specular
        error = float(np.abs(value / TRUE[group.name] - 1).max())
        told = f"found {value.mean():.3f}, {model.level}"
        outcomes.append(
            Outcome(f"{group.name.lower()}, {TRUE[group.name]:g}", error, WITHIN[group.name], "reflectance", told)
        )
    return outcomes
