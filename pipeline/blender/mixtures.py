"""Mixtures of closures as a node material: one group per material that holds its bases, fed by weight maps.

Inside the group every closure's colour is the sum over the bases of weight x curve of the view. Its inputs are what an
artist edits: the weight map of every basis, its strength and its gloss, an exchange of two bases, and tint, specular
and roughness scale of the whole. At their defaults they change nothing, and Cycles folds them away.
"""

from __future__ import annotations

from functools import partial
from itertools import combinations
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.material import STOPS, Mixture
from ..core.material.closures import Lobe
from ..core.material.surface import Surface
from . import pixels
from .meshes import UV_LAYER
from .nodes import NEUTRAL, NORMAL_MAP, WHITE, Graph, new_material, normal_from_map

GROUP = "Lightsphere Bases"
CLOSURES = {
    "diffuse": ("ShaderNodeBsdfDiffuse", {}),
    "ggx": ("ShaderNodeBsdfAnisotropic", {"distribution": "GGX"}),
    "beckmann": ("ShaderNodeBsdfAnisotropic", {"distribution": "BECKMANN"}),
    "retro": ("ShaderNodeBsdfAnisotropic", {"distribution": "GGX"}),
    "fresnel": ("ShaderNodeBsdfMetallic", {"distribution": "GGX", "fresnel_type": "F82"}),
    "sheen": ("ShaderNodeBsdfSheen", {"distribution": "ASHIKHMIN"}),
}
WORDS = {
    "diffuse": "Diffuse",
    "ggx": "Gloss",
    "beckmann": "Beckmann gloss",
    "retro": "Back to the viewer",
    "fresnel": "Grazing gloss",
    "sheen": "Sheen",
}


def mixture_material(name: str, surface: Surface, normal_map: NDArray[np.float32] | None = None) -> bpy.types.Material:
    """Make a material of a surface's weight maps and its group of bases.

    Parameters
    ----------
    name : str
    surface : Surface
        Its figures become custom properties of the material.
    normal_map : (H, W, 3) float32, optional
        In tangent space, encoded 0 to 1.
    """
    material = new_material(name)
    graph = Graph(material.node_tree)
    group = graph.add("ShaderNodeGroup", 2, 0, width=260.0)
    coloured = surface.weights.shape[3] == 3
    group.node_tree = mixture_group(f"{name} {GROUP}", surface.mixture, coloured, normal_map is not None)
    group.label = GROUP
    output = graph.add("ShaderNodeOutputMaterial", 4, 0)
    graph.feed(output.inputs["Surface"], group.outputs["Surface"])
    graph.framed("Recovered from the capture")
    for number, socket in enumerate(_weights(graph, name, surface.weights), start=1):
        graph.feed(group.inputs[_weight(number)], socket)
    if normal_map is not None:
        image = pixels.packed_image(f"{name} {NORMAL_MAP}", normal_map)
        shown = graph.texture(-0.5, 4.2, image, "Normals in tangent space")
        graph.feed(group.inputs[NORMAL_MAP], shown.outputs["Color"])
    for key, value in surface.notes.items():
        material[key] = value
    return material


def basis_material(name: str, asset: bpy.types.Material, number: int) -> bpy.types.Material:
    """Make a material that shows one basis of an asset's alone, from 1, as its sliders stand now.

    Where the weights carry the colour, it is that of the weight map's mean.
    """
    shown = group_of(asset)
    material = new_material(name)
    graph = Graph(material.node_tree)
    node = graph.add("ShaderNodeGroup", 2, 0, width=260.0, node_tree=shown.node_tree, label=GROUP)
    for there, here in zip(shown.inputs, node.inputs, strict=True):
        if not there.is_linked:
            here.default_value = there.default_value
    weights = weight_maps(shown)
    for k, weight in enumerate(weights, start=1):
        mean = weight.reshape(-1, 3).mean(axis=0) if k == number else np.zeros(3)
        full = mean / max(mean.max(), 1e-30)
        socket = node.inputs[_weight(k)]
        socket.default_value = (*map(float, full), 1.0) if socket.type == "RGBA" else float(full.max())
    graph.feed(graph.add("ShaderNodeOutputMaterial", 4, 0).inputs["Surface"], node.outputs["Surface"])
    return material


