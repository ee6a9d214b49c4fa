"""A box of coloured walls that bleed onto each other, with two blocks in it and a lamp under its ceiling.

Effects: cast shadows, diffuse interreflection.
"""

from __future__ import annotations

import bpy

from . import rooms

WHITE, RED, GREEN = (0.72, 0.71, 0.68), (0.62, 0.08, 0.06), (0.12, 0.46, 0.1)
FLOOR, TALL, SHORT = (0.55, 0.5, 0.42), (0.25, 0.35, 0.65), (0.75, 0.6, 0.15)


def build(scene: bpy.types.Scene) -> None:
    """Build the box, 2 m wide and high and 2.4 m deep, open towards the camera."""
    x, y, z = 1.0, 1.2, 2.0
    white = rooms.surface("White", WHITE)
    rooms.quad(scene, "Floor", [(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], rooms.surface("Floor", FLOOR))
    rooms.quad(scene, "Ceiling", [(-x, y, z), (x, y, z), (x, -y, z), (-x, -y, z)], white)
    rooms.quad(scene, "Back", [(-x, y, 0), (x, y, 0), (x, y, z), (-x, y, z)], white)
    rooms.quad(scene, "Left", [(-x, -y, 0), (-x, y, 0), (-x, y, z), (-x, -y, z)], rooms.surface("Red", RED))
    rooms.quad(scene, "Right", [(x, y, 0), (x, -y, 0), (x, -y, z), (x, y, z)], rooms.surface("Green", GREEN))
    rooms.block(scene, "Tall", (-0.35, 0.4, 0.6), (0.55, 0.55, 1.2), rooms.surface("Tall", TALL), turn=18)
    rooms.block(scene, "Short", (0.4, -0.3, 0.3), (0.55, 0.55, 0.6), rooms.surface("Short", SHORT), turn=-16)
    rooms.lamp(scene, (0, 0, z - 0.01), (0.5, 0.5), 30.0)
    rooms.camera(scene, (0, -4.4, 1.0), (0, 0, 1.0), 44.0)
