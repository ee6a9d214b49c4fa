"""The objective of one pixel against its depth: why its depth is what it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..capture import Capture
from ..errors import LightsphereError
from ..progress import Work
from . import joint, source
from .coarse_to_fine import Views, solve
from .double_sphere import views_of
from .fit import refine
from .lobe import DEPTH, UNKNOWNS
from .settings import ShapeSettings

AROUND = 7  # pixels to each side that are solved with it: their solutions are where its own begins
DEPTHS = 60  # along the ray, evenly, and as many closer and closer about the depth that was found
CLOSEST = 1e-5  # of the range of depths
ROOT_TO_VALUE = 300.0  # a cube root that is off by a share s is a value that is off by 3 s, in per cent


@dataclass(frozen=True)
class Profile:
    """What one pixel's pictures say about its depth.

    Parameters
    ----------
    depths : (N,) float64
        Ascending [m].
    joint : (N,) float64
        Robust deviation between the pictures and the reflectance function that fits them best at each depth [%].
    source : (N,) float64
        Root of the source's objective (Magda et al. 2001, equation 5) over the RMS of the values in it [%]; infinite
        where no outer light is seen through the inner surface.
    depth, deviation : float
        What the fit finds, and the standard deviation that it states [m].
    lit : int
        How many lights reach the pixel.
    """

    depths: NDArray[np.float64]
    joint: NDArray[np.float64]
    source: NDArray[np.float64]
    depth: float
    deviation: float
    lit: int


def profile(capture: Capture, row: int, column: int, settings: ShapeSettings) -> Work[Profile]:
    """Fit a pixel's reflectance function at every depth along its ray, and evaluate the source's objective there.

    At each depth the fit begins where it ended at the depth next to it, from the best depth outwards: what is shown is
    the objective with all unknowns but depth at their best, as far as that is reached from there.

    Parameters
    ----------
    capture : Capture
        Near lights on two surfaces.
    row, column : int
        The pixel, from the top left corner.
    settings : ShapeSettings

    Raises
    ------
    LightsphereError
        When the pixel lies outside of the object, or fewer than ``settings.min_lit`` lights reach it.
    """
    mask = capture.mask()
    if not (0 <= row < mask.shape[0] and 0 <= column < mask.shape[1] and mask[row, column]):
        raise LightsphereError(f"the pixel in row {row}, column {column} does not show the object; choose another")
    window = np.zeros_like(mask)
    part = (slice(max(row - AROUND, 0), row + AROUND + 1), slice(max(column - AROUND, 0), column + AROUND + 1))
    window[part] = mask[part]
    views, _ = yield from views_of(capture, window, settings)
    solution = yield from solve(views, settings.min_lit)
    own = int(np.flatnonzero((np.argwhere(window) == (row, column)).all(axis=1))[0])
    lit = int((views.values[own] > 0).sum())
    if solution.kind[own] == joint.NONE:
        raise LightsphereError(
            f"only {lit} lights reach the pixel in row {row}, column {column}, and {settings.min_lit} are needed; "
            "choose another, or lower --min-lit"
        )
    depth = float(solution.state[own, DEPTH])
    depths = _depths(float(views.near[own]), float(views.far[own]), depth)
    misfit = _fits(views, own, solution.state[own], bool(solution.kind[own] == joint.GLOSSY), depths, settings.min_lit)
    lights = (capture.lights.on("inner"), capture.lights.on("outer"))
    theirs = _source(views, own, *lights, depths)
    return Profile(depths, misfit, theirs, depth, float(solution.deviation[own]), lit)


def _depths(near: float, far: float, depth: float) -> NDArray[np.float64]:
    """Return depths along a ray, evenly and about the one that was found."""
    close = (far - near) * np.geomspace(CLOSEST, 0.1, DEPTHS // 2)
    depths = np.concatenate([np.linspace(near, far, DEPTHS), depth - close, [depth], depth + close])
    return np.unique(depths[(depths >= near) & (depths <= far)])


def _fits(
    views: Views, own: int, state: NDArray[np.float64], glossy: bool, depths: NDArray[np.float64], min_lit: int
) -> NDArray[np.float64]:
    """Return the deviation (N,) [%] that fits with a given depth leave."""
    nothing = np.zeros(UNKNOWNS)
    pixel = joint.gather(
        views.values[own], views.rays[own], views.near[own], views.far[own], views.positions, views.noise[own],
        views.bounced, nothing, nothing, min_lit,
    )  # fmt: skip
    summary = np.empty(2)
    misfit = np.empty(len(depths))
    best = int(np.argmin(abs(depths - state[DEPTH])))
    for order in (range(best, len(depths)), range(best - 1, -1, -1)):
        moving = state.copy()
        for k in order:
            moving[DEPTH] = depths[k]
            fixed = pixel._replace(near=depths[k], far=depths[k])  # limits that leave the depth no room
            refine(moving, glossy, fixed, joint.FULL, joint.STEPS, summary)
            misfit[k] = ROOT_TO_VALUE * summary[0] / pixel.middle
    return misfit


def _source(
    views: Views, own: int, inner: NDArray[np.int64], outer: NDArray[np.int64], depths: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the source's objective (N,) [%]."""
    values = np.maximum(views.values[own].astype(np.float64), 0.0) ** 3
    order = np.concatenate([inner, outer])
    positions = views.positions
    triangles = source.triangulate(positions[inner])
    last = np.zeros(len(outer), np.int64)
    found = np.empty(len(depths))
    for k, depth in enumerate(depths):
        arguments = (depth, views.rays[own], values[order], positions[inner], positions[outer], triangles, last)
        point = views.rays[own, :3] + depth * views.rays[own, 3:]
        squares = ((positions[outer] - point) ** 2).sum(axis=1)
        usual = np.sqrt(((squares * values[outer]) ** 2).mean())
        found[k] = 100.0 * np.sqrt(source.objective(*arguments)) / max(usual, 1e-300)
    return found
