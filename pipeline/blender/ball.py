"""A smooth ball that shows a material: of radius 1 about the origin."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.camera import Camera
from ..core.shape.mesh import Mesh
from .meshes import add_mesh

SEGMENTS = 256


def ball_scene() -> tuple[bpy.types.Scene, bpy.types.Object]:
    """Open an empty scene with the ball; what is open in this Blender is replaced."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    return scene, add_mesh(scene, "Ball", ball(), bpy.data.materials.new("Blank"))


def dress(item: bpy.types.Object, material: bpy.types.Material) -> None:
    """Give an object one material."""
    item.data.materials.clear()
    item.data.materials.append(material)


def ball() -> Mesh:
    """Return the ball; u runs along its parallels, v from pole to pole."""
    v, u = np.meshgrid(np.linspace(0, 1, SEGMENTS // 2 + 1), np.linspace(0, 1, SEGMENTS + 1), indexing="ij")
    polar, around = np.pi * v, 2 * np.pi * u
    points = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), -np.cos(polar)], axis=-1)
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate(
        [np.stack([a, b, c], axis=-1)[1:].reshape(-1, 3), np.stack([a, c, d], axis=-1)[:-1].reshape(-1, 3)]
    )
    flat = points.reshape(-1, 3)
    return Mesh(flat, flat, np.stack([u.ravel(), v.ravel()], axis=-1), faces)


def ball_camera(side: int) -> Camera:
    """Return an orthographic camera that sees the ball from its equator: at the poles no tangent is defined."""
    to_world = np.array([[1.0, 0, 0, 0], [0, 0, -1, -4], [0, 1, 0, 0], [0, 0, 0, 1]])
    scale = side / 2.1
    return Camera("orthographic", to_world, (side, side), (scale, scale), (side / 2, side / 2))
