"""What the lobe model misses, compared between the two surfaces without any model.

The logarithms of the ratio of measurement to model form a smooth function of the light's direction, whatever the BRDF.
At the right depth the lights of both surfaces sample the same function: each one's value is predicted from its nearest
directions among the other surface's lights by local linear regression, and the depth with the smallest differences
wins. That is the double covering of Magda et al. 2001, on ratios instead of radiances.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange

from ..compiled import kernel, parallel_kernel
from .joint import GLOSSY, gather
from .lobe import DEPTH, UNKNOWNS, evaluate, tangents

NEAREST = 7  # directions of the other surface that predict one
MOST_LEVERAGE = 0.6  # predictions that lean more than this on few neighbours extrapolate
FEWEST = 8  # predictions needed to judge a depth
REACH = (0.03, 0.2)  # searched to both sides of the model's depth, share of the ray's length inside the lights:
REACH_PER_SPREAD = 6.0  # this times the model's relative misfit, between these limits
COARSE, FINE = 16, 8  # depths to each side, first along the whole reach, then between its neighbours


@kernel
def log_ratios(state, glossy, pixel, depth, trial, directions, ratios):  # type: ignore[no-untyped-def]
    """Fill unit directions (N, 3) from the point at a depth and logarithms (N,) of measurement over model there."""
    trial[:] = state
    trial[DEPTH] = depth
    residuals = np.empty(len(ratios))
    evaluate(trial, glossy, pixel, 1.0, residuals, np.empty((0, UNKNOWNS)))
    for i in range(len(ratios)):
        predicted = pixel.roots[i] + residuals[i] / pixel.weights[i]
        ratios[i] = 3.0 * math.log(pixel.roots[i] / predicted) if predicted > 1e-3 * pixel.roots[i] else np.nan
        length = 0.0
        for k in range(3):
            directions[i, k] = pixel.lights[i, k] - pixel.ray[k] - depth * pixel.ray[3 + k]
            length += directions[i, k] ** 2
        for k in range(3):
            directions[i, k] /= math.sqrt(length)


@kernel
def predict(target, directions, ratios, others):  # type: ignore[no-untyped-def]
    """Predict the ratio in a direction by local linear regression on the nearest of the others; NaN where it cannot.

    The plane is fitted in the tangent plane of the target direction with weights (1 - (r / R)^2)^2 that reach zero at
    the next neighbour, so that the prediction changes smoothly with depth.
    """
    nearest = np.full(NEAREST + 1, -1)
    distances = np.full(NEAREST + 1, np.inf)
    for k in range(len(others)):
        j = others[k]
        if np.isnan(ratios[j]):
            continue
        gap = 0.0
        for i in range(3):
            gap += (directions[j, i] - target[i]) ** 2
        at = NEAREST
        if gap >= distances[at]:
            continue
        while at > 0 and distances[at - 1] > gap:
            distances[at] = distances[at - 1]
            nearest[at] = nearest[at - 1]
            at -= 1
        distances[at] = gap
        nearest[at] = j
    if nearest[NEAREST] < 0:
        return np.nan
    ax, ay, az, bx, by, bz = tangents(target[0], target[1], target[2])
    m00 = m01 = m02 = m11 = m12 = m22 = r0 = r1 = r2 = 0.0
    for k in range(NEAREST):
        j = nearest[k]
        weight = (1.0 - distances[k] / distances[NEAREST]) ** 2
        x = directions[j, 0] * ax + directions[j, 1] * ay + directions[j, 2] * az
        y = directions[j, 0] * bx + directions[j, 1] * by + directions[j, 2] * bz
        m00 += weight
        m01 += weight * x
        m02 += weight * y
        m11 += weight * x * x
        m12 += weight * x * y
        m22 += weight * y * y
        r0 += weight * ratios[j]
        r1 += weight * x * ratios[j]
        r2 += weight * y * ratios[j]
    # First row of the inverse of the symmetric 3 x 3 matrix: the value of the plane at the target.
    c0, c1, c2 = m11 * m22 - m12 * m12, m02 * m12 - m01 * m22, m01 * m12 - m02 * m11
    determinant = m00 * c0 + m01 * c1 + m02 * c2
    if not determinant > 1e-6 * m00 * m11 * m22:
        return np.nan
    leverage = c0 / determinant
    if leverage > MOST_LEVERAGE * 4.0 / max(m00, 1e-12):
        return np.nan
    return (c0 * r0 + c1 * r1 + c2 * r2) / determinant


@kernel
def differences(state, glossy, pixel, sides, depth, trial, out):  # type: ignore[no-untyped-def]
    """Write measured minus predicted log ratios at a depth to ``out``, NaN for no prediction; return the ratios."""
    count = len(pixel.roots)
    directions = np.empty((count, 3))
    ratios = np.empty(count)
    log_ratios(state, glossy, pixel, depth, trial, directions, ratios)
    inner, outer = np.flatnonzero(sides == 0), np.flatnonzero(sides == 1)
    for i in range(count):
        out[i] = ratios[i] - predict(directions[i], directions, ratios, outer if sides[i] == 0 else inner)
    return ratios


@kernel
def cost_of(found, scale):  # type: ignore[no-untyped-def]
    """Return the mean Geman-McClure loss of the differences, infinite where there are too few."""
    total = 0.0
    count = 0
    for d in found:
        if not np.isnan(d):
            total += d * d / (d * d + scale * scale)
            count += 1
    return total / count if count >= FEWEST else np.inf


@kernel
def spread_of(values):  # type: ignore[no-untyped-def]
    """Return the median of the absolute values that are numbers, infinite where they are too few."""
    usable = np.abs(values[~np.isnan(values)])
    return np.median(usable) if len(usable) >= FEWEST else np.inf


@kernel
def search(state, glossy, spread, pixel, sides):  # type: ignore[no-untyped-def]
    """Return the depth with the smallest differences about the model's, and the share of the misfit they explain.

    That share, 1 - median |difference| / median |log ratio|, is about 1 where the model misses a smooth function of
    direction and below 0 where it misses nothing but noise; NaN where the surfaces cannot be compared.
    """
    trial = np.empty(len(state))
    found = np.empty(len(pixel.roots))
    centre = state[DEPTH]
    reach = min(REACH[1], max(REACH[0], REACH_PER_SPREAD * spread)) * (pixel.far - pixel.near)
    smallest = np.inf
    for k in range(-COARSE, COARSE + 1):
        differences(state, glossy, pixel, sides, centre + reach * k / COARSE, trial, found)
        smallest = min(smallest, spread_of(found))
    if smallest == np.inf:
        return centre, np.nan
    scale = 3.0 * smallest + 1e-7
    best, lowest = centre, np.inf
    step = reach / COARSE
    for level in range(3):
        middle = best
        count = COARSE if level == 0 else FINE
        for k in range(-count, count + 1):
            depth = middle + step * k
            differences(state, glossy, pixel, sides, depth, trial, found)
            cost = cost_of(found, scale)
            if cost < lowest:
                best, lowest = depth, cost
        step *= 2.0 / FINE
    ratios = differences(state, glossy, pixel, sides, best, trial, found)
    predicted = ~np.isnan(found)
    misfit = np.median(np.abs(ratios[predicted]))
    return best, 1.0 - np.median(np.abs(found[predicted])) / max(misfit, 1e-12)


@parallel_kernel
def compare_surfaces(  # type: ignore[no-untyped-def]
    pixels, states, kinds, spreads, rays, near, far, values, positions, surface, noise, bounced
):
    """Return for some solved pixels the depths and explained shares of :func:`search`."""
    depths, explained = np.empty(len(pixels)), np.empty(len(pixels))
    nothing = np.zeros(UNKNOWNS)
    for i in prange(len(pixels)):
        own = pixels[i]
        seen = np.maximum(values[own], 0.0)  # what was rounded to 0 is no value to compare
        pixel = gather(seen, rays[own], near[own], far[own], positions, noise[own], bounced, nothing, nothing, 1)
        sides = surface[values[own] > 0.0]
        depths[i], explained[i] = search(states[own], kinds[own] == GLOSSY, spreads[own], pixel, sides)
    return depths, explained
