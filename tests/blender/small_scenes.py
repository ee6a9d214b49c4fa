"""Scenes small enough for a test, made without the pipeline."""

from __future__ import annotations

import bpy

from pipeline.blender.geometry import BACKDROP
from pipeline.core.lights import Lights


def empty() -> bpy.types.Scene:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return bpy.context.scene


def material(name: str, node_type: str, inputs: dict[str, object], **attributes: object) -> bpy.types.Material:
    """Return a material of one closure."""
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    closure, output = nodes.new(node_type), nodes.new("ShaderNodeOutputMaterial")
    for key, value in attributes.items():
        setattr(closure, key, value)
    for key, value in inputs.items():
        closure.inputs[key].default_value = value
    made.node_tree.links.new(closure.outputs[0], output.inputs[0])
    return made


def diffuse(name: str, albedo: float) -> bpy.types.Material:
    return material(name, "ShaderNodeBsdfDiffuse", {"Color": (albedo, albedo, albedo, 1)})


def ball(node_type: str, inputs: dict[str, object], **attributes: object) -> bpy.types.Scene:
    """Return a scene of one finely tessellated ball of radius 1 m seen from (0, -7, 2)."""
    scene = empty()
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=6, radius=1)
    item = bpy.context.object
    item.data.shade_smooth()
    item.data.materials.append(material("Ball", node_type, inputs, **attributes))
    aim(scene, (0.0, -7.0, 2.0), 0.31)
    return scene


def aim(scene: bpy.types.Scene, place: tuple[float, float, float], angle: float) -> None:
    from mathutils import Vector

    data = bpy.data.cameras.new("Camera")
    data.angle = angle
    camera = bpy.data.objects.new("Camera", data)
    camera.location = place
    camera.rotation_euler = Vector(place).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(camera)
    scene.camera = camera


def area_lamp(scene: bpy.types.Scene, place: tuple[float, float, float], size: float, watts: float) -> None:
    """Add a square lamp that shines down."""
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    lamp.data.size, lamp.data.energy, lamp.location = size, watts, place
    scene.collection.objects.link(lamp)


def lambert(albedo: float) -> bpy.types.Scene:
    return ball("ShaderNodeBsdfDiffuse", {"Color": (albedo, albedo, albedo, 1)})


def ground(scene: bpy.types.Scene, height: float) -> None:
    """Add a dark disk that is not the object, within the light spheres."""
    bpy.ops.mesh.primitive_circle_add(vertices=64, radius=1.6, fill_type="NGON", location=(0, 0, height))
    item = bpy.context.object
    item[BACKDROP] = True
    item.data.materials.append(bpy.data.materials.new("Ground"))


def lights_file(path: object, lights: Lights) -> str:
    """Write lights where `--rig` reads them."""
    import json
    from pathlib import Path

    Path(str(path)).write_text(json.dumps(lights.as_json()))
    return str(path)
