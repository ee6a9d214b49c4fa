"""What the dark tells: a surface casts its shadows where it is dark, and nowhere else.

A bowl under lights from one side looks like a ball under lights from the other, but for its shadows: on the ball all
that turns away from the light is dark, in the bowl it is what the brim hides. Cast shadows leave the depth of a relief
open (Kriegman and Belhumeur 2001), but not whether it is convex or concave.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .equations import WIDTH, squared_width
from .joint import Joint
from .lamps import directions, places
from .pictures import Pictures, surface_points

Array = NDArray[np.float64]

TOLERATED = 0.005  # share of the values that may be wrong: every shadow has a border, and the pictures' blocks a size
STEPS = 64  # along a ray of light over the object
BESIDE = 1.0  # pixels that a ray of light leaves the surface by before it can meet it, and by which it must lie below


def unexplained(pictures: Pictures, joint: Joint) -> float:
    """Return Cauchy's cost of values that are dark but lit by the surface found, or bright but in its cast shadow.

    It counts from where it is more than borders of shadows make. What lit values lack is their Lambertian part: without
    a highlight, a mirror is dark in the light, too.
    """
    points = surface_points(pictures, joint.normals)
    hidden = occluded(pictures, points, _towards(joint, points))
    dark = (pictures.usable > 0) & (pictures.lit <= 0)
    wrong = np.where(hidden, pictures.lit > 0, dark)
    matt = joint.foreseen(joint.lambertian).mean(axis=2)
    off = np.where(hidden, pictures.gray, np.maximum(matt - pictures.gray, 0.0))
    width = np.asarray(squared_width(np.maximum(pictures.gray, pictures.usual[:, None]), pictures.noise))
    cost = np.log1p(off[wrong] ** 2 / width[wrong]).sum()
    return float(max(cost - TOLERATED * wrong.size * np.log1p(1 / WIDTH**2), 0.0))


def occluded(pictures: Pictures, points: Array, towards: Array) -> NDArray[np.bool_]:
    """Return which points (P, 3) of a surface, camera space, it hides itself from which lights (P, L, 3)."""
    camera = dataclasses.replace(pictures.camera, to_world=np.eye(4))
    depth = np.full(pictures.mask.shape, np.inf)
    depth[pictures.mask] = ((points - pictures.rays[:, :3]) * pictures.rays[:, 3:]).sum(axis=1)
    pixel = float(np.median(camera.pixel_size(depth[pictures.mask])))
    hidden = np.zeros(towards.shape[:2], bool)
    for away in np.linspace(BESIDE * pixel, float(np.ptp(points, axis=0).max()), STEPS):
        place, along = camera.project(points[:, None] + away * towards)
        column, row = np.moveaxis(np.floor(place).astype(np.int64), 2, 0)
        inside = (row >= 0) & (row < depth.shape[0]) & (column >= 0) & (column < depth.shape[1])
        surface = depth[np.where(inside, row, 0), np.where(inside, column, 0)]
        hidden |= inside & (along > surface + BESIDE * pixel)
    return hidden


def _towards(joint: Joint, points: Array) -> Array:
    """Return the unit directions (P, L, 3) from points to the lights."""
    if not joint.near:
        return np.broadcast_to(directions(joint.lights), (len(points), *joint.vectors.shape))
    there = joint.centre + places(joint.lights) - points[:, None]
    return np.asarray(there / np.linalg.norm(there, axis=2, keepdims=True))
