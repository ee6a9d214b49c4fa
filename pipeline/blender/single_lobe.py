"""A diffuse and one glossy lobe per pixel as a node material: packed textures into one labelled node group."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.reflectance import Reflectance
from . import pixels
from .nodes import NEUTRAL, NORMAL_MAP, WHITE, Graph, new_material, normal_from_map

GROUP = "Lightsphere Surface"


@dataclass(frozen=True)
class Socket:
    """One input of the node group: its kind, default, range and what the tooltip says."""

    name: str
    kind: str
    default: Any
    tip: str
    high: float = 1.0


SOCKETS = (
    Socket("Albedo", "NodeSocketColor", WHITE, "Recovered diffuse colour"),
    Socket("Tint", "NodeSocketColor", WHITE, "Multiplies the diffuse colour; white is as captured"),
    Socket("Specular", "NodeSocketColor", WHITE, "Recovered colour and strength of the highlight"),
    Socket("Specular Tint", "NodeSocketColor", WHITE, "Multiplies the highlight's colour; white is as captured"),
    Socket("Specular Strength", "NodeSocketFloat", 1.0, "Multiplies the highlight; 1 is as captured", 10.0),
    Socket("Grazing", "NodeSocketFloat", 0.0, "Recovered gain of the highlight towards grazing angles"),
    Socket("Roughness", "NodeSocketFloat", 0.5, "Recovered width of the highlight"),
    Socket("Roughness Scale", "NodeSocketFloat", 1.0, "Multiplies the roughness; 1 is as captured", 10.0),
)
NORMALS = Socket(NORMAL_MAP, "NodeSocketColor", NEUTRAL, "Normals in tangent space, encoded 0 to 1")


def single_lobe_material(
    name: str, reflectance: Reflectance, normal_map: NDArray[np.float32] | None = None
) -> bpy.types.Material:
    """Make a material of albedo, highlight colour, gain at grazing angles and roughness.

    A map of one value becomes that value; the others become packed float images. See
    :func:`pipeline.blender.materials.surface_material`.
    """
    material = new_material(name)
    graph = Graph(material.node_tree)
    label = GROUP if normal_map is None else f"{GROUP} with {NORMAL_MAP}"
    group = graph.add("ShaderNodeGroup", 0, 0, width=240.0, label=label)
    group.node_tree = bpy.data.node_groups.get(label) or surface_group(normal_map is not None)
    output = graph.add("ShaderNodeOutputMaterial", 1.6, 0)
    graph.feed(output.inputs["Surface"], group.outputs["Surface"])
    graph.framed("Recovered from the capture")
    maps = {
        "Albedo": reflectance.albedo,
        "Specular": reflectance.specular,
        "Grazing": reflectance.edge,
        "Roughness": reflectance.roughness,
    }
    if normal_map is not None:
        maps[NORMAL_MAP] = normal_map
    for row, (socket, values) in enumerate(maps.items()):
        filled = pixels.filled(values)
        graph.feed_map(group.inputs[socket], filled, partial(pixels.packed_image, f"{name} {socket}", filled), row)
    for key in ("model", "material_rel_rms", "material_rel_rms_median", "held_out_lights"):
        if key in reflectance.notes:
            material[key] = reflectance.notes[key]
    return material


def surface_group(normal_map: bool = False) -> bpy.types.NodeTree:
    """Make the node group: a Diffuse BSDF, a Glossy BSDF, and the gain of the same lobe at grazing angles."""
    tree = bpy.data.node_groups.new(f"{GROUP} with {NORMAL_MAP}" if normal_map else GROUP, "ShaderNodeTree")
    for socket in (*SOCKETS, *([NORMALS] if normal_map else [])):
        made = tree.interface.new_socket(socket.name, in_out="INPUT", socket_type=socket.kind)
        made.default_value, made.description = socket.default, socket.tip
        if socket.kind == "NodeSocketFloat":
            made.min_value, made.max_value = 0.0, socket.high
    tree.interface.new_socket("Surface", in_out="OUTPUT", socket_type="NodeSocketShader")
    graph = Graph(tree)
    given = graph.add("NodeGroupInput", -4, 0).outputs
    colour = graph.vector("MULTIPLY", -3, -1.6, given["Albedo"], given["Tint"], label="Diffuse colour")
    highlight = graph.vector("MULTIPLY", -3, -0.5, given["Specular"], given["Specular Tint"], label="Highlight colour")
    strength = graph.scaled(-2, -0.4, highlight, given["Specular Strength"], "Highlight")
    roughness = graph.math(
        "MULTIPLY", -3, 0.7, given["Roughness"], given["Roughness Scale"], label="Roughness", clamp=True
    )
    grazing = graph.math("MULTIPLY", -3, 1.8, given["Grazing"], given["Specular Strength"], label="Grazing", clamp=True)
    diffuse = graph.add("ShaderNodeBsdfDiffuse", -0.8, -1.6, inputs=(colour,))
    glossy = graph.add("ShaderNodeBsdfAnisotropic", -0.8, -0.6, distribution="GGX", inputs=(strength,))
    edge = graph.add("ShaderNodeBsdfMetallic", -0.8, 0.8, distribution="GGX", fresnel_type="F82")
    graph.feed(edge.inputs["Base Color"], (0.0, 0.0, 0.0, 1.0))  # black: (1 - h.wo)^5 times the lobe
    graph.feed(edge.inputs["Edge Tint"], WHITE)
    for lobe in (glossy, edge):
        graph.feed(lobe.inputs["Roughness"], roughness)
    if normal_map:
        normal = normal_from_map(graph, given[NORMAL_MAP], -2, 3)
        for closure in (diffuse, glossy, edge):
            graph.feed(closure.inputs["Normal"], normal)
    share = graph.add("ShaderNodeMixShader", 0.4, 0.7, inputs=(grazing,))
    graph.feed(share.inputs[2], edge.outputs[0])
    lobes = graph.add("ShaderNodeAddShader", 1.4, -0.2, inputs=(glossy.outputs[0], share.outputs[0]))
    whole = graph.add("ShaderNodeAddShader", 2.4, -0.8, inputs=(diffuse.outputs[0], lobes.outputs[0]))
    output = graph.add("NodeGroupOutput", 3.4, -0.8)
    graph.feed(output.inputs["Surface"], whole.outputs[0])
    return tree
