"""What every built-in scene shares: an object made of a mesh, the ground it stands on, a camera that frames it.

Units are metres, z is up. Whatever is not the object carries the custom property ``lightsphere_backdrop``.
"""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from .surfaces import Mesh

BACKDROP = "lightsphere_backdrop"
WITHIN = 1.85  # everything lies within this distance of the origin [m], inside the light spheres
GROUND_ALBEDO = 0.3


def add_object(
    scene: bpy.types.Scene, name: str, mesh: Mesh, material: bpy.types.Material, smooth: bool = True
) -> bpy.types.Object:
    """Add an object of one material, with smooth or flat shading."""
    data = bpy.data.meshes.new(name)
    faces = [tuple(dict.fromkeys(face)) for face in mesh.faces.tolist()]
    data.from_pydata(mesh.vertices.tolist(), [], [face for face in faces if len(face) > 2])
    if smooth:
        data.shade_smooth()
    data.materials.append(material)
    object = bpy.data.objects.new(name, data)
    scene.collection.objects.link(object)
    return object


def add_ground(scene: bpy.types.Scene, height: float, radius: float = 0.0) -> bpy.types.Object:
    """Add the Lambertian disk under the object; without a radius [m] inside every light sphere of 2 m and more."""
    radius = radius or math.sqrt(WITHIN**2 - height**2)
    rim = [Vector((math.cos(a), math.sin(a), 0)) * radius for a in (math.tau * i / 96 for i in range(96))]
    data = bpy.data.meshes.new("Ground")
    data.from_pydata(rim, [], [tuple(range(len(rim)))])
    data.materials.append(material("Ground", "ShaderNodeBsdfDiffuse", {"Color": (*3 * (GROUND_ALBEDO,), 1)}))
    ground = bpy.data.objects.new("Ground", data)
    ground.location.z = height
    ground[BACKDROP] = True
    scene.collection.objects.link(ground)
    return ground


def centred(mesh: Mesh, diameter: float) -> Mesh:
    """Scale a mesh to a largest extent [m] and centre its bounding box on the origin."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return Mesh((mesh.vertices - (low + high) / 2) * (diameter / (high - low).max()), mesh.faces)


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
    made, output = _empty_material(name)
    made.node_tree.links.new(_closure(made, node_type, inputs, attributes).outputs[0], output.inputs["Surface"])
    return made


def mixture(name: str, closures: list[tuple[str, dict[str, object]]], attribute: str) -> bpy.types.Material:
    """Make a material of three closures (node type, inputs), mixed by the red, green and blue of a mesh attribute."""
    made, output = _empty_material(name)
    nodes, link = made.node_tree.nodes, made.node_tree.links.new
    weights, separate = nodes.new("ShaderNodeAttribute"), nodes.new("ShaderNodeSeparateColor")
    weights.attribute_name = attribute
    weights.location, separate.location = (-900, 300), (-700, 300)
    link(weights.outputs["Color"], separate.inputs[0])
    first, second, third = (
        _closure(made, kind, inputs, {}, row=i).outputs[0] for i, (kind, inputs) in enumerate(closures)
    )
    # Mixing takes two at a time: the first two by g / (r + g), the result with the third by b.
    total, share = (nodes.new("ShaderNodeMath") for _ in range(2))
    total.operation, share.operation = "ADD", "DIVIDE"
    total.location, share.location = (-500, 400), (-300, 400)
    link(separate.outputs["Red"], total.inputs[0])
    link(separate.outputs["Green"], total.inputs[1])
    link(separate.outputs["Green"], share.inputs[0])
    link(total.outputs[0], share.inputs[1])
    pair, whole = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeMixShader")
    pair.location, whole.location = (-100, 200), (80, 0)
    for mix, factor, low, high in (
        (pair, share.outputs[0], first, second),
        (whole, separate.outputs["Blue"], pair.outputs[0], third),
    ):
        link(factor, mix.inputs[0])
        link(low, mix.inputs[1])
        link(high, mix.inputs[2])
    link(whole.outputs[0], output.inputs["Surface"])
    return made


def add_attribute(item: bpy.types.Object, name: str, colours: NDArray[np.float64]) -> None:
    """Store one colour (V, 3) per vertex."""
    attribute = item.data.attributes.new(name, "FLOAT_COLOR", "POINT")
    rgba = np.concatenate([colours, np.ones((len(colours), 1))], axis=1)
    attribute.data.foreach_set("color", rgba.astype(np.float32).ravel())


def _empty_material(name: str) -> tuple[bpy.types.Material, bpy.types.Node]:
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        made.use_nodes = True
    made.node_tree.nodes.clear()
    output = made.node_tree.nodes.new("ShaderNodeOutputMaterial")
    output.location.x = 260
    return made, output


def _closure(
    made: bpy.types.Material, node_type: str, inputs: dict[str, object], attributes: dict[str, object], row: int = 0
) -> bpy.types.Node:
    closure = made.node_tree.nodes.new(node_type)
    closure.location = (-400, -300 * row)
    for key, value in attributes.items():
        setattr(closure, key, value)
    for key, value in inputs.items():
        closure.inputs[key].default_value = value
    return closure
