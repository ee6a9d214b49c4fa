"""The built-in scenes by name, with the effects that each contains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from . import colour_box, desk_room, gourd, steps, teapot, thin

SHADOW = "cast shadows"
DIFFUSE = "diffuse interreflection"
GLOSSY = "glossy interreflection"
CAUSTICS = "caustics"


@dataclass(frozen=True)
class Entry:
    """A built-in scene: what it shows, its effects, the function that builds it into an empty bpy scene.

    A room has lights of its own and is for ``inverse``; the others are objects to capture.
    """

    description: str
    effects: tuple[str, ...]
    build: Callable[[Any], None]
    room: bool = False


SCENES: dict[str, Entry] = {
    "teapot-lambert": Entry("Lambertian teapot on a disk", (SHADOW, DIFFUSE), teapot.lambert),
    "teapot-plastic": Entry("plastic teapot on a disk", (SHADOW, DIFFUSE, GLOSSY), teapot.plastic),
    "teapot-metal": Entry("rough metal teapot (GGX) on a disk", (SHADOW, DIFFUSE, GLOSSY), teapot.metal),
    "teapot-coat": Entry("half metallic teapot with a clear coat", (SHADOW, DIFFUSE, GLOSSY), teapot.coat),
    "teapot-beckmann": Entry("teapot of one Beckmann lobe", (SHADOW, DIFFUSE, GLOSSY), teapot.beckmann),
    "gourd": Entry("gourd of three materials that blend", (SHADOW, DIFFUSE, GLOSSY), gourd.build),
    "steps": Entry("stepped block with depth edges and a deep shaft", (SHADOW, DIFFUSE), steps.build),
    "thin": Entry("thin plastic knot that shadows itself", (SHADOW, DIFFUSE, GLOSSY), thin.build),
    "colour-box": Entry("coloured walls that bleed on each other", (SHADOW, DIFFUSE), colour_box.build, room=True),
    "desk-room": Entry(
        "desk, mirrors, brushed plate, poster", (SHADOW, DIFFUSE, GLOSSY, CAUSTICS), desk_room.build, room=True
    ),
}