def group_of(material: bpy.types.Material) -> Any:
    """Return the node of a material's bases, None where it has none."""
    nodes = material.node_tree.nodes if material.node_tree else ()
    return next((node for node in nodes if node.label == GROUP), None)


def weight_maps(node: Any) -> list[NDArray[np.float32]]:
    """Return the weight map (H, W, 3) of every basis of :func:`group_of`; (1, 1, 3) where it is even."""
    maps = []
    while _weight(len(maps) + 1) in node.inputs:
        socket = node.inputs[_weight(len(maps) + 1)]
        if not socket.is_linked:
            maps.append(np.broadcast_to(np.float32(socket.default_value), 4)[None, None, :3])
            continue
        source = socket.links[0].from_socket
        if source.node.type == "SEPARATE_COLOR":
            channel = list(source.node.outputs).index(source)
            source = source.node.inputs[0].links[0].from_socket
        else:
            channel = 3 if source.name == "Alpha" else None
        values = pixels.array(source.node.image)
        maps.append(values[..., :3] if channel is None else values[..., channel : channel + 1].repeat(3, axis=-1))
    return maps


def mixture_group(name: str, mixture: Mixture, coloured: bool, normal_map: bool) -> bpy.types.NodeTree:
    """Make the group of a mixture.

    Parameters
    ----------
    name : str
    mixture : Mixture
        Of K bases.
    coloured : bool
        Whether the weights carry the colour.
    normal_map : bool
        Whether a normal map tilts the normals; it costs what one costs.
    """
    tree = bpy.data.node_groups.new(name, "ShaderNodeTree")
    _sockets(tree, mixture, coloured, normal_map)
    graph = Graph(tree)
    given = graph.add("NodeGroupInput", -7, 0).outputs
    normal, cosine = _view(graph, given, normal_map)
    diffuse, glossy = _bases(graph, given, len(mixture.curves), coloured)
    closures = []
    for number, lobe in enumerate(mixture.lobes):
        amounts = diffuse if lobe.kind == "diffuse" else glossy
        if mixture.curves[:, number].any():
            closures.append(_closure(graph, given, number, lobe, mixture.curves[:, number], amounts, normal, cosine))
    graph.frame = None
    total = closures[0]
    for row, closure in enumerate(closures[1:], start=1):
        total = graph.add("ShaderNodeAddShader", 5.4 + len(mixture.curves), 2.6 * row, inputs=(total, closure)).outputs[
            0
        ]
    output = graph.add("NodeGroupOutput", 6.6 + len(mixture.curves), 2.6 * (len(closures) - 1))
    graph.feed(output.inputs["Surface"], total)
    return tree


def _sockets(tree: bpy.types.NodeTree, mixture: Mixture, coloured: bool, normal_map: bool) -> None:
    """Declare what the artist sees, in panels: the whole, then every basis, then the exchanges."""
    make = tree.interface.new_socket
    make("Surface", in_out="OUTPUT", socket_type="NodeSocketShader")

    def socket(name: str, value: Any, tip: str, panel: Any = None, most: float = 10.0) -> None:
        kind = "NodeSocketColor" if isinstance(value, tuple) else "NodeSocketFloat"
        made = make(name, in_out="INPUT", socket_type=kind, parent=panel)
        made.default_value, made.description = value, tip
        if kind == "NodeSocketFloat":
            made.min_value, made.max_value = 0.0, most

    socket("Tint", WHITE, "Multiplies the diffuse colour; white is as captured")
    socket("Specular Tint", WHITE, "Multiplies the colour of all highlights; white is as captured")
    socket("Specular Scale", 1.0, "Multiplies all highlights; 1 is as captured")
    socket("Roughness Scale", 1.0, "Multiplies the width of all highlights; 1 is as captured")
    if any(lobe.aspect != 1 for lobe in mixture.lobes):
        socket("Rotation", 0.0, "Turns the direction of brushing, in turns; 0 is along the texture's U", most=1.0)
    if normal_map:
        socket(NORMAL_MAP, NEUTRAL, "Normals in tangent space, encoded 0 to 1")
    numbers = range(1, len(mixture.curves) + 1)
    for k in numbers:
        panel = tree.interface.new_panel(f"Basis {k}", default_closed=k > 1)
        weight: Any = WHITE if coloured else 1.0
        socket(_weight(k), weight, f"How much of basis {k} every place has: the recovered weight map", panel)
        socket(f"Strength {k}", 1.0, f"Multiplies all of basis {k}; 1 is as captured", panel)
        socket(f"Specular {k}", 1.0, f"Multiplies the highlights of basis {k}; 1 is as captured", panel)
    if len(numbers) > 1:
        panel = tree.interface.new_panel("Exchange", default_closed=True)
        for pair in combinations(numbers, 2):
            tip = "Gives the places of basis {} to basis {} and the other way round; 0 is as captured"
            socket(_exchange(*pair), 0.0, tip.format(*pair), panel, 1.0)


