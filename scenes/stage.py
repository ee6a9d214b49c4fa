"""What every built-in scene shares: an object made of a mesh, the ground it stands on, a camera that frames it.

Units are metres, z is up. Whatever is not the object carries the custom property ``lightsphere_backdrop``.
"""

from __future__ import annotations

import math

import bpy
from mathutils import Vector

from .surfaces import Mesh

BACKDROP = "lightsphere_backdrop"
GROUND_RADIUS = 1.75
GROUND_ALBEDO = 0.3


def add_object(scene: bpy.types.Scene, name: str, mesh: Mesh, *materials: bpy.types.Material) -> bpy.types.Object:
    """Add a smooth-shaded object; polygons use the first material unless told otherwise."""
    data = bpy.data.meshes.new(name)
    faces = [tuple(dict.fromkeys(face)) for face in mesh.faces.tolist()]
    data.from_pydata(mesh.vertices.tolist(), [], [face for face in faces if len(face) > 2])
    data.shade_smooth()
    for material in materials:
        data.materials.append(material)
    object = bpy.data.objects.new(name, data)
    object.cycles.shadow_terminator_geometry_offset = 0.0
    scene.collection.objects.link(object)
    return object


def add_ground(scene: bpy.types.Scene, height: float) -> bpy.types.Object:
    """Add the Lambertian disk under the object, inside every light sphere of radius 2 m and more."""
    rim = [Vector((math.cos(a), math.sin(a), 0)) * GROUND_RADIUS for a in (math.tau * i / 96 for i in range(96))]
    data = bpy.data.meshes.new("Ground")
    data.from_pydata(rim, [], [tuple(range(len(rim)))])
    data.materials.append(material("Ground", "ShaderNodeBsdfDiffuse", {"Color": (*3 * (GROUND_ALBEDO,), 1)}))
    ground = bpy.data.objects.new("Ground", data)
    ground.location.z = height
    ground[BACKDROP] = True
    scene.collection.objects.link(ground)
    return ground


def add_camera(scene: bpy.types.Scene, diameter: float, direction: tuple[float, float, float]) -> bpy.types.Object:
    """Add the scene's camera, 7 m from the origin, framing an object of some diameter [m] at the origin."""
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = 7 * Vector(direction).normalized()
    camera.rotation_euler = Vector(direction).to_track_quat("Z", "Y").to_euler()
    camera.data.angle = 2 * math.atan(diameter / 2 / 7)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return camera


def material(name: str, node_type: str, inputs: dict[str, object], **attributes: object) -> bpy.types.Material:
    """Make a material of one closure with the given input values and attributes, e.g. ``distribution="GGX"``."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    closure, output = nodes.new(node_type), nodes.new("ShaderNodeOutputMaterial")
    closure.location.x = -300
    for key, value in attributes.items():
        setattr(closure, key, value)
    for key, value in inputs.items():
        closure.inputs[key].default_value = value
    made.node_tree.links.new(closure.outputs[0], output.inputs["Surface"])
    return made
