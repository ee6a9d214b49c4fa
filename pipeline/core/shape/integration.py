"""Surfaces from normals, with depth edges kept, alone or together with measured depths.

Every pair of neighbours predicts a change of depth from its normals (:mod:`.tangents`), every measured depth a depth.
All of them are solved in the least squares sense, weighted by how well they agreed with the solution before. A pair
counts with Geman and McClure's weight 1 / (1 + (r / EDGE)^2)^2 of its residual r, so that a depth edge pulls at
nobody; a measured depth counts with Cauchy's, so that a wrong one gives way to its neighbours. The scale EDGE follows
how well measured depths fulfil the equations, for sharp ones show lower edges, and is wider at first where they are
stated to be doubtful.

Such weights keep what they start with. Where depths are measured, they start with those. Where none are, they start
with the curl of the normals, which is zero on any surface and shows the depth edges before anything is solved. What no
normal tells: the height of an edge that is equally high along its length, and the level of a part that is joined to
no other; it is put where the rest is.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ..camera import Camera
from ..errors import LightsphereError
from . import multigrid
from .tangents import Rises, curl, disagreement, rises

Vector = NDArray[np.float64]

ROUNDS = 12  # of reweighting at most
SETTLED = 1e-4  # change [footprints] of 95 % of the pixels that ends the rounds
TOLERANCE = 1e-3  # of each round's system
EDGES = (0.03, 0.2)  # residual [footprints] beyond which a pair is a depth edge: of sharply measured depths, of none
SCATTER = 3.0  # median residuals of measured depths that are no edge yet
DOUBT = (0.3, 0.5)  # how far stated deviations widen that scale in the first round, and by how much less in each later
EDGE_CURL = 0.06  # curl [footprints] beyond which a depth edge is expected
PAIR_ERROR = 0.04  # deviation [footprints] of a pair's equation by curvature and wrong normals
LEAST_WEIGHT = 1e-6  # of a pair: parts that are joined by depth edges alone keep a level
DEVIATIONS = (1e-5, 30.0)  # least and most of a measured depth [footprints]
DOUBTFUL = 3.0  # deviations beyond which a measured depth counts for less
INERTIA = 1e-9  # share of a pair's weight by which every pixel stays where it is: the system is regular


def integrate(
    normal: NDArray[Any],
    mask: NDArray[np.bool_],
    camera: Camera,
    confidence: NDArray[Any] | None = None,
    depth: NDArray[Any] | None = None,
    deviation: NDArray[Any] | None = None,
) -> NDArray[np.float64]:
    """Return the depth along the ray of every pixel whose normal is known.

    Parameters
    ----------
    normal : (H, W, 3) float
        Unit normals, camera space (x right, y up, z to the viewer); NaN where unknown.
    mask : (H, W) bool
        The pixels of the object.
    camera : Camera
        Orthographic or pinhole.
    confidence : (H, W) float, optional
        How far each normal is to be believed, 0 to 1; 1 where left out. A pair counts with the lesser of its two.
    depth : (H, W) float, optional
        Measured ray lengths [m]; NaN where there is none: such pixels follow from their neighbours.
    deviation : (H, W) float, optional
        Standard deviation of each measured depth [m], NaN or infinite where it is not to be used. Where left out,
        the median of the depths' disagreement with their neighbours' tangent planes stands for all.

    Returns
    -------
    (H, W) float64
        Ray lengths [m]; NaN outside the mask and where the normal is unknown. A connected part of the mask without
        any measured depth is put about the median measured depth, or, where nothing is measured, about the depth of
        the world's origin. Normals alone leave the shift (orthographic) or the scale (pinhole) of each part open.

    Raises
    ------
    LightsphereError
        When the pictures' sizes differ, or no pixel of the mask has a normal.
    """
    pictures = {"mask": mask, "confidence": confidence, "depth": depth, "deviation": deviation}
    for name, picture in pictures.items():
        if picture is not None and picture.shape != normal.shape[:2]:
            raise LightsphereError(f"the {name} has the shape {picture.shape}, the normals {normal.shape}; match them")
    known = mask & np.isfinite(normal).all(axis=-1)
    if not known.any():
        raise LightsphereError("no pixel of the mask has a normal; recover normals first, or correct the mask")
    pinhole = camera.model == "pinhole"
    footprint = 1.0 / camera.focal[0]
    rays = np.concatenate([part[known] for part in camera.rays()], axis=1)
    world = camera.normals_to_world(normal[known])
    found = rises(known, rays, world, pinhole)
    measured, spread = np.full((2, len(rays)), np.nan)
    if depth is not None:
        measured = depth[known].astype(np.float64)
        if deviation is None:
            apart = disagreement(known, rays, measured, world, pinhole)
            spread[:] = _typical(apart)
        else:
            spread = deviation[known].astype(np.float64)
        if pinhole:
            measured, spread = np.log(np.where(measured > 0, measured, np.nan)), spread / measured
        measured = np.where(np.isfinite(spread), measured, np.nan)
    spread = np.clip(spread, *np.multiply(DEVIATIONS, footprint))
    trust = np.ones(len(rays)) if confidence is None else np.clip(confidence[known].astype(np.float64), 0.0, 1.0)
    system = _System(found, np.argwhere(known), trust, measured, spread)
    unknown = system.solve(_weight(curl(found, known) / EDGE_CURL), SETTLED * footprint)
    result = np.full(known.shape, np.nan)
    result[known] = system.levelled(unknown, _origin(camera))
    return np.exp(result) if pinhole else result


def _origin(camera: Camera) -> float:
    """Return the unknown at the depth of the world's origin, or at 1 m where a pinhole camera looks away from it."""
    depth = float(camera.to_world[:3, 3] @ camera.to_world[:3, 2])
    if camera.model == "pinhole":
        return float(np.log(depth)) if depth > 0 else 0.0
    return depth


