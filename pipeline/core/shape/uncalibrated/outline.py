"""What an object's outline tells of its normals: at the rim they stand across the view, within it lies a dome.

Where a smooth body turns away from the camera, its normal lies in the picture's plane and along the outline's normal
(Marr 1977). A mask says where that is, but not where it is cut off by the ground, another object or the picture's
border; whoever uses these normals weighs them robustly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.ndimage import distance_transform_edt, gaussian_filter

from .. import multigrid
from ..tangents import neighbour_pairs

BLUR = 2.0  # of the mask, of which the outline's direction is the gradient [px]
RIM = 1.5  # distance from the outline up to which a pixel belongs to the rim [px]
BORDER = 3  # of the picture, where a mask's end is no outline [px]
TOLERANCE = 1e-3


@dataclass(frozen=True)
class Outline:
    """The outline as the P pixels of a mask see it, camera space.

    Parameters
    ----------
    dome : (P, 3) float64
        Unit normals of the dome over the mask.
    along : (P, 3) float64
        Unit direction across the view in which the nearest outline runs.
    rim : (P,) bool
        Which pixels lie at it.
    """

    dome: NDArray[np.float64]
    along: NDArray[np.float64]
    rim: NDArray[np.bool_]


def outline(mask: NDArray[np.bool_], views: NDArray[np.float64]) -> Outline:
    """Return what a mask (H, W) of P pixels tells that see along the unit directions -views, (P, 3)."""
    away = distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    down, right = np.gradient(gaussian_filter(mask.astype(np.float64), BLUR))
    out = np.stack([-right, down, np.zeros(mask.shape)], axis=-1)[mask]
    out -= (out * views).sum(axis=1, keepdims=True) * views
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
    inside = np.zeros(mask.shape, bool)
    inside[BORDER:-BORDER, BORDER:-BORDER] = True
    return Outline(_dome(mask, views), np.cross(views, out), (away[mask] <= RIM) & inside[mask])


def _dome(mask: NDArray[np.bool_], views: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normals of a dome: z = sqrt(2 u), a ball over a disk, with the Laplacian of u -2 and u = 0 outside."""
    places = np.argwhere(mask)
    pairs = np.concatenate(neighbour_pairs(mask))
    both = np.concatenate([pairs, pairs[:, ::-1]]).T
    matrix = sparse.coo_array((np.full(both.shape[1], -1.0), tuple(both)), shape=(len(places), len(places)))
    matrix = (matrix + sparse.diags_array(np.full(len(places), 4.0))).tocsr()
    height = np.zeros(mask.shape)
    height[mask] = np.maximum(multigrid.solve(matrix, np.full(len(places), 2.0), places, TOLERANCE), 1e-9)
    down, right = np.gradient(height)
    across = np.stack([-right, down], axis=-1)[mask]
    rise = np.sqrt(2.0 * height[mask])[:, None]
    up, side = np.cross(views, [1.0, 0.0, 0.0]), np.cross([0.0, 1.0, 0.0], views)
    normals = across[:, :1] * side + across[:, 1:] * up + rise * views
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))
