"""Which closures a material is made of, if all of them have a closed form, and where in its nodes they are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy

from ...core import direct_light as direct

DISTRIBUTIONS = {"GGX": direct.GGX, "MULTI_GGX": direct.GGX, "BECKMANN": direct.BECKMANN}
#: Inputs of a Principled BSDF that must have this value for its closed form to hold.
PLAIN = {
    "Alpha": 1.0,
    "Diffuse Roughness": 0.0,
    "Subsurface Weight": 0.0,
    "Anisotropic": 0.0,
    "Transmission Weight": 0.0,
    "Coat Weight": 0.0,
    "Sheen Weight": 0.0,
    "Thin Film Thickness": 0.0,
    "Emission Strength": 0.0,
}


class Inexact(Exception):
    """Why a scene has no closed form; its words end the sentence "Cycles renders, for ..."."""


@dataclass(frozen=True)
class Closure:
    """One closure of a material, and how to read it off a picture.

    Parameters
    ----------
    node : str
        Name of its node.
    path : tuple of (str, bool)
        The Mix Shader nodes between it and the output, and whether it is their second input.
    distribution, fresnel : int
        As :class:`pipeline.core.direct_light.Lobes` has them.
    colour : str
        The node's input that is the colour, or f0 where there is Fresnel; ``""`` for a dielectric.
    measured : bool
        Whether Cycles scales it by more than the colour, so that its weight is to be read off a picture.
    """

    node: str
    path: tuple[tuple[str, bool], ...]
    distribution: int
    fresnel: int = direct.NO_FRESNEL
    colour: str = "Color"
    measured: bool = False


def closures(material: bpy.types.Material) -> list[Closure]:
    """Return the closures of a material; raise Inexact where one has no closed form."""
    output = material.node_tree.get_output_node("CYCLES") if material.node_tree else None
    if output is None:
        raise Inexact(f"the material {material.name} has no nodes")
    if output.inputs["Volume"].is_linked:
        raise Inexact(f"the material {material.name} fills a volume")
    if output.inputs["Displacement"].is_linked:
        raise Inexact(f"the material {material.name} displaces its surface")
    return list(_before(material, output.inputs["Surface"], ()))


def _before(
    material: bpy.types.Material, socket: bpy.types.NodeSocket, path: tuple[tuple[str, bool], ...]
) -> Iterator[Closure]:
    for link in socket.links:
        node = link.from_node
        if node.type == "REROUTE":
            yield from _before(material, node.inputs[0], path)
        elif node.type == "ADD_SHADER":
            for part in node.inputs:
                yield from _before(material, part, path)
        elif node.type == "MIX_SHADER":
            for second, part in enumerate(node.inputs[1:]):
                yield from _before(material, part, (*path, (node.name, bool(second))))
        else:
            yield from _of_node(material, node, path)


def _of_node(
    material: bpy.types.Material, node: bpy.types.Node, path: tuple[tuple[str, bool], ...]
) -> Iterator[Closure]:
    def demand(name: str, value: float) -> None:
        socket = node.inputs[name]
        if socket.is_linked or socket.default_value != value:
            raise Inexact(f"{name} of {node.label or node.name} in the material {material.name}")

    if node.type not in ("BSDF_DIFFUSE", "BSDF_GLOSSY", "BSDF_PRINCIPLED"):
        raise Inexact(f"{node.label or node.name} in the material {material.name}")
    if node.inputs["Normal"].is_linked:
        raise Inexact(f"the normals of {node.label or node.name} in the material {material.name}")
    if node.type == "BSDF_DIFFUSE":
        demand("Roughness", 0.0)
        yield Closure(node.name, path, direct.LAMBERT)
        return
    if node.distribution not in DISTRIBUTIONS:
        raise Inexact(f"the distribution of {node.label or node.name} in the material {material.name}")
    distribution = DISTRIBUTIONS[node.distribution]
    if node.type == "BSDF_GLOSSY":
        demand("Anisotropy", 0.0)
        yield Closure(node.name, path, distribution, measured=node.distribution == "MULTI_GGX")
        return
    for name, value in PLAIN.items():
        demand(name, value)
    if node.inputs["Specular Tint"].is_linked or tuple(node.inputs["Specular Tint"].default_value[:3]) != (1, 1, 1):
        raise Inexact(f"Specular Tint of {node.label or node.name} in the material {material.name}")
    if node.inputs["Metallic"].default_value == 1:
        demand("Metallic", 1.0)
        yield Closure(node.name, path, distribution, direct.SCHLICK, "Base Color", measured=True)
        return
    demand("Metallic", 0.0)
    yield Closure(node.name, path, direct.LAMBERT, colour="Base Color", measured=True)
    yield Closure(node.name, path, distribution, direct.DIELECTRIC, "", measured=True)
