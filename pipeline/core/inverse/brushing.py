"""The direction in which a surface is brushed, from the picture alone: that in which reflections are smeared least.

Slopes are wide across the brushing. A normal n that tilts by s towards w turns what is reflected so that it is seen,
by a direction d, elsewhere by::

    2 s (w (n d) - n (w d))

For every direction of the brushing the picture has its derivative along the smear that would follow; the right one is
that along which it varies least (Boivin and Gagalowicz 2001 look for the smallest deviation along it, too). Not
modelled: curved surfaces, and that every rough reflection is long where it is seen at a grazing angle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion

from ..camera import Camera

Array = NDArray[np.float64]
ANGLES = np.arange(0.0, 180.0, 5.0)  # that are tried [degrees]
FLAT = 0.02  # of a surface's extent: farther from a plane it is not flat
FEWEST = 30  # pixels
FLOOR = 0.1  # of the mean radiance, below which differences count less
SMALL = 1e-3  # of the distance: a move that is seen as a straight one


def brushing(photograph: Array, mask: NDArray[np.bool_], positions: Array, uv: Array, camera: Camera) -> float | None:
    """Return the angle from a texture's U to the brushing [degrees, 0 to 180), None where the picture cannot tell.

    Parameters
    ----------
    photograph : (H, W, 3) float64
    mask : (H, W) bool
        The surface's pixels.
    positions : (H, W, 3) float64
        What they show, in world coordinates.
    uv : (H, W, 2) float64
        Its texture coordinates.
    camera : Camera
        Of H x W pixels.
    """
    inside = binary_erosion(mask, np.ones((3, 3)))
    if inside.sum() < FEWEST:
        return None
    places = positions[inside]
    unknowns = np.column_stack([np.ones(len(places)), uv[inside]])
    plane, *_ = np.linalg.lstsq(unknowns, places, rcond=None)
    off = places - unknowns @ plane
    along_u, along_v = plane[1:]
    normal = np.cross(along_u, along_v)
    if np.linalg.norm(off, axis=1).max() > FLAT * np.ptp(places, axis=0).max() or not normal.any():
        return None
    towards = places - camera.rays()[0][inside]
    distance = np.linalg.norm(towards, axis=1, keepdims=True)
    towards /= distance
    normal /= np.linalg.norm(normal)
    normal *= -np.sign(towards.mean(axis=0) @ normal)
    along_u = along_u / np.linalg.norm(along_u)
    across_u = np.cross(normal, along_u)
    light = np.log(photograph.mean(axis=-1) + FLOOR * photograph[mask].mean())
    down, right = (part[inside] for part in np.gradient(light))
    varied = []
    for angle in np.radians(ANGLES):
        wide = np.cos(angle) * across_u - np.sin(angle) * along_u
        smear = wide * (towards @ normal)[:, None] - normal * (towards @ wide)[:, None]
        moved = camera.project(places + SMALL * distance * smear)[0] - camera.project(places)[0]
        moved /= np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), 1e-30)
        varied.append(((right * moved[:, 0] + down * moved[:, 1]) ** 2).mean())
    return float(ANGLES[int(np.argmin(varied))])
