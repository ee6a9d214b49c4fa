"""A gourd of three materials that blend into each other: matt, waxy and metallic.

Effects: cast shadows, diffuse and glossy interreflection.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from . import stage
from .surfaces import Mesh, bezier, evenly, grid

DIAMETER = 2.2
PROFILE = np.array(
    [
        [(0.0, 2.3), (0.12, 2.3), (0.12, 2.1), (0.16, 1.9)],
        [(0.16, 1.9), (0.2, 1.7), (0.62, 1.75), (0.6, 1.35)],
        [(0.6, 1.35), (0.58, 0.95), (0.95, 1.0), (0.95, 0.5)],
        [(0.95, 0.5), (0.95, 0.1), (0.6, 0.0), (0.0, 0.0)],
    ]
)
RIBS = 7
DEPTH_OF_RIBS = 0.05
WEIGHTS = "weights"


def mesh() -> Mesh:
    """Return the gourd: a lathed profile with ribs and a leaning neck, about 46,000 triangles."""
    profile = bezier(PROFILE, evenly(PROFILE, 144))
    angle = 2 * np.pi * np.arange(160) / 160
    radius, height = profile[:, :1], profile[:, 1:]
    ribbed = radius * (1 + DEPTH_OF_RIBS * np.cos(RIBS * angle) * np.clip(radius / 0.6, 0, 1))
    lean = 0.08 * height**2
    points = np.stack([ribbed * np.cos(angle) + lean, ribbed * np.sin(angle), height + 0 * angle], axis=-1)
    return stage.centred(grid(points), DIAMETER)


def weights(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how much of each of the three materials (V, 3) is at each point; they sum to 1."""
    x, y, z = points.T
    waves = [np.sin(3.1 * z + 1.5 * x), np.sin(2.7 * x - 2.2 * y + 2.1), np.sin(2.9 * y + 2.3 * z + 4.2)]
    raw = np.exp(2.5 * np.stack(waves, axis=-1))
    return raw / raw.sum(axis=-1, keepdims=True)


def build(scene: bpy.types.Scene) -> None:
    """Build the gourd on its disk."""
    closures: list[tuple[str, dict[str, object]]] = [
        ("ShaderNodeBsdfDiffuse", {"Color": (0.75, 0.45, 0.15, 1)}),
        ("ShaderNodeBsdfPrincipled", {"Base Color": (0.15, 0.35, 0.12, 1), "Roughness": 0.35}),
        ("ShaderNodeBsdfPrincipled", {"Base Color": (0.85, 0.7, 0.4, 1), "Roughness": 0.45, "Metallic": 1.0}),
    ]
    surface = mesh()
    item = stage.add_object(scene, "Gourd", surface, stage.mixture("Gourd", closures, WEIGHTS))
    stage.add_attribute(item, WEIGHTS, weights(surface.vertices))
    stage.add_ground(scene, surface.vertices[:, 2].min())
    stage.add_camera(scene, 1.1 * DIAMETER, (0.3, -1.0, 0.3))
