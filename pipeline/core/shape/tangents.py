"""What the tangent planes of neighbouring pixels say about their depths, linear in one unknown per pixel.

Let P_i = o_i + l_i r_i be the point on the ray of pixel i and n the mean normal of two neighbours. Then
n.(P_j - P_i) = 0 up to the third order of their distance, and exactly on spheres and planes. It is an equation in the
difference of the unknowns u_j - u_i, with u = l where rays are parallel and u = log l where they leave one point::

    orthographic   l_j - l_i         = n.(o_i - o_j) / n.r
    pinhole        log l_j - log l_i = log(n.r_i / n.r_j)

so that a surface is fixed up to a shift or a scale, as it must be (Durou, Falcone, Sagona 2009, for the logarithm).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LEAST_FACING = 0.05  # cosine of view and normal; what is steeper is taken for this steep, 87 degrees
TELLING = 0.15  # cosine below which a pair says nothing about how good a depth is


@dataclass(frozen=True)
class Rises:
    """The change of the unknown from pixel to neighbouring pixel that normals predict.

    Parameters
    ----------
    pairs : (N, 2) int64
        Numbers of the two pixels: first the pairs side by side, then those one above the other, each in row order.
    beside : int
        How many pairs are side by side.
    rise : (N,) float64
        Predicted u_j - u_i.
    footprint : (N,) float64
        Distance of the two rays, in the unit of u: [m] at any depth, or [m] per metre of depth.
    facing : (N,) float64
        Cosine of view and mean normal.
    """

    pairs: NDArray[np.int64]
    beside: int
    rise: NDArray[np.float64]
    footprint: NDArray[np.float64]
    facing: NDArray[np.float64]

    def off(self, unknown: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return by how much unknowns (P,) contradict the predictions, across the surface, in footprints, (N,)."""
        i, j = self.pairs.T
        return np.asarray((unknown[j] - unknown[i] - self.rise) * self.facing / self.footprint)


def neighbour_pairs(mask: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the numbers of all pixels of a mask that are neighbours side by side, and one above the other, (N, 2)."""
    index = np.full(mask.shape, -1, np.int64)
    index[mask] = np.arange(int(mask.sum()))
    beside = np.stack([index[:, :-1], index[:, 1:]], axis=-1).reshape(-1, 2)
    above = np.stack([index[:-1], index[1:]], axis=-1).reshape(-1, 2)
    return beside[(beside >= 0).all(axis=1)], above[(above >= 0).all(axis=1)]


def rises(mask: NDArray[np.bool_], rays: NDArray[np.float64], normal: NDArray[np.float64], pinhole: bool) -> Rises:
    """Return what the normals of P pixels predict for all pairs of neighbours.

    Parameters
    ----------
    mask : (H, W) bool
        P pixels, numbered in row order.
    rays : (P, 6) float64
        Origin [m] and unit direction of each pixel's ray.
    normal : (P, 3) float64
        Unit normals in the space of the rays; NaN gives NaN.
    pinhole : bool
        Whether all rays leave one point; they are parallel otherwise.
    """
    beside, above = neighbour_pairs(mask)
    pairs = np.concatenate([beside, above])
    i, j = pairs.T
    mean = normal[i] + normal[j]
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    facing_i, facing_j = (np.maximum(-(mean * rays[k, 3:]).sum(axis=1), LEAST_FACING) for k in (i, j))
    if pinhole:
        rise = np.log(facing_i / facing_j)
        footprint = np.linalg.norm(rays[j, 3:] - rays[i, 3:], axis=1)
    else:
        between = rays[j, :3] - rays[i, :3]
        rise = (mean * between).sum(axis=1) / facing_i
        footprint = np.linalg.norm(between, axis=1)
    return Rises(pairs, len(beside), rise, footprint, np.sqrt(facing_i * facing_j))


def curl(found: Rises, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return how little the predictions agree around the squares of four pixels beside each pair, (N,), in footprints.

    The smaller of the two squares' sums. Where a depth edge with a varying height runs between two pixels, it runs
    through both squares, and no depths can fulfil all eight predictions; a pair along the edge has a good square.
    """
    height, width = mask.shape
    places = np.argwhere(mask)[found.pairs[:, 0]]
    side, over = tuple(places[: found.beside].T), tuple(places[found.beside :].T)
    across, down = np.full((height, width - 1), np.nan), np.full((height - 1, width), np.nan)
    across[side], down[over] = found.rise[: found.beside], found.rise[found.beside :]
    around = np.abs(across[:-1] + down[:, 1:] - across[1:] - down[:, :-1])
    rows = np.pad(around, ((1, 1), (0, 0)), constant_values=np.nan)
    columns = np.pad(around, ((0, 0), (1, 1)), constant_values=np.nan)
    least = [np.fmin(rows[:-1], rows[1:])[side], np.fmin(columns[:, :-1], columns[:, 1:])[over]]
    return np.asarray(np.nan_to_num(np.concatenate(least)) * found.facing / found.footprint)


def disagreement(
    mask: NDArray[np.bool_],
    rays: NDArray[np.float64],
    depth: NDArray[np.float64],
    normal: NDArray[np.float64],
    pinhole: bool,
) -> NDArray[np.float64]:
    """Return how far each depth (P,) is from where its neighbours' tangent planes put it, (P,) [m].

    The second smallest of the distances to the neighbours, so that a depth edge beside a pixel does not count;
    infinite where there are fewer than two, or where the surface is too steep to tell.
    """
    found = rises(mask, rays, normal, pinhole)
    i, j = found.pairs.T
    unknown = np.log(depth) if pinhole else depth
    apart = np.abs(unknown[j] - unknown[i] - found.rise) * (np.fmin(depth[i], depth[j]) if pinhole else 1.0)
    apart = np.where(np.isfinite(apart) & (found.facing > TELLING), apart, np.inf)
    order = np.lexsort((np.concatenate([apart, apart]), np.concatenate([i, j])))
    owner, ascending = np.concatenate([i, j])[order], np.concatenate([apart, apart])[order]
    first = np.searchsorted(owner, np.arange(len(depth)))
    result = np.full(len(depth), np.inf)
    enough = np.bincount(owner, minlength=len(depth)) >= 2
    result[enough] = ascending[first[enough] + 1]
    return result
