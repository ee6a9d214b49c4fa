"""A recovered reflectance as a node material: packed textures into one labelled node group."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from ..core.reflectance import Reflectance
from . import pixels

GROUP = "Lightsphere Surface"


@dataclass(frozen=True)
class Socket:
    """One input of the node group: its kind, default, range and what the tooltip says."""

    name: str
    kind: str
    default: Any
    tip: str
    high: float = 1.0


WHITE = (1.0, 1.0, 1.0, 1.0)
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


def surface_material(name: str, reflectance: Reflectance) -> bpy.types.Material:
    """Make a material that shows a reflectance on a mesh with the capture's UVs.

    Parameters
    ----------
    name : str
    reflectance : Reflectance
        Its maps become packed float images; a map of one value becomes that value. Its figures become
        custom properties of the material.
    """
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    group = _node(tree, "ShaderNodeGroup", (0, 0), width=240)
    group.node_tree = bpy.data.node_groups.get(GROUP) or surface_group()
    group.label = GROUP
    output = _node(tree, "ShaderNodeOutputMaterial", (320, 0))
    tree.links.new(group.outputs["Surface"], output.inputs["Surface"])
    frame = _node(tree, "NodeFrame", (0, 0))
    frame.label = "Recovered from the capture"
    maps = {
        "Albedo": reflectance.albedo,
        "Specular": reflectance.specular,
        "Grazing": reflectance.edge,
        "Roughness": reflectance.roughness,
    }
    for row, (socket, values) in enumerate(maps.items()):
        filled = _filled(values)
        if np.ptp(filled) == 0:
            group.inputs[socket].default_value = float(filled.flat[0]) if filled.ndim == 2 else (*filled[0, 0], 1.0)
            continue
        texture = _node(tree, "ShaderNodeTexImage", (-420, 340 - 290 * row), width=260)
        texture.image = pixels.packed_image(f"{name} {socket}", filled)
        texture.label = socket
        texture.extension = "EXTEND"
        texture.parent = frame
        tree.links.new(texture.outputs["Color"], group.inputs[socket])
    for key in ("model", "material_rel_rms", "material_rel_rms_median", "held_out_lights"):
        if key in reflectance.notes:
            material[key] = reflectance.notes[key]
    return material


def surface_group() -> bpy.types.NodeTree:
    """Make the node group: a Diffuse BSDF, a Glossy BSDF, and the gain of the same lobe at grazing angles."""
    tree = bpy.data.node_groups.new(GROUP, "ShaderNodeTree")
    for socket in SOCKETS:
        made = tree.interface.new_socket(socket.name, in_out="INPUT", socket_type=socket.kind)
        made.default_value, made.description = socket.default, socket.tip
        if socket.kind == "NodeSocketFloat":
            made.min_value, made.max_value = 0.0, socket.high
    tree.interface.new_socket("Surface", in_out="OUTPUT", socket_type="NodeSocketShader")
    source = _node(tree, "NodeGroupInput", (-900, 0))
    target = _node(tree, "NodeGroupOutput", (700, 0))

    def product(label: str, first: Any, second: Any, place: tuple[float, float]) -> Any:
        node = _node(tree, "ShaderNodeVectorMath", place)  # unlike Mix Color, clamps nothing
        node.operation, node.label = "MULTIPLY", label
        tree.links.new(first, node.inputs[0])
        tree.links.new(second, node.inputs[1])
        return node.outputs[0]

    def scaled(label: str, first: Any, second: Any, place: tuple[float, float], limit: bool) -> Any:
        node = _node(tree, "ShaderNodeMath", place)
        node.operation, node.label, node.use_clamp = "MULTIPLY", label, limit
        tree.links.new(first, node.inputs[0])
        tree.links.new(second, node.inputs[1])
        return node.outputs[0]

    given = source.outputs
    colour = product("Diffuse colour", given["Albedo"], given["Tint"], (-600, 320))
    highlight = product("Highlight colour", given["Specular"], given["Specular Tint"], (-600, 100))
    strength = product("Highlight", highlight, given["Specular Strength"], (-380, 60))
    roughness = scaled("Roughness", given["Roughness"], given["Roughness Scale"], (-600, -120), True)
    grazing = scaled("Grazing", given["Grazing"], given["Specular Strength"], (-600, -320), True)

    diffuse = _node(tree, "ShaderNodeBsdfDiffuse", (-120, 320))
    tree.links.new(colour, diffuse.inputs["Color"])
    glossy = _node(tree, "ShaderNodeBsdfAnisotropic", (-120, 140))
    glossy.distribution = "GGX"
    tree.links.new(strength, glossy.inputs["Color"])
    edge = _node(tree, "ShaderNodeBsdfMetallic", (-120, -160))  # black base: (1 - h.wo)^5 times the lobe
    edge.distribution, edge.fresnel_type = "GGX", "F82"
    edge.inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    edge.inputs["Edge Tint"].default_value = WHITE
    for lobe in (glossy, edge):
        tree.links.new(roughness, lobe.inputs["Roughness"])
    share = _node(tree, "ShaderNodeMixShader", (120, -120))
    tree.links.new(grazing, share.inputs[0])
    tree.links.new(edge.outputs[0], share.inputs[2])
    lobes = _node(tree, "ShaderNodeAddShader", (320, 40))
    tree.links.new(glossy.outputs[0], lobes.inputs[0])
    tree.links.new(share.outputs[0], lobes.inputs[1])
    whole = _node(tree, "ShaderNodeAddShader", (500, 160))
    tree.links.new(diffuse.outputs[0], whole.inputs[0])
    tree.links.new(lobes.outputs[0], whole.inputs[1])
    tree.links.new(whole.outputs[0], target.inputs["Surface"])
    return tree


def _node(tree: bpy.types.NodeTree, kind: str, place: tuple[float, float], width: float | None = None) -> Any:
    node = tree.nodes.new(kind)
    node.location = place
    if width is not None:
        node.width = width
    return node


def _filled(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Give unknown texels the nearest known one's value: the texture filter reaches across the mesh's border."""
    known = np.isfinite(values if values.ndim == 2 else values[..., 0])
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(values[tuple(nearest)])
