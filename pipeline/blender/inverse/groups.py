"""Which surfaces of a scene share a reflectance."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy

from ...core.errors import LightsphereError
from ..geometry import RENDERED

PROPERTY = "lightsphere_group"
EMISSION = "shines"
LINKED = "is linked from another file"
NOT_REFLECTED = {
    "EMISSION": EMISSION,
    "BSDF_GLASS": "is glass",
    "BSDF_REFRACTION": "refracts",
    "BSDF_TRANSPARENT": "is transparent",
    "BSDF_TRANSLUCENT": "is translucent",
    "SUBSURFACE_SCATTERING": "scatters below its surface",
    "PRINCIPLED_VOLUME": "is a volume",
    "VOLUME_SCATTER": "is a volume",
    "VOLUME_ABSORPTION": "is a volume",
}


@dataclass
class Group:
    """Surfaces that share a reflectance.

    Parameters
    ----------
    name : str
    slots : list of (Object, int)
        Their material slots.
    kept : str
        Why the group keeps its materials: what they do beyond reflecting; empty where it is to be found.
    """

    name: str
    slots: list[tuple[bpy.types.Object, int]] = field(default_factory=list)
    kept: str = ""


def find(scene: bpy.types.Scene, by: str) -> list[Group]:
    """Return the groups of what a render shows, in the order of the scene's objects, then of what these instance.

    Raises
    ------
    LightsphereError
        When nothing is there whose reflectance could be found.
    """
    found: dict[str, Group] = {}
    for item in _shown(scene):
        if not item.material_slots and not item.data.library:
            item.data.materials.append(None)
        for number, slot in enumerate(item.material_slots):
            group = found.setdefault(_name(item, slot.material, by), Group(""))
            group.slots.append((item, number))
            group.kept = group.kept or (LINKED if item.data.library else _beyond_reflection(slot.material))
    for name, group in found.items():
        group.name = name
    groups = list(found.values())
    if all(group.kept for group in groups):
        raise LightsphereError(
            f"the scene {scene.name!r} shows no surface that only reflects; there is nothing to find"
        )
    return groups


def _shown(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the objects with surfaces that a scene shows itself or as instances."""
    own = [item for item in scene.objects if not item.hide_render]
    instances = scene.view_layers[0].depsgraph.object_instances
    instanced = [one.object.original for one in instances if one.is_instance]
    return [item for item in dict.fromkeys([*own, *instanced]) if item.type in RENDERED]


def _name(item: bpy.types.Object, material: bpy.types.Material | None, by: str) -> str:
    if wanted := item.get(PROPERTY):
        return str(wanted)
    if by == "collections" and item.users_collection:
        return str(item.users_collection[0].name)
    if by == "materials" and material is not None:
        return str(material.name)
    return str(item.name)


def _beyond_reflection(material: bpy.types.Material | None) -> str:
    """Return what a material does beyond reflecting, empty where nothing."""
    if material is None or material.node_tree is None:
        return ""
    for node in material.node_tree.nodes:
        if node.type in NOT_REFLECTED:
            return NOT_REFLECTED[node.type]
        if node.type == "BSDF_PRINCIPLED":
            if node.inputs["Transmission Weight"].default_value > 0:
                return NOT_REFLECTED["BSDF_GLASS"]
            if node.inputs["Emission Strength"].default_value > 0 and any(
                node.inputs["Emission Color"].default_value[:3]
            ):
                return EMISSION
    return ""


def place_of(name: str, names: list[str], what: str, kind: str) -> int:
    """Return where a name is in a list, or raise a LightsphereError."""
    if name not in names:
        raise LightsphereError(f"{what}: there is no {kind} {name!r}; there are {', '.join(names) or 'none'}")
    return names.index(name)