def _view(graph: Graph, given: Any, normal_map: bool) -> tuple[Any, Any]:
    """Return the normal, None where it is the mesh's own, and the cosine of the view."""
    graph.framed("View")
    geometry = graph.add("ShaderNodeNewGeometry", -4, -3)
    normal = None
    if normal_map:
        normal = normal_from_map(graph, given[NORMAL_MAP], -4, -1.8)
    facing = graph.add("ShaderNodeVectorMath", -2.6, -2.6, operation="DOT_PRODUCT", label="Cosine of the view")
    graph.feed(facing.inputs[0], geometry.outputs["Incoming"])
    graph.feed(facing.inputs[1], normal or geometry.outputs["Normal"])
    return normal, facing.outputs["Value"]


def _bases(graph: Graph, given: Any, count: int, coloured: bool) -> tuple[list[Any], list[Any]]:
    """Return what multiplies each basis's diffuse and its glossy curves: colours where the weights carry them."""
    weights = [given[_weight(k)] for k in range(1, count + 1)]
    graph.framed("Exchange of bases")
    row = 0.0
    for a, b in combinations(range(count), 2):
        share = given[_exchange(a + 1, b + 1)]
        first, second = weights[a], weights[b]
        weights[a], weights[b] = (
            _mixed(graph, row, share, first, second),
            _mixed(graph, row + 0.8, share, second, first),
        )
        row += 1.7
    graph.framed("Strength of the bases")
    multiply = graph.scaled if coloured else partial(graph.math, "MULTIPLY")
    diffuse, glossy = [], []
    for k, weight in enumerate(weights):
        row, n = 2.0 * k, k + 1
        factor = graph.math(
            "MULTIPLY", -3, row + 0.9, given[f"Specular {n}"], given["Specular Scale"], label="Specular"
        )
        diffuse.append(multiply(-3, row, weight, given[f"Strength {n}"], label=f"Basis {n}"))
        glossy.append(multiply(-2, row + 0.9, diffuse[-1], factor, label=f"Specular {n}"))
    return diffuse, glossy


def _mixed(graph: Graph, row: float, share: Any, first: Any, second: Any) -> Any:
    colour = first.type in ("RGBA", "VECTOR")
    node = graph.add("ShaderNodeMix", -5, row, data_type="VECTOR" if colour else "FLOAT")
    graph.feed(node.inputs["Factor"], share)
    named = {socket.identifier: socket for socket in [*node.inputs, *node.outputs]}
    suffix = "Vector" if colour else "Float"
    graph.feed(named[f"A_{suffix}"], first)
    graph.feed(named[f"B_{suffix}"], second)
    return named[f"Result_{suffix}"]


