"""Where the lobe model misses something that is not noise, the surfaces' direct comparison decides on the depth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..progress import Progress, Work
from . import joint
from .coarse_to_fine import BLOCK, Solution, Views, neighbours_at, refit
from .lobe import UNKNOWNS
from .pairwise import compare_surfaces

WORTH_WHILE = 1e-4  # relative misfit below which the model's depth is already right to 0.01 % and better
STRUCTURE = 0.1  # share of the misfit that the comparison explains, median of a neighbourhood, above which it decides
REACHES = (1, 2, 3)  # the neighbourhood: eight pixels at each of these distances
FIRM = 1e-4  # how firmly a compared depth is held while the normal is fitted again, share of the ray inside the lights


def compare(views: Views, surface: NDArray[np.int64], solution: Solution) -> Work[NDArray[np.float64]]:
    """Replace depths by those at which both surfaces agree, where the model explains the pictures badly.

    Noise and misfit are told apart without truth: noise cannot be predicted from neighbouring directions, a function
    that the model misses can. The share that is predicted is taken as the median over a pixel's neighbourhood.

    Parameters
    ----------
    views : Views
    surface : (L,) int64
        0 for lights on the inner surface, 1 on the outer.
    solution : Solution
        Changed in place.

    Returns
    -------
    explained : (P,) float64
        The share of the misfit that the comparison explains; NaN where it was not made.
    """
    pixels = np.flatnonzero((solution.kind != joint.NONE) & (solution.spread > WORTH_WHILE))
    depths = solution.state[:, 0].copy()
    explained = np.full(len(depths), np.nan)
    for start in range(0, len(pixels), BLOCK):
        part = pixels[start : start + BLOCK]
        depths[part], explained[part] = compare_surfaces(
            part, solution.state, solution.kind, solution.spread, views.rays, views.near, views.far,
            views.values, views.positions, surface, views.noise, views.bounced,
        )  # fmt: skip
        yield Progress("compare", min(start + BLOCK, len(pixels)), len(pixels), "pixels")
    decided = pixels[_neighbourhood_median(views.mask, explained, pixels) > STRUCTURE]
    decided = decided[np.isfinite(explained[decided])]
    expected, precision = np.zeros((2, len(decided), UNKNOWNS))
    expected[:, 0] = depths[decided]
    precision[:, 0] = (FIRM * (views.far - views.near)[decided]) ** -2
    fitted, stated = solution.state[decided, 0], solution.deviation[decided]
    refit(views, solution, decided, expected, precision, np.inf)
    solution.state[decided, 0] = depths[decided]
    # The refit states how firmly the depth was held. It is doubtful as before, and by as much as it had to move.
    solution.deviation[decided] = np.maximum(stated, np.abs(depths[decided] - fitted))
    return explained


def _neighbourhood_median(
    mask: NDArray[np.bool_], values: NDArray[np.float64], pixels: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the median over a neighbourhood of values that are NaN where there are none."""
    around = np.concatenate([neighbours_at(mask, pixels, reach) for reach in REACHES] + [pixels[:, None]], axis=1)
    found = np.where(around >= 0, values[around], np.nan)
    median = np.full(len(pixels), np.nan)
    some = np.isfinite(found).any(axis=1)
    median[some] = np.nanmedian(found[some], axis=1)
    return median
