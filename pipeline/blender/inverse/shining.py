"""What shines in a scene, and how strongly: its lamps, surfaces that shine, and the world."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import bpy

from .groups import EMISSION, Group

STRENGTHS = {"EMISSION": "Strength", "BSDF_PRINCIPLED": "Emission Strength", "BACKGROUND": "Strength"}
STRENGTH = "times the colour"  # the unit of what is no lamp


@dataclass(frozen=True)
class Lamp:
    """Something that shines with one power.

    Parameters
    ----------
    name : str
        Of the lamp, the material or the world.
    unit : str
    dials : tuple of (struct, str, float)
        Where its power is set: a property and what that is in the scene.
    material : Material or None
        Whose surfaces shine.
    is_world : bool
    """

    name: str
    unit: str
    dials: tuple[tuple[Any, str, float], ...]
    material: bpy.types.Material | None = None
    is_world: bool = False

    @property
    def power(self) -> float:
        """Its power now."""
        struct, name, _ = self.dials[0]
        return float(getattr(struct, name))

    def shine(self, factor: float) -> None:
        """Let it shine by a factor of what it does in the scene."""
        for struct, name, own in self.dials:
            setattr(struct, name, factor * own)


def lamps_of(scene: bpy.types.Scene, groups: Sequence[Group]) -> list[Lamp]:
    """Return what shines in a scene: lamps, those of shared data once, then materials, then the world.

    Surfaces and worlds whose strength is a texture are left out, they shine as they do.
    """
    lights = {item.data.name: item for item in scene.objects if item.type == "LIGHT" and not item.hide_render}
    lamps = []
    for item in lights.values():
        unit = "W/m^2" if item.data.type == "SUN" else "W"
        lamps.append(Lamp(item.name, unit, ((item.data, "energy", item.data.energy),)))
    shining = [group for group in groups if group.kept == EMISSION]
    for material in dict.fromkeys(
        item.material_slots[slot].material for group in shining for item, slot in group.slots
    ):
        if material and (dials := _dials(material.node_tree.nodes)):
            lamps.append(Lamp(material.name, STRENGTH, dials, material))
    world = scene.world
    if world and world.node_tree and (dials := _dials(world.node_tree.nodes)):
        lamps.append(Lamp(world.name, STRENGTH, dials, is_world=True))
    return lamps


def _dials(nodes: Iterable[bpy.types.Node]) -> tuple[tuple[Any, str, float], ...]:
    sockets = [node.inputs[STRENGTHS[node.type]] for node in nodes if node.type in STRENGTHS]
    if any(socket.is_linked for socket in sockets):
        return ()
    return tuple((socket, "default_value", socket.default_value) for socket in sockets if socket.default_value > 0)
