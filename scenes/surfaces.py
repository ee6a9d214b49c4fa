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


def bezier(control: NDArray[np.float64], t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evaluate cubic Bezier curves joined end to end.

    Parameters
    ----------
    control : (N, 4, ...) float64
        Control points of N curves, each starting where the one before ends.
    t : (T,) float64
        Parameters from 0, the start of the first curve, to N, the end of the last.

    Returns
    -------
    (T, ...) float64
    """
    curve = np.minimum(t.astype(int), len(control) - 1)
    u = t - curve
    weights = np.stack([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3], axis=1)
    return np.einsum("tk,tk...->t...", weights, control[curve])


def evenly(control: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return parameters (count,) at which neighbours differ as evenly in place as in direction.

    A curl gets more points than a straight piece, so that normals interpolated between them stay true.
    """
    t = np.linspace(0, len(control), 500 * len(control))
    points = bezier(control, t).reshape(len(t), -1)
    steps = np.diff(points, axis=0)
    length = np.linalg.norm(steps, axis=1)
    direction = steps / length[:, None]
    turn = np.arccos(np.clip((direction[1:] * direction[:-1]).sum(axis=1), -1, 1))
    total = turn.sum()
    way = np.cumsum(length) / length.sum()
    if total > 0:
        way[1:] += np.cumsum(turn) / total
    return np.interp(np.linspace(0, way[-1], count), np.concatenate([[0], way]), t)


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


def closed_grid(points: NDArray[np.float64], pole: NDArray[np.bool_] | None = None) -> Mesh:
    """Join rows of points as :func:`grid` does; those of a row at a pole, the first and last as a rule, are one."""
    rows, columns = points.shape[:2]
    at_pole = np.isin(np.arange(rows), (0, rows - 1)) if pole is None else pole
    surface = grid(points)
    index = np.arange(rows * columns)
    return Mesh(surface.vertices, np.where(np.repeat(at_pole, columns), index - index % columns, index)[surface.faces])


def lathe(profile: NDArray[np.float64], columns: int) -> Mesh:
    """Revolve a profile (N, 2) of radius and height, outermost side to the right of its direction, about z."""
    angle = 2 * np.pi * np.arange(columns) / columns
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = np.empty((len(profile), columns, 3))
    points[..., :2] = profile[:, None, :1] * circle
    points[..., 2] = profile[:, None, 1]
    return closed_grid(points, pole=profile[:, 0] == 0)


def mirrored_tube(patches: NDArray[np.float64], rows: int, columns: int) -> Mesh:
    """Sweep half-tube Bezier patches (N, 4, 4, 3) and their mirror image in y to a tube with open ends."""
    along = bezier(patches, evenly(patches, rows))
    around = np.linspace(0, 1, columns // 2 + 1)
    half = bezier(along.transpose(1, 0, 2)[None], around).transpose(1, 0, 2)
    mirror = half[:, -2:0:-1] * (1, -1, 1)
    return grid(np.concatenate([half, mirror], axis=1)[:, ::-1])
