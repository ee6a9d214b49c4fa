"""Two mirrors that face each other, a matt floor between them, one photograph.

Why: the picture shows mirrors in mirrors without end; what is wrong of a mirror is wrong to the power of its bounces.
Must: both are found to be mirrors, their reflectance within 5 %, the floor's within 4 %.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np

from pipeline.blender import cycles, exr
from pipeline.blender.camera import camera_of
from pipeline.blender.inverse import groups
from pipeline.blender.inverse.room import Room
from pipeline.blender.inverse.solve import Search
from pipeline.core.inverse import InverseSettings
from pipeline.core.inverse.photograph import prepared
from pipeline.core.progress import finish
from tests.blender import small_scenes
from tests.hard_cases.catalogue import Outcome

SLOW = True
TRUE = {"Left": 0.85, "Right": 0.7, "Floor": 0.4}
WITHIN = {"Left": 0.05, "Right": 0.05, "Floor": 0.04}
WIDTH, HEIGHT, BUDGET = 64, 48, 60.0


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
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    lamp.data.size, lamp.data.energy, lamp.location = 0.6, 60.0, (0.0, 0.0, 2.4)
    scene.collection.objects.link(lamp)
    small_scenes.aim(scene, (0.4, -2.6, 1.6), 1.0)
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    return scene


def run() -> list[Outcome]:
    scene = corridor()
    transport = cycles.Transport(64, samples=1024)
    with (
        cycles.measuring(scene, camera_of(scene, WIDTH, HEIGHT), transport, seed=77),
        cycles.changed(scene.cycles, {"filter_width": 1.5, "min_light_bounces": 8}),
        cycles.openexr(scene),
        tempfile.TemporaryDirectory() as folder,
    ):
        cycles.render(scene, Path(folder) / "photograph.exr")
        picture = exr.read_rgb(Path(folder) / "photograph.exr")
    settings = InverseSettings(resolution=WIDTH, budget=BUDGET)
    seen = prepared(picture, 32, "linear", (WIDTH, HEIGHT), WIDTH)
    room = Room(scene, groups.find(scene, settings.groups), seen)
    found = finish(Search(room, seen, settings).run())
    outcomes = []
    for group, model in zip(room.groups, found.models, strict=True):
        value = model.diffuse if group.name == "Floor" else model.specular
        error = float(np.abs(value / TRUE[group.name] - 1).max())
        told = f"found {value.mean():.3f}, {model.level}"
        outcomes.append(
            Outcome(f"{group.name.lower()}, {TRUE[group.name]:g}", error, WITHIN[group.name], "reflectance", told)
        )
    return outcomes