def _closure(
    graph: Graph,
    given: Any,
    number: int,
    lobe: Lobe,
    curves: NDArray[np.float64],
    amounts: list[Any],
    normal: Any,
    cosine: Any,
) -> Any:
    """Add one closure with the curves (K, J, 3) of its colour; return its shader."""
    row = 2.6 * number
    graph.framed(f"{WORDS[lobe.kind]} {lobe.roughness:.2f}" if lobe.roughness else WORDS[lobe.kind])
    colour = None
    for k, curve in enumerate(curves):
        if not curve.any():
            continue
        ramp = _ramp(graph, k + 1, row, curve, f"Basis {k + 1}")
        graph.feed(ramp.inputs[0], cosine)
        if colour is None:
            colour = graph.vector("MULTIPLY", k + 2, row + 1.3, ramp.outputs["Color"], amounts[k])
        else:
            colour = graph.vector("MULTIPLY_ADD", k + 2, row + 1.3, ramp.outputs["Color"], amounts[k], colour)
    column = len(curves) + 3
    # once for all bases: a white tint then costs nothing
    tint = given["Tint" if lobe.kind == "diffuse" else "Specular Tint"]
    colour = graph.vector("MULTIPLY", column - 1, row + 1.3, colour, tint, label="Tint")
    kind, properties = CLOSURES[lobe.kind]
    node = graph.add(kind, column, row, **properties)
    if lobe.kind != "diffuse":
        rough = graph.math(
            "MULTIPLY", column - 1, row + 0.7, lobe.roughness, given["Roughness Scale"], label="Roughness", clamp=True
        )
        graph.feed(node.inputs["Roughness"], rough)
    if lobe.aspect != 1:
        _brushed(graph, node, given, lobe.aspect, column, row)
    if lobe.kind == "retro":
        incoming = graph.add("ShaderNodeNewGeometry", column - 1, row + 1.6, label="About the view")
        graph.feed(node.inputs["Normal"], incoming.outputs["Incoming"])
    elif normal is not None:
        graph.feed(node.inputs["Normal"], normal)
    if lobe.kind != "fresnel":
        graph.feed(node.inputs["Color"], colour)
        return node.outputs[0]
    # a black base leaves (1 - h.wo)^5 of the lobe, which only a share of it can scale
    graph.feed(node.inputs["Base Color"], (0.0, 0.0, 0.0, 1.0))
    graph.feed(node.inputs["Edge Tint"], WHITE)
    mixed = graph.add("ShaderNodeMixShader", column + 1, row, label="Share")
    graph.feed(mixed.inputs[0], graph.add("ShaderNodeSeparateXYZ", column, row + 1.9, inputs=(colour,)).outputs[0])
    graph.feed(mixed.inputs[2], node.outputs[0])
    return mixed.outputs[0]


def _brushed(graph: Graph, node: Any, given: Any, aspect: float, column: float, row: float) -> None:
    """Stretch a glossy node: A = 1 - sqrt(short / long alpha), below 0 with the long one along the texture's U."""
    anisotropy = 1 - np.sqrt(min(aspect, 1 / aspect))
    node.inputs["Anisotropy"].default_value = float(anisotropy if aspect > 1 else -anisotropy)
    graph.feed(node.inputs["Rotation"], given["Rotation"])
    tangent = graph.add("ShaderNodeTangent", column - 1, row + 1.6, direction_type="UV_MAP", uv_map=UV_LAYER)
    graph.feed(node.inputs["Tangent"], tangent.outputs[0])


def _ramp(graph: Graph, column: float, row: float, curve: NDArray[np.float64], label: str) -> Any:
    node = graph.add("ShaderNodeValToRGB", column, row, label=label, width=180.0)
    elements = node.color_ramp.elements
    node.color_ramp.interpolation = "LINEAR"
    elements[0].position, elements[1].position = STOPS[0], STOPS[-1]
    for stop in STOPS[1:-1]:
        elements.new(stop)
    for element, colour in zip(elements, curve, strict=True):
        element.color = (*colour, 1.0)
    return node


def _weights(graph: Graph, name: str, weights: NDArray[np.float32]) -> list[Any]:
    """Return a socket or value per basis; bases without colour share one texture."""
    height, width, count, sets = weights.shape
    filled = pixels.filled(weights.reshape(height, width, count * sets)).reshape(weights.shape)
    if np.ptp(filled.reshape(-1, count * sets), axis=0).max() == 0:
        constant = filled[0, 0]
        return [float(w[0]) if sets == 1 else (*map(float, w), 1.0) for w in constant]
    if sets == 3:
        images = [pixels.packed_image(f"{name} Weight {k + 1}", filled[:, :, k]) for k in range(count)]
        return [
            graph.texture(-0.5, 1.4 * k, image, f"Weight {k + 1}").outputs["Color"] for k, image in enumerate(images)
        ]
    texture = graph.texture(-0.5, 0, pixels.packed_image(f"{name} Weights", filled[..., 0]), "Weights of the bases")
    if count == 1:
        return [texture.outputs["Color"]]
    parts = graph.add("ShaderNodeSeparateColor", 1, 0, inputs=(texture.outputs["Color"],)).outputs
    return [*parts, texture.outputs["Alpha"]][:count]


def _weight(number: int) -> str:
    return f"Weight {number}"


def _exchange(first: int, second: int) -> str:
    return f"Exchange {first} and {second}"
