"""What the rooms share: quadrilaterals and blocks with texture coordinates, lamps, and surfaces of two closures."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from . import stage

UV_LAYER = "UVMap"
BLOCK = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
#: Corners of a block's faces, counter-clockwise from outside.
SIDES = {
    "left": (0, 1, 3, 2),
    "right": (6, 7, 5, 4),
    "front": (4, 5, 1, 0),
    "back": (2, 3, 7, 6),
    "bottom": (0, 2, 6, 4),
    "top": (5, 7, 3, 1),
}


def surface(
    name: str,
    diffuse: Sequence[float],
    specular: Sequence[float] | None = None,
    alphas: tuple[float, float] = (0.0, 0.0),
    degrees: float = 0.0,
) -> bpy.types.Material:
    """Make a material of a diffuse and, where asked for, a glossy Beckmann closure.

    Parameters
    ----------
    name : str
    diffuse, specular : sequence of 3 float
        Reflectances.
    alphas : (float, float)
        Root mean square slopes along and across the brushing.
    degrees : float
        From the texture's U to the brushing.
    """
    made = stage.material(name, "ShaderNodeBsdfDiffuse", {"Color": (*diffuse, 1)})
    if specular is None:
        return made
    nodes, link = made.node_tree.nodes, made.node_tree.links.new
    output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    glossy, add = nodes.new("ShaderNodeBsdfAnisotropic"), nodes.new("ShaderNodeAddShader")
    glossy.distribution = "BECKMANN"
    glossy.inputs["Color"].default_value = (*specular, 1)
    glossy.inputs["Roughness"].default_value = (alphas[0] * alphas[1]) ** 0.25
    if alphas[0] != alphas[1]:
        glossy.inputs["Anisotropy"].default_value = 1 - (alphas[0] / alphas[1]) ** 0.5
        glossy.inputs["Rotation"].default_value = degrees / 360
        tangent = nodes.new("ShaderNodeTangent")
        tangent.direction_type, tangent.uv_map = "UV_MAP", UV_LAYER
        link(tangent.outputs[0], glossy.inputs["Tangent"])
    link(next(node for node in nodes if node.type == "BSDF_DIFFUSE").outputs[0], add.inputs[0])
    link(glossy.outputs[0], add.inputs[1])
    link(add.outputs[0], output.inputs["Surface"])
    return made


def textured(name: str, colours: NDArray[np.float64]) -> bpy.types.Material:
    """Make a diffuse material whose reflectance is a texture (H, W, 3), rows top-down."""
    made = stage.material(name, "ShaderNodeBsdfDiffuse", {})
    nodes = made.node_tree.nodes
    height, width, _ = colours.shape
    image = bpy.data.images.new(name, width, height, float_buffer=True, is_data=True)
    rgba = np.concatenate([colours, np.ones((height, width, 1))], axis=-1)
    image.pixels.foreach_set(rgba[::-1].astype(np.float32).ravel())
    image.pack()
    texture = nodes.new("ShaderNodeTexImage")
    texture.image, texture.extension = image, "EXTEND"
    closure = next(node for node in nodes if node.type == "BSDF_DIFFUSE")
    made.node_tree.links.new(texture.outputs["Color"], closure.inputs["Color"])
    return made


def quad(
    scene: bpy.types.Scene, name: str, corners: Sequence[Sequence[float]], material: bpy.types.Material
) -> bpy.types.Object:
    """Add a quadrilateral, its corners counter-clockwise seen from its front; texture coordinates from the first."""
    data = bpy.data.meshes.new(name)
    data.from_pydata([Vector(corner) for corner in corners], [], [(0, 1, 2, 3)])
    return _added(scene, name, data, [material])


def block(
    scene: bpy.types.Scene,
    name: str,
    centre: Sequence[float],
    size: Sequence[float],
    material: bpy.types.Material,
    turn: float = 0.0,
    sides: dict[str, bpy.types.Material] | None = None,
) -> bpy.types.Object:
    """Add a block, turned about the vertical [degrees]; some of its sides may have a material of their own."""
    data = bpy.data.meshes.new(name)
    data.from_pydata([Vector(corner) for corner in BLOCK * size], [], list(SIDES.values()))
    sides = sides or {}
    item = _added(scene, name, data, [material, *sides.values()])
    for number, side in enumerate(sides, start=1):
        data.polygons[list(SIDES).index(side)].material_index = number
    item.matrix_world = Matrix.Translation(centre) @ Matrix.Rotation(np.radians(turn), 4, "Z")
    return item


def lamp(scene: bpy.types.Scene, place: Sequence[float], size: tuple[float, float], watts: float) -> bpy.types.Object:
    """Add a rectangular lamp that shines downwards."""
    data = bpy.data.lights.new("Lamp", "AREA")
    data.shape, data.size, data.size_y, data.energy = "RECTANGLE", *size, watts
    item = bpy.data.objects.new("Lamp", data)
    item.location = place
    scene.collection.objects.link(item)
    return item


def camera(scene: bpy.types.Scene, place: Sequence[float], target: Sequence[float], degrees: float) -> None:
    """Add the scene's camera for pictures of 160x120 pixels; degrees is the angle that the width covers."""
    data = bpy.data.cameras.new("Camera")
    data.angle = np.radians(degrees)
    item = bpy.data.objects.new("Camera", data)
    item.location = place
    item.rotation_euler = (Vector(place) - Vector(target)).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(item)
    scene.camera = item
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = 160, 120


def _added(
    scene: bpy.types.Scene, name: str, data: bpy.types.Mesh, materials: Sequence[bpy.types.Material]
) -> bpy.types.Object:
    uv = data.uv_layers.new(name=UV_LAYER)
    square = np.tile([(0, 0), (1, 0), (1, 1), (0, 1)], (len(data.polygons), 1)).astype(np.float32)
    uv.uv.foreach_set("vector", square.ravel())
    for material in materials:
        data.materials.append(material)
    item = bpy.data.objects.new(name, data)
    scene.collection.objects.link(item)
    return item