class _System:
    """The equations of all pairs and all measured depths, in the unknown of :mod:`.tangents`."""

    def __init__(
        self, found: Rises, places: NDArray[np.int64], trust: Vector, measured: Vector, deviation: Vector
    ) -> None:
        self.found = found
        self.places = places
        self.has = np.isfinite(measured)
        self.middle = float(np.median(measured[self.has])) if self.has.any() else 0.0
        self.measured = np.where(self.has, measured, self.middle)
        self.deviation = np.where(self.has, deviation, 1.0)
        i, j = found.pairs.T
        self.certainty = np.minimum(trust[i], trust[j]) * (found.facing / (PAIR_ERROR * found.footprint)) ** 2
        rows = np.tile(np.arange(len(i)), 2)
        entries = (np.repeat([-1.0, 1.0], len(i)), (rows, np.concatenate([i, j])))
        self.both = self.has[found.pairs].all(axis=1)
        scatter = float(np.median(np.abs(found.off(self.measured)[self.both]))) if self.both.any() else np.inf
        self.edge = float(np.clip(SCATTER * scatter, *EDGES))
        self.difference = sparse.csr_array(entries, shape=(len(i), len(places)))

    def solve(self, weight: Vector, settled: float) -> Vector:
        """Return the unknowns, starting from pairs' weights that hold where depths are not measured."""
        unknown = self.measured.copy()
        i, j = self.found.pairs.T
        apart = np.hypot(self.deviation[i], self.deviation[j]) * self.found.facing / self.found.footprint
        doubt = np.where(self.both, DOUBT[0] * apart, 0.0)
        weight = np.where(self.both, _weight(self.found.off(unknown) / np.hypot(self.edge, doubt)), weight)
        for _ in range(ROUNDS):
            change = self._step(unknown, weight)
            unknown += change
            if np.percentile(np.abs(change), 95) < settled:
                break
            doubt *= DOUBT[1]
            weight = _weight(self.found.off(unknown) / np.hypot(self.edge, doubt))
        return unknown

    def _step(self, unknown: Vector, weight: Vector) -> Vector:
        """Return the change of one round. What is right already stays right to the last digit."""
        pair = weight * self.certainty
        off = unknown - self.measured
        own = self.has / (self.deviation**2 + (off / DOUBTFUL) ** 2)
        still = INERTIA * float(pair.mean()) if len(pair) else 1.0
        weighted = self.difference.T @ sparse.diags_array(pair)
        left = weighted @ self.difference + sparse.diags_array(own + still)
        right = weighted @ (self.found.rise - self.difference @ unknown) - own * off
        return multigrid.solve(left.tocsr(), right, self.places, TOLERANCE)

    def levelled(self, unknown: Vector, origin: float) -> Vector:
        """Put connected parts without any measured depth about the others' median, or about the world's origin."""
        i, j = self.found.pairs.T
        graph = sparse.coo_array((np.ones(len(i), np.int8), (i, j)), shape=(len(unknown), len(unknown)))
        parts, part = connected_components(graph, directed=False)
        size = np.bincount(part, minlength=parts)
        mean = np.bincount(part, unknown, minlength=parts) / size
        free = np.bincount(part, self.has, minlength=parts) == 0
        level = self.middle if self.has.any() else origin
        return np.asarray(unknown + np.where(free, level - mean, 0.0)[part])


def _weight(residual: Vector) -> Vector:
    """Return Geman and McClure's (1985) weight of a residual over its scale."""
    return np.maximum((1.0 + residual**2) ** -2, LEAST_WEIGHT)


def _typical(apart: Vector) -> float:
    """Return the median of what is finite; 0 where nothing is."""
    finite = apart[np.isfinite(apart)]
    return float(np.median(finite)) if len(finite) else 0.0
