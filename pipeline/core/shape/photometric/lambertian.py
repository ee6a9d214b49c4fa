"""The start of every photometric method: the normal of a Lambertian surface, by plain and by robust least squares.

For a Lambertian surface y = (albedo / pi) n.wi, linear in b = (albedo / pi) n (Woodham 1980). Highlights, shadows
and interreflections break that. The robust fit trusts the middle of a pixel's sorted values first, where neither
shadow nor highlight lies (Wu et al. 2010 keep such a band, too), then every light as far as it agrees.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ...compiled import kernel, parallel_kernel
from .sight import Sight, directions

DARK = 0.05  # of the pixel's 90th percentile: below it a light counts as shadowed
BAND = (0.3, 0.6)  # quantiles of the lit values that the first fit takes
ROUNDS = 8
TIGHT = 0.05  # relative misfit at which a value has half its weight at the end
FEWEST = 3


def plain(sight: Sight) -> NDArray[np.float64]:
    """Return b (P, 3) by least squares over all usable lights; NaN where fewer than three directions are."""
    return _run(sight, False)


def robust(sight: Sight) -> NDArray[np.float64]:
    """Return b (P, 3) by robust least squares; NaN where fewer than three lights are lit."""
    return _run(sight, True)


def _run(sight: Sight, is_robust: bool) -> NDArray[np.float64]:
    out = np.empty((len(sight.values), 3))
    gray = np.ascontiguousarray(sight.values.mean(axis=2))
    _fit(sight.lights, sight.near, sight.points, sight.views, gray, sight.usable, is_robust, out)
    return out


@parallel_kernel
def _fit(
    lights: NDArray[np.float64],
    near: bool,
    points: NDArray[np.float64],
    views: NDArray[np.float64],
    values: NDArray[np.float32],
    usable: NDArray[np.float32],
    is_robust: bool,
    out: NDArray[np.float64],
) -> None:
    count = lights.shape[0]
    for p in prange(points.shape[0]):
        to_light, half, difference = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
        weight = np.empty(count)
        directions(points[p], views[p], lights, near, to_light, half, difference)
        weight[:] = usable[p]
        if not is_robust:
            _least_squares(to_light, values[p], weight, out[p])
            continue
        seen = np.sort(values[p][usable[p] > 0.0])
        if seen.size < FEWEST:
            out[p] = np.nan
            continue
        dark = DARK * seen[int(0.9 * (seen.size - 1))]
        first = np.searchsorted(seen, dark, side="right")
        lit = seen.size - first
        if lit < FEWEST:
            out[p] = np.nan
            continue
        room = max(int((BAND[1] - BAND[0]) * lit), FEWEST + 1)
        start = min(int(BAND[0] * lit), max(lit - room, 0))
        low, high = seen[first + start], seen[first + min(start + room, lit) - 1]
        for k in range(count):
            if not low <= values[p, k] <= high:
                weight[k] = 0.0
        _least_squares(to_light, values[p], weight, out[p])
        for r in range(ROUNDS):
            _reweigh(to_light, values[p], usable[p], out[p], dark, TIGHT * 2.0 ** max(3 - r, 0), weight)
            _least_squares(to_light, values[p], weight, out[p])


@kernel
def _reweigh(
    to_light: NDArray[np.float64],
    values: NDArray[np.float32],
    usable: NDArray[np.float32],
    b: NDArray[np.float64],
    dark: float,
    width: float,
    weight: NDArray[np.float64],
) -> None:
    """Weigh every value by how far it agrees with the fit, relative to the fit's own brightest value."""
    scale = math.sqrt(b[0] ** 2 + b[1] ** 2 + b[2] ** 2)
    if not scale > 0.0:
        return
    for k in range(weight.size):
        foreseen = b[0] * to_light[k, 0] + b[1] * to_light[k, 1] + b[2] * to_light[k, 2]
        miss = (values[k] - max(foreseen, 0.0)) / (width * scale)
        weight[k] = usable[k] / (1.0 + miss * miss) ** 2 if values[k] > dark else 0.0


@kernel
def _least_squares(
    to_light: NDArray[np.float64], values: NDArray[np.float32], weight: NDArray[np.float64], b: NDArray[np.float64]
) -> None:
    """Solve the weighted normal equations of three unknowns by Cholesky; leave b as it is where they have no solution.

    A pivot below 1e-9 of its diagonal says that the lights lie in a plane through the point.
    """
    system = np.zeros((3, 4))
    for k in range(weight.size):
        for i in range(3):
            for j in range(i + 1):
                system[i, j] += weight[k] * to_light[k, i] * to_light[k, j]
            system[i, 3] += weight[k] * to_light[k, i] * values[k]
    for i in range(3):
        for j in range(i):
            for r in range(j):
                system[i, j] -= system[i, r] * system[j, r]
            system[i, j] /= system[j, j]
        square = system[i, i]
        for r in range(i):
            square -= system[i, r] * system[i, r]
        if not square > 1e-9 * system[i, i]:
            b[:] = np.nan
            return
        system[i, i] = math.sqrt(square)
        for r in range(i):
            system[i, 3] -= system[i, r] * system[r, 3]
        system[i, 3] /= system[i, i]
    for i in range(2, -1, -1):
        b[i] = system[i, 3]
        for j in range(i + 1, 3):
            b[i] -= system[j, i] * b[j]
        b[i] /= system[i, i]
