"""What was drawn for a sample as a node material, which also tells what it is made of at every place.

Of Principled materials that are mixed, the shares are ``s1 = 1 - f1``, ``s2 = f1 (1 - f2)``, ``s3 = f1 f2`` with f1
and f2 smooth functions of the place that are mostly 0 or 1. Outputs of the shader tell shares and mean roughness
(:data:`SHARES`, :data:`ROUGHNESS`), which :mod:`.layers` renders.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import bpy

from ...core.brdf import files
from ...core.dataset.draw import Principled, Sample, Stream
from ...core.dataset.recipe import PRINCIPLED, Recipe
from ...core.material.surface import Surface, uniform
from ...core.progress import finish
from ..materials import surface_material
from ..nodes import Graph, new_material

SHARES, ROUGHNESS = "shares", "roughness"
SHARP = 6.0  # how steep the edge between two materials is, over that of the noise itself
FITS_KEPT = 32  # materials of files that a process remembers


def material_of(recipe: Recipe, sample: Sample) -> tuple[bpy.types.Material, str]:
    """Make a sample's material; return it and its name."""
    if sample.material == PRINCIPLED:
        return _mixed(sample), PRINCIPLED
    path = Path(sample.material)
    names = files.tables_in(path)
    name = names[min(int(sample.table * len(names)), len(names) - 1)]
    title = path.stem if name == files.TABLE else name
    return surface_material(title, _fitted(path, name, recipe.material.lobes)), title


@functools.lru_cache(FITS_KEPT)
def _fitted(path: Path, name: str, lobes: int) -> Surface:
    return finish(uniform([files.read_brdf(path, name)], lobes))


def _mixed(sample: Sample) -> bpy.types.Material:
    material = new_material(PRINCIPLED.title())
    graph = Graph(material.node_tree)
    graph.framed("Where each material is")
    factors = [_factor(graph, sample, k) for k in range(len(sample.principled) - 1)]
    shares, roughness = _shares(graph, factors, sample.principled)
    graph.framed("Materials")
    shaders = [_shader(graph, k, inputs) for k, inputs in enumerate(sample.principled)]
    shader = shaders.pop()
    for k in reversed(range(len(factors))):
        shader = _mix(graph, k, factors[k], shaders[k], shader)
    graph.frame = None
    output = graph.add("ShaderNodeOutputMaterial", 8, 0)
    graph.feed(output.inputs["Surface"], shader)
    told = graph.add("ShaderNodeCombineXYZ", 7, 2, inputs=tuple(shares))
    colour = graph.add("ShaderNodeOutputAOV", 8, 2, aov_name=SHARES)
    graph.feed(colour.inputs["Color"], told.outputs[0])
    value = graph.add("ShaderNodeOutputAOV", 8, 3, aov_name=ROUGHNESS)
    graph.feed(value.inputs["Value"], roughness)
    return material


def _factor(graph: Graph, sample: Sample, number: int) -> Any:
    """Return a smooth function of the place, mostly 0 or 1, that no other sample has."""
    place = graph.add("ShaderNodeTexCoord", -4, 3.0 * number)
    moved = graph.add("ShaderNodeVectorMath", -3, 3.0 * number, operation="ADD")
    graph.feed(moved.inputs[0], place.outputs["Object"])
    offset = Stream(sample.shape_seed, number, "patches").random.random(3) * 1000 * sample.extent
    graph.feed(moved.inputs[1], tuple(map(float, offset)))
    noise = graph.add("ShaderNodeTexNoise", -2, 3.0 * number, noise_dimensions="3D")
    graph.feed(noise.inputs["Vector"], moved.outputs[0])
    graph.feed(noise.inputs["Scale"], 1 / (sample.patches * sample.extent))
    graph.feed(noise.inputs["Detail"], 1.0)
    shifted = graph.math("SUBTRACT", -1, 3.0 * number, noise.outputs[0], 0.5)
    return graph.math("MULTIPLY_ADD", 0, 3.0 * number, shifted, SHARP, 0.5, label=f"Edge {number + 1}", clamp=True)


def _shares(graph: Graph, factors: list[Any], principled: tuple[Principled, ...]) -> tuple[list[Any], Any]:
    """Return what share of the surface each material has, and their mean roughness."""
    shares: list[Any] = [1.0]
    for k, factor in enumerate(factors):
        rest = shares.pop()
        taken = graph.math("MULTIPLY", 1, 4 + 2.0 * k, rest, factor)
        shares += [graph.math("SUBTRACT", 2, 4 + 2.0 * k, rest, taken), taken]
    total: Any = 0.0
    for k, (share, inputs) in enumerate(zip(shares, principled, strict=True)):
        total = graph.math("MULTIPLY_ADD", 3 + k, 8, share, inputs.roughness, total, label="Mean roughness")
    return shares, total


def _shader(graph: Graph, number: int, inputs: Principled) -> Any:
    node = graph.add("ShaderNodeBsdfPrincipled", 4, 4.0 * number, distribution="GGX")
    values = {
        "Base Color": (*inputs.base_color, 1.0),
        "Metallic": inputs.metallic,
        "Roughness": inputs.roughness,
        "Specular IOR Level": inputs.specular,
        "Coat Weight": inputs.coat,
    }
    for name, value in values.items():
        node.inputs[name].default_value = value
    return node.outputs["BSDF"]


def _mix(graph: Graph, number: int, share: Any, first: Any, second: Any) -> Any:
    node = graph.add("ShaderNodeMixShader", 5 + number, 4.0 * number, inputs=(share,))
    graph.feed(node.inputs[1], first)
    graph.feed(node.inputs[2], second)
    return node.outputs[0]
