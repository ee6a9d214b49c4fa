"""Grids of points swept from Bezier curves and patches, as vertices and quadrilaterals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Mesh:
    """Vertices (V, 3) [m] and quadrilaterals (F, 4); a repeated index makes a triangle."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]

    def __add__(self, other: Mesh) -> Mesh:
        return Mesh(
            np.concatenate([self.vertices, other.vertices]),
            np.concatenate([self.faces, other.faces + len(self.vertices)]),
        )


def bezier(control: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Evaluate cubic Bezier curves joined end to end.

    Parameters
    ----------
    control : (N, 4, ...) float64
        Control points of N curves, each starting where the one before ends.
    steps : int
        Points a curve, its last one excluded.

    Returns
    -------
    (N * steps + 1, ...) float64
    """
    t = np.arange(steps) / steps
    weights = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
    points = np.einsum("tk,nk...->nt...", weights, control).reshape(-1, *control.shape[2:])
    return np.concatenate([points, control[-1, -1:]])


def grid(points: NDArray[np.float64]) -> Mesh:
    """Join rows of points to a surface that closes round each row.

    Parameters
    ----------
    points : (rows, columns, 3) float64
        Column 0 follows the last column. Seen from outside, rows run down and columns to the right.
    """
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    right = np.roll(index, -1, axis=1)
    faces = np.stack([index[:-1], index[1:], right[1:], right[:-1]], axis=-1).reshape(-1, 4)
    return Mesh(points.reshape(-1, 3), faces)


def lathe(profile: NDArray[np.float64], columns: int) -> Mesh:
    """Revolve a profile (N, 2) of radius and height, outermost side to the right of its direction, about z."""
    angle = 2 * np.pi * np.arange(columns) / columns
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = np.empty((len(profile), columns, 3))
    points[..., :2] = profile[:, None, :1] * circle
    points[..., 2] = profile[:, None, 1]
    surface = grid(points)
    pole = np.repeat(profile[:, 0] == 0, columns)
    index = np.arange(len(pole))
    return Mesh(surface.vertices, np.where(pole, index - index % columns, index)[surface.faces])


def mirrored_tube(patches: NDArray[np.float64], rows: int, columns: int) -> Mesh:
    """Sweep half-tube Bezier patches (N, 4, 4, 3) and their mirror image in y to a closed tube."""
    along = bezier(patches, rows)
    half = bezier(along.transpose(1, 0, 2)[None], columns // 2).transpose(1, 0, 2)
    mirror = half[:, -2:0:-1] * (1, -1, 1)
    return grid(np.concatenate([half, mirror], axis=1))
