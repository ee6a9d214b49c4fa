"""Normal and weights of every pixel by itself, under lights and bases that are known by now."""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ...compiled import kernel, parallel_kernel
from .equations import RIDGE, add_value, certainty_of, cholesky, frame, respond, solve_lower, turn, workspace
from .lamps import arriving

Array = NDArray[np.float64]

STEPS = 12  # of a pixel, at most
STILL = 1e-4  # step [rad] that ends them


@parallel_kernel
def refine_pixels(
    values: Array, usual: Array, noise: float, lit: Array, views: Array, offsets: Array, lights: Array,
    coefficients: Array, expected: Array, pulls: Array, normals: Array, weights: Array, costs: Array, misfits: Array,
    stiffness: Array,
) -> None:  # fmt: skip
    """Fit normal and weights of every pixel to known lights and bases, in place.

    Parameters
    ----------
    values, usual, noise, lit, views, offsets : (P, L, 3), (P,), float, (P, L), (P, 3), (P, 3)
    lights, coefficients : (L, N), (K, J, 3)
    expected, pulls : (P, 3 + K), (P, 3 + K)
        Normal and weights that the surroundings have, and what a squared difference from each adds to the cost.
    normals, weights : (P, 3), (P, K)
        Where to begin; where it ended.
    costs : (P,)
        What is minimised.
    misfits : (P,)
        Mean over the lit values of Cauchy's log(1 + (miss / width)^2).
    stiffness : (P,)
        Smaller eigenvalue of the normal's information, its weights eliminated, in units of 1 / (misfit over width)^2.
    """
    pixels, count = lit.shape
    bases = coefficients.shape[0]
    own = 2 + bases
    for p in prange(pixels):
        space = workspace(bases, coefficients.shape[1])
        tangents, value = space[0], space[2]
        here, slopes = np.empty(3), np.empty((lights.shape[1], 3))
        a, b, slope = np.empty((own, own)), np.empty(own), np.empty(own)
        kept_a, kept_b, kept_tangents = np.zeros((own, own)), np.zeros(own), np.zeros((2, 3))
        pull, there = pulls[p], expected[p]
        normal, weight = normals[p].copy(), weights[p].copy()
        least, damping = np.inf, 1e-3
        for step in range(STEPS + 1):
            a[:], b[:] = 0.0, 0.0
            frame(normal, tangents)
            robust, seen = 0.0, 0.0
            for k in range(count):
                if lit[p, k] <= 0.0:
                    continue
                arriving(lights[k], offsets[p], here, slopes)
                above = respond(normal, views[p], here, weight, coefficients, space)
                sure, cost = certainty_of(values[p, k], value, usual[p], noise)
                robust += lit[p, k] * cost
                seen += lit[p, k]
                if above:
                    for c in range(3):
                        add_value(space, c, lit[p, k] * sure, values[p, k, c] - value[c], slope, a, b)
            cost = robust + _pulled(there, pull, normal, weight, tangents, a, b)
            if not cost < least:  # back to where it was, with a shorter step next time
                damping *= 10.0
                if step == STEPS or damping > 1e3:
                    break
            else:
                least, damping = cost, damping / 4.0
                normals[p], weights[p], costs[p] = normal, weight, cost
                misfits[p] = robust / max(seen, 1.0)
                stiffness[p] = _stiffness(a.copy(), weight)
                kept_a[:], kept_b[:], kept_tangents[:] = a, b, tangents
            if step == STEPS:
                break
            a[:], b[:], tangents[:] = kept_a, kept_b, kept_tangents
            cholesky(a, weights[p], b, damping)
            solve_lower(a, b)
            for i in range(own - 1, -1, -1):
                for j in range(i + 1, own):
                    b[i] -= a[j, i] * b[j]
                b[i] /= a[i, i]
            turn(normals[p], tangents, b, views[p], normal)
            for n in range(bases):
                weight[n] = max(weights[p, n] + b[2 + n], 0.0)
            if abs(b[0]) + abs(b[1]) < STILL:
                break


@kernel
def _pulled(expected: Array, pulls: Array, normal: Array, weights: Array, tangents: Array, a: Array, b: Array) -> float:
    """Add what is expected of a pixel to its system, and return what it adds to the cost."""
    cost = 0.0
    for i in range(3):
        miss = expected[i] - normal[i]
        cost += pulls[i] * miss**2
        for t in range(2):
            b[t] += pulls[i] * tangents[t, i] * miss
            for u in range(t + 1):
                a[t, u] += pulls[i] * tangents[t, i] * tangents[u, i]
    for k in range(weights.size):
        miss = expected[3 + k] - weights[k]
        cost += pulls[3 + k] * miss**2
        b[2 + k] += pulls[3 + k] * miss
        a[2 + k, 2 + k] += pulls[3 + k]
    return cost


@kernel
def _stiffness(a: Array, weights: Array) -> float:
    """Return the smaller eigenvalue of the normal's 2 x 2 information after eliminating the weights; a is spoilt."""
    size = 2 + weights.size
    for i in range(size):
        for j in range(i):
            a[j, i] = a[i, j]
    for k in range(weights.size):
        if weights[k] <= 0.0:
            a[2 + k, :] = 0.0
            a[:, 2 + k] = 0.0
            a[2 + k, 2 + k] = 1.0
    for m in range(size - 1, 1, -1):
        pivot = max(a[m, m], RIDGE)
        for i in range(m):
            for j in range(m):
                a[i, j] -= a[i, m] * a[m, j] / pivot
    mean, apart = 0.5 * (a[0, 0] + a[1, 1]), 0.5 * (a[0, 0] - a[1, 1])
    return float(max(mean - math.sqrt(apart**2 + a[0, 1] ** 2), 0.0))
