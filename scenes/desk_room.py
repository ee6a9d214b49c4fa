"""A room with a desk: two mirrors, a brushed aluminium plate, a glazed ball, books, a poster and a cube.

The back of the cube is seen in a mirror alone. Effects: cast shadows, diffuse and glossy interreflection, caustics.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from . import rooms
from .rooms import surface

MIRROR_ALPHA = 1e-3  # float32 half vectors are too coarse for less
PLATE = {"alphas": (0.08, 0.3), "degrees": 25.0}
GLAZE_ALPHA = 0.12


def poster() -> NDArray[np.float64]:
    """Return the poster's reflectance (96, 72, 3): rings and bars, rows top-down."""
    v, u = np.meshgrid(np.linspace(0, 1, 96), np.linspace(0, 1, 72), indexing="ij")
    rings = 0.5 + 0.5 * np.tanh(6 * np.sin(18 * np.hypot(u - 0.45, 1.3 * (v - 0.4))))
    bars = (np.floor(6 * u) % 2) * (v > 0.75)
    colours = np.stack([0.15 + 0.55 * rings, 0.2 + 0.3 * (1 - rings), 0.45 - 0.3 * rings], axis=-1)
    return np.where(bars[..., None] > 0, (0.6, 0.55, 0.1), colours)


def build(scene: bpy.types.Scene) -> None:
    """Build the room, 3.6 m wide, 4.4 m deep and 2.6 m high, seen from the open end."""
    x, y, z = 1.8, 2.2, 2.6
    wall, warm = surface("Wall", (0.6, 0.58, 0.52)), surface("Warm wall", (0.55, 0.33, 0.2))
    rooms.quad(scene, "Floor", [(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], surface("Floor", (0.3, 0.2, 0.13)))
    ceiling = surface("Ceiling", (0.75, 0.75, 0.73))
    rooms.quad(scene, "Ceiling", [(-x, y, z), (x, y, z), (x, -y, z), (-x, -y, z)], ceiling)
    rooms.quad(scene, "Back wall", [(-x, y, 0), (x, y, 0), (x, y, z), (-x, y, z)], wall)
    rooms.quad(scene, "Front wall", [(x, -y, 0), (-x, -y, 0), (-x, -y, z), (x, -y, z)], wall)
    rooms.quad(scene, "Left wall", [(-x, -y, 0), (-x, y, 0), (-x, y, z), (-x, -y, z)], warm)
    rooms.quad(scene, "Right wall", [(x, y, 0), (x, -y, 0), (x, -y, z), (x, y, z)], wall)
    desk = surface("Desk", (0.42, 0.27, 0.15))
    rooms.block(scene, "Desk", (0.1, 1.0, 0.72), (2.4, 1.1, 0.06), desk)
    for left in (-1.0, 1.2):
        rooms.block(scene, "Leg", (left, 1.0, 0.35), (0.08, 1.0, 0.69), desk)
    mirror = surface("Mirror", (0.0, 0.0, 0.0), (0.92, 0.92, 0.92), 2 * (MIRROR_ALPHA,))
    tinted = surface("Tinted mirror", (0.0, 0.0, 0.0), (0.5, 0.6, 0.62), 2 * (MIRROR_ALPHA,))
    right, back = x - 0.02, y - 0.01
    on_back = [(0.1, back, 0.8), (1.5, back, 0.8), (1.5, back, 1.9), (0.1, back, 1.9)]
    on_right = [(right, 1.6, 0.95), (right, 0.2, 0.95), (right, 0.2, 1.9), (right, 1.6, 1.9)]
    beside = [(-1.35, back, 1.0), (-0.35, back, 1.0), (-0.35, back, 2.2), (-1.35, back, 2.2)]
    rooms.quad(scene, "Mirror", on_back, mirror)
    rooms.quad(scene, "Tinted mirror", on_right, tinted)
    rooms.quad(scene, "Poster", beside, rooms.textured("Poster", poster()))
    plate = surface("Brushed plate", (0.05, 0.05, 0.05), (0.55, 0.55, 0.56), **PLATE)
    rooms.quad(
        scene, "Plate", [(-0.75, 0.55, 0.765), (0.15, 0.55, 0.765), (0.15, 1.15, 0.765), (-0.75, 1.15, 0.765)], plate
    )
    glaze = surface("Glaze", (0.12, 0.2, 0.38), (0.2, 0.2, 0.2), 2 * (GLAZE_ALPHA,))
    _ball(scene, (-0.6, 1.35, 0.94), 0.19, glaze)
    for number, (name, colour) in enumerate(
        {"Red book": (0.5, 0.09, 0.07), "Green book": (0.1, 0.36, 0.14), "Yellow book": (0.6, 0.5, 0.12)}.items()
    ):
        rooms.block(
            scene,
            name,
            (-0.93 + 0.02 * number, 0.9, 0.785 + 0.07 * number),
            (0.36, 0.27, 0.068),
            surface(name, colour),
            turn=8 - 9 * number,
        )
    back = {"back": surface("Cube back", (0.62, 0.3, 0.08))}
    rooms.block(
        scene, "Cube", (0.75, 1.15, 0.91), (0.32, 0.32, 0.32), surface("Cube", (0.35, 0.45, 0.5)), turn=14, sides=back
    )
    rooms.lamp(scene, (-0.1, 0.3, z - 0.02), (1.1, 0.8), 90.0)
    rooms.camera(scene, (0.15, -2.0, 1.5), (0.05, 1.4, 1.12), 62.0)


def _ball(
    scene: bpy.types.Scene, place: tuple[float, float, float], radius: float, material: bpy.types.Material
) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=radius, location=place)
    item = bpy.context.object
    item.name = item.data.name = "Ball"
    item.data.shade_smooth()
    item.data.materials.append(material)
