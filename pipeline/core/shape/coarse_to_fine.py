"""The order in which pixels are fitted: a coarse grid blindly, finer ones from their neighbours, then in company.

Every sweep reads the previous one, so results do not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..progress import Progress, Work
from . import joint
from .fit import EXACT
from .lobe import BOUNCED, DIFFUSE, DIRECT_UNKNOWNS, LOG_ALPHA, STATE, UNKNOWNS

GRIDS = (8, 4, 2, 1)
BLOCK = 2048  # pixels solved between two reports of progress
COMPANY_ROUNDS = 3
DIRECT_SHARE = 0.15  # of a pixel's 95th percentile: what is darker is taken for bounced light at first
BOUNCED_ROUNDS = 2
FIRST_BOUNCED = 0.1  # of the diffuse reflectance: where the fit of bounced light starts
COMPANY_REACH = (1, 3, 6)  # distances [px] of the neighbours whose lobes a pixel is compared with
COMPANY_TRUST = (
    4.0  # a lobe is expected within half of its neighbours' spread: rounds tighten where pictures leave it open
)
OFFSETS = tuple((r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if (r, c) != (0, 0))


@dataclass
class Solution:
    """The joint fit of P pixels.

    Parameters
    ----------
    state : (P, 13) float64
        depth [m], normal in the world, log alpha, kappa, kd, k0, k1, bounced light; see :mod:`.lobe`.
    score : (P,) float64
        Mean Cauchy cost at one per cent of the median root; infinite where not solved.
    spread : (P,) float64
        Robust standard deviation of the cube roots over their median.
    deviation : (P,) float64
        Standard deviation of the depth [m] as the fit's curvature states it.
    kind : (P,) int8
        0 not solved, 1 diffuse only, 2 with a lobe.
    """

    state: NDArray[np.float64]
    score: NDArray[np.float64]
    spread: NDArray[np.float64]
    deviation: NDArray[np.float64]
    kind: NDArray[np.int8]

    @classmethod
    def empty(cls, pixels: int) -> Solution:
        """Return a solution in which nothing is solved."""
        unknown = [np.full(pixels, np.inf) for _ in range(3)]
        return cls(np.zeros((pixels, STATE)), unknown[0], unknown[1], unknown[2], np.zeros(pixels, np.int8))


@dataclass(frozen=True)
class Views:
    """What is given for P pixels.

    Parameters
    ----------
    mask : (H, W) bool
        P pixels, numbered in row order.
    rays : (P, 6) float64
        Origin [m] and unit direction of each pixel's ray.
    near, far : (P,) float64
        Limits of the depth [m].
    values : (P, L) float32
        Cube root of picture value over intensity; 0 where unlit or not to be used, negative where rounded to 0 from
        at most that.
    positions : (L, 3) float64
        The lights [m].
    noise : (P,) float64
        Standard deviation of each pixel's noise floor, in value over intensity; bounced light that no model foresees
        counts as such.
    bounced : bool
        Whether the values hold light that other surfaces sent on.
    """

    mask: NDArray[np.bool_]
    rays: NDArray[np.float64]
    near: NDArray[np.float64]
    far: NDArray[np.float64]
    values: NDArray[np.float32]
    positions: NDArray[np.float64]
    noise: NDArray[np.float64]
    bounced: bool


def neighbours_at(mask: NDArray[np.bool_], pixels: NDArray[np.int64], distance: int) -> NDArray[np.int64]:
    """Return the numbers of the eight neighbours at a distance [px] of some of a mask's pixels, (N, 8); -1 for none."""
    index = np.full(mask.shape, -1, np.int64)
    index[mask] = np.arange(mask.sum())
    places = np.argwhere(mask)[pixels]
    found = np.full((len(pixels), len(OFFSETS)), -1, np.int64)
    for k, (down, right) in enumerate(OFFSETS):
        rows, columns = places[:, 0] + down * distance, places[:, 1] + right * distance
        inside = (rows >= 0) & (rows < mask.shape[0]) & (columns >= 0) & (columns < mask.shape[1])
        found[inside, k] = index[rows[inside], columns[inside]]
    return found


def solve(views: Views, min_lit: int) -> Work[Solution]:
    """Fit depth, normal and lobe of every pixel with at least ``min_lit`` lit lights."""
    solution = Solution.empty(len(views.rays))
    values = direct_values(views) if views.bounced else views.values
    places = np.argwhere(views.mask)
    todo = np.ones(len(places), bool)
    total = (2 + COMPANY_ROUNDS) * len(places)
    done = 0
    for grid in (*GRIDS, 0):
        if grid:
            chosen = np.flatnonzero(todo & (places % grid == 0).all(axis=1))
            todo[chosen] = False
        else:  # a last sweep hands better solutions on
            chosen = np.flatnonzero(~(solution.spread < EXACT))
        for part in _sweep(views, values, False, solution, chosen, max(1, grid), min_lit):
            done += part
            yield Progress("shape", done, total, "pixels")
    done = 2 * len(places)  # the last sweep leaves out what is exact
    if views.bounced:
        yield from _with_bounced_light(views, solution, min_lit)
    yield from _in_company(views, solution, done, total)
    return solution


