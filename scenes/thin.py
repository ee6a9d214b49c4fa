"""A thin tube in a knot that shadows itself.

Effects: cast shadows, little diffuse and glossy interreflection.
"""

from __future__ import annotations

import bpy
import numpy as np

from . import stage
from .surfaces import Mesh, grid

DIAMETER = 2.2
TUBE = 0.11


def mesh() -> Mesh:
    """Return a tube along a (2, 3) torus knot, about 43,000 triangles."""
    t = 2 * np.pi * np.arange(900) / 900
    ring = 1 + 0.42 * np.cos(3 * t)
    curve = np.stack([ring * np.cos(2 * t), -0.42 * np.sin(3 * t), ring * np.sin(2 * t)], axis=-1)
    # Frames from the torus that carries the knot: they close by themselves.
    tangent = _unit(np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0))
    centre = np.stack([np.cos(2 * t), 0 * t, np.sin(2 * t)], axis=-1)
    outward = curve - centre
    outward = _unit(outward - (outward * tangent).sum(axis=-1, keepdims=True) * tangent)
    side = np.cross(outward, tangent)
    angle = 2 * np.pi * np.arange(24) / 24
    points = curve[:, None] + TUBE * (
        np.cos(angle)[:, None] * outward[:, None] + np.sin(angle)[:, None] * side[:, None]
    )
    return stage.centred(grid(np.concatenate([points, points[:1]])), DIAMETER)


def build(scene: bpy.types.Scene) -> None:
    """Build the knot on its disk."""
    surface = mesh()
    inputs: dict[str, object] = {"Base Color": (0.6, 0.25, 0.2, 1), "Roughness": 0.4}
    stage.add_object(scene, "Knot", surface, stage.material("Knot", "ShaderNodeBsdfPrincipled", inputs))
    stage.add_ground(scene, surface.vertices[:, 2].min())
    stage.add_camera(scene, 1.1 * DIAMETER, (0.3, -1.0, 0.3))


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
