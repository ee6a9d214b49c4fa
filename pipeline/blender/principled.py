"""The Principled version of a recovered reflectance: what other programs read of it."""

from __future__ import annotations

from functools import partial

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.material.principled import LEVEL, Principled
from . import pixels
from .nodes import Graph, new_material, normal_from_map

SUFFIX = "Principled"
INDEX = 1.5  # of refraction, from which glTF's specular extension starts, too


def principled_material(
    name: str, found: Principled, normal_map: NDArray[np.float32] | None = None
) -> bpy.types.Material:
    """Make a material of one Principled BSDF with textures of 8 bits, as other programs read them.

    A map of one value becomes that value.

    Parameters
    ----------
    name : str
        Of the faithful material; this one's ends in ``Principled``.
    found : Principled
        Its figures become custom properties of the material.
    normal_map : (H, W, 3) float32, optional
        In tangent space, encoded 0 to 1.
    """
    material = new_material(f"{name} {SUFFIX}")
    graph = Graph(material.node_tree)
    shader = graph.add("ShaderNodeBsdfPrincipled", 1, 0, distribution="GGX")
    shader.inputs["IOR"].default_value = INDEX
    shader.inputs["Specular IOR Level"].default_value = LEVEL
    output = graph.add("ShaderNodeOutputMaterial", 3, 0)
    graph.feed(output.inputs["Surface"], shader.outputs["BSDF"])
    graph.framed("Nearest Principled BSDF")
    maps = {
        "Base Color": found.base,
        "Metallic": found.metallic,
        "Roughness": found.roughness,
        "Specular Tint": found.tint,
    }
    for row, (socket, values) in enumerate(maps.items()):
        filled = pixels.filled(values)
        make = partial(pixels.byte_image, f"{material.name} {socket}", filled, colour=filled.ndim == 3)
        graph.feed_map(shader.inputs[socket], filled, make, row)
    if normal_map is not None:
        image = pixels.byte_image(f"{material.name} Normal", pixels.filled(normal_map), colour=False)
        texture = graph.texture(-2, 1.6 * len(maps), image, "Normals in tangent space")
        graph.feed(shader.inputs["Normal"], normal_from_map(graph, texture.outputs["Color"], 0, 1.6 * len(maps)))
    for key, value in found.notes.items():
        material[key] = value
    return material