def _sweep(
    views: Views,
    values: NDArray[np.float32],
    bounced: bool,
    solution: Solution,
    chosen: NDArray[np.int64],
    distance: int,
    min_lit: int,
) -> Iterator[int]:
    """Solve some pixels from their neighbours at a distance; yield how many are done after each block."""
    around = np.concatenate([neighbours_at(views.mask, chosen, distance), chosen[:, None]], axis=1)
    before = (solution.state.copy(), solution.score.copy(), solution.kind.copy())
    for start in range(0, len(chosen), BLOCK):
        part = chosen[start : start + BLOCK]
        states, scores, kinds, summaries = joint.sweep(
            part, around[start : start + BLOCK], *before, views.rays, views.near, views.far, values,
            views.positions, views.noise, bounced, min_lit,
        )  # fmt: skip
        solution.state[part], solution.score[part], solution.kind[part] = states, scores, kinds
        solution.spread[part], solution.deviation[part] = summaries.T
        yield len(part)


def direct_values(views: Views, rows: int = 8192) -> NDArray[np.float32]:
    """Return the values with those left out that are so dark that bounced light may have made them."""
    direct = views.values.copy()
    for start in range(0, len(direct), rows):
        part = direct[start : start + rows]
        part[part < np.cbrt(DIRECT_SHARE) * np.quantile(part, 0.95, axis=1, keepdims=True)] = 0.0
    return direct


def _with_bounced_light(views: Views, solution: Solution, min_lit: int) -> Work[None]:
    """Fit all pixels again, on all values, with bounced light; shadowed values become outliers of the loss."""
    pixels = np.flatnonzero(solution.kind != joint.NONE)
    solution.state[pixels, BOUNCED] = FIRST_BOUNCED * solution.state[pixels, DIFFUSE]
    done = 0
    for _ in range(BOUNCED_ROUNDS):
        solution.score[:] = np.inf  # costs of other values, or of a state not yet refined: not to be compared with
        for part in _sweep(views, views.values, True, solution, pixels, 1, min_lit):
            done += part
            yield Progress("bounces", done, BOUNCED_ROUNDS * len(pixels), "pixels")


def _in_company(views: Views, solution: Solution, done: int, total: int) -> Work[None]:
    """Refit pixels whose pictures are noisy, expecting lobes like those of their neighbours."""
    for _ in range(COMPANY_ROUNDS):
        chosen = np.flatnonzero((solution.kind == joint.GLOSSY) & (solution.spread > EXACT))
        expected, precision = _neighbours_lobes(views.mask, solution, chosen)
        for start in range(0, len(chosen), BLOCK):
            part = slice(start, start + BLOCK)
            refit(views, solution, chosen[part], expected[part], precision[part], joint.CONTRADICTION)
            yield Progress("shape", done + min(start + BLOCK, len(chosen)), total, "pixels")
        done += len(views.rays)
        yield Progress("shape", done, total, "pixels")


def refit(
    views: Views,
    solution: Solution,
    pixels: NDArray[np.int64],
    expected: NDArray[np.float64],
    precision: NDArray[np.float64],
    contradiction: float,
) -> None:
    """Refine some pixels with what is known of their unknowns, unless that raises the misfit by more than a factor."""
    summaries = joint.sweep_known(
        pixels, solution.state, solution.score, solution.kind, views.rays, views.near, views.far,
        views.values, views.positions, views.noise, views.bounced, expected, precision, contradiction,
    )  # fmt: skip
    taken = np.isfinite(summaries[:, 0])
    solution.spread[pixels[taken]], solution.deviation[pixels[taken]] = summaries[taken].T


def _neighbours_lobes(
    mask: NDArray[np.bool_], solution: Solution, pixels: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return median and precision of the glossy neighbours' lobe parameters, (N, 12) each; 0 for all else."""
    around = np.concatenate([neighbours_at(mask, pixels, distance) for distance in COMPANY_REACH], axis=1)
    usable = (around >= 0) & (solution.kind[around] == joint.GLOSSY)
    lobes = np.where(usable[..., None], solution.state[around, LOG_ALPHA:BOUNCED], np.nan)
    expected, precision = np.zeros((2, len(pixels), UNKNOWNS))
    enough = usable.sum(axis=1) >= 5
    middle = np.nanmedian(lobes[enough], axis=1)
    spread = 1.4826 * np.nanmedian(np.abs(lobes[enough] - middle[:, None]), axis=1)
    lobe = slice(LOG_ALPHA - 1, DIRECT_UNKNOWNS)
    expected[enough, lobe] = middle
    unit = np.ones_like(middle)  # in which unknowns are small numbers
    unit[:, DIFFUSE - LOG_ALPHA :] = middle[:, DIFFUSE - LOG_ALPHA :].max(axis=1, keepdims=True)
    precision[enough, lobe] = COMPANY_TRUST / (spread**2 + 1e-6 * (1e-6 * unit**2 + middle**2))
    return expected, precision
