"""The model of a group as nodes: a diffuse and a glossy closure, or a plastic, whose values are set in place."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.inverse import IOR, Model
from .. import pixels
from ..nodes import Graph, new_material

DIFFUSE, GLOSSY, PLASTIC = "Diffuse", "Gloss", "Plastic"
TEXTURE, FACTOR = "Reflectance", "Reflectance Factor"


def group_material(name: str, uv_layer: str) -> bpy.types.Material:
    """Make the material of a group; its brushing follows a layer of texture coordinates where there is one."""
    material = new_material(name)
    _matt_and_glossy(material, uv_layer)
    return material


def _matt_and_glossy(material: bpy.types.Material, uv_layer: str) -> None:
    graph = Graph(material.node_tree)
    diffuse = graph.add("ShaderNodeBsdfDiffuse", 0, 0, name=DIFFUSE, label=DIFFUSE)
    glossy = graph.add("ShaderNodeBsdfAnisotropic", 0, 1.2, name=GLOSSY, label=GLOSSY, distribution="BECKMANN")
    if uv_layer:
        tangent = graph.add("ShaderNodeTangent", -1.4, 2, direction_type="UV_MAP", uv_map=uv_layer)
        graph.feed(glossy.inputs["Tangent"], tangent.outputs[0])
    total = graph.add("ShaderNodeAddShader", 1.4, 0.4, inputs=(diffuse.outputs[0], glossy.outputs[0]))
    graph.feed(graph.add("ShaderNodeOutputMaterial", 2.4, 0.4).inputs["Surface"], total.outputs[0])


def _plastic(material: bpy.types.Material) -> None:
    graph = Graph(material.node_tree)
    plastic = graph.add("ShaderNodeBsdfPrincipled", 0, 0, name=PLASTIC, label=PLASTIC)
    plastic.inputs["IOR"].default_value = IOR
    graph.feed(graph.add("ShaderNodeOutputMaterial", 2.4, 0.4).inputs["Surface"], plastic.outputs[0])


def show(material: bpy.types.Material, model: Model, uv_layer: str) -> None:
    """Set a group's material to a model, see :func:`group_material`."""
    nodes = material.node_tree.nodes
    is_plastic = model.level == "plastic"
    if is_plastic != (PLASTIC in nodes):
        nodes.clear()
        if is_plastic:
            _plastic(material)
        else:
            _matt_and_glossy(material, uv_layer)
    if is_plastic:
        _set(nodes[PLASTIC].inputs["Base Color"], model.diffuse)
        nodes[PLASTIC].inputs["Roughness"].default_value = model.alpha**0.5
        return
    _set(nodes[DIFFUSE].inputs["Color"], model.diffuse)
    glossy = nodes[GLOSSY].inputs
    _set(glossy["Color"], model.specular)
    if nodes[GLOSSY].distribution != model.distribution.upper():  # else Cycles would compile the shader anew
        nodes[GLOSSY].distribution = model.distribution.upper()
    along, across = model.alphas
    glossy["Roughness"].default_value = float((along * across) ** 0.25)
    glossy["Anisotropy"].default_value = float(1 - np.sqrt(along / across))
    glossy["Rotation"].default_value = model.angle / 360
    if (texture := nodes.get(FACTOR)) is not None:
        _set(texture.inputs[1], model.diffuse)


def paint(material: bpy.types.Material, name: str, values: NDArray[np.float32] | None, uv_layer: str) -> None:
    """Let a texture (H, W, 3), rows top-down, times the model's diffuse reflectance be shown; None removes it."""
    nodes = material.node_tree.nodes
    for node in [node for node in nodes if node.name.startswith(TEXTURE)]:
        if node.type == "TEX_IMAGE":
            bpy.data.images.remove(node.image)
        nodes.remove(node)
    if values is None:
        return
    graph = Graph(material.node_tree)
    coordinates = graph.add("ShaderNodeUVMap", -4, 0, name=f"{TEXTURE} Coordinates", uv_map=uv_layer)
    shown = graph.texture(-3, 0, pixels.packed_image(f"{name} {TEXTURE}", values), TEXTURE)
    shown.name = TEXTURE
    graph.feed(shown.inputs["Vector"], coordinates.outputs[0])
    factor = graph.vector("MULTIPLY", -1.4, 0, shown.outputs["Color"], (1.0, 1.0, 1.0), label="Factor")
    factor.node.name = FACTOR
    graph.feed(nodes[DIFFUSE].inputs["Color"], factor)


@contextlib.contextmanager
def glowing(material: bpy.types.Material, radiance: NDArray[np.float64]) -> Iterator[None]:
    """Let a group's surfaces shine by themselves for a while, too, with a radiance (3,)."""
    graph = Graph(material.node_tree)
    surface = next(node for node in graph.tree.nodes if node.type == "OUTPUT_MATERIAL").inputs["Surface"]
    reflected = surface.links[0].from_socket
    colour = (*map(float, radiance), 1.0)
    glow = graph.add("ShaderNodeEmission", 1.4, 1.4, inputs=(colour, 1.0))
    total = graph.add("ShaderNodeAddShader", 2.4, 1.4, inputs=(reflected, glow.outputs[0]))
    graph.feed(surface, total.outputs[0])
    try:
        yield
    finally:
        graph.feed(surface, reflected)
        for node in (total, glow):
            graph.tree.nodes.remove(node)


def _set(socket: Any, values: NDArray[np.float64]) -> None:
    four = len(socket.default_value) == 4
    socket.default_value = (*map(float, values), 1.0) if four else tuple(map(float, values))
