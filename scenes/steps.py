"""A stepped block with depth edges and a deep shaft.

Effects: cast shadows, and much diffuse interreflection in the shaft.
"""

from __future__ import annotations

import bpy
import numpy as np

from . import stage
from .surfaces import Mesh

DIAMETER = 2.4
# How far each cell of the front stands out of the back plane, top row first [cells]; the 0 is the shaft.
FRONT = np.array(
    [
        [1, 1, 2, 2, 3, 3, 4, 4],
        [1, 1, 2, 2, 3, 3, 4, 4],
        [1, 1, 2, 2, 3, 0, 4, 4],
        [1, 1, 2, 2, 3, 3, 4, 4],
        [3, 3, 3, 2, 3, 3, 2, 2],
        [4, 4, 3, 3, 3, 3, 1, 1],
    ]
)
BACK = -1


def mesh() -> Mesh:
    """Return the block as the outer faces of its unit cells; x right, z up, the front towards -y."""
    rows, columns = FRONT.shape
    depth = FRONT.max() - BACK
    filled = np.zeros((columns + 2, depth + 2, rows + 2), bool)
    for row in range(rows):
        for column in range(columns):
            filled[column + 1, 1 : FRONT[row, column] - BACK + 1, rows - row] = True
    corners, faces = [], []
    for axis in range(3):
        for side in (-1, 1):
            bare = np.argwhere(filled & ~np.roll(filled, -side, axis=axis))
            faces.append(sum(map(len, corners)) + np.arange(4 * len(bare)).reshape(-1, 4))
            corners.append((bare[:, None] + _square(axis, side)).reshape(-1, 3))
    points = np.concatenate(corners).astype(np.float64) * (1, -1, 1)
    # The mirrored y turns every face over; taking its corners backwards turns it outwards again.
    return stage.centred(Mesh(points, np.concatenate(faces)[:, ::-1]), DIAMETER)


def build(scene: bpy.types.Scene) -> None:
    """Build the block on its disk."""
    surface = mesh()
    matt = stage.material("Stone", "ShaderNodeBsdfDiffuse", {"Color": (0.65, 0.6, 0.5, 1)})
    stage.add_object(scene, "Steps", surface, matt, smooth=False)
    stage.add_ground(scene, surface.vertices[:, 2].min())
    stage.add_camera(scene, 1.2 * DIAMETER, (0.25, -1.0, 0.35))


def _square(axis: int, side: int) -> np.ndarray:
    """Return the corners (4, 3) of a unit cell's face, counter-clockwise from outside."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    corners = np.zeros((4, 3), int)
    corners[:, axis] = max(side, 0)
    corners[[1, 2], u] = 1
    corners[[2, 3], v] = 1
    return corners[::side]
