"""Normal and weights of every pixel by itself, under lights and bases that are known by now."""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ...compiled import kernel, parallel_kernel
from .equations import RIDGE, WIDTH, certainty_of, factorise, frame, respond, turn

Array = NDArray[np.float64]

STEPS = 12  # of a pixel, at most
STILL = 1e-4  # step [rad] that ends them


@parallel_kernel
def refine_pixels(
    values: Array, usual: Array, lit: Array, views: Array, lights: Array, coefficients: Array, normals: Array,
    weights: Array, misfits: Array, stiffness: Array,
) -> None:  # fmt: skip
    """Fit normal and weights of every pixel to known lights and bases, in place.

    Parameters
    ----------
    values, usual, lit, views : (P, L, 3), (P,), (P, L), (P, 3)
    lights, coefficients : (L, 3), (K, J, 3)
    normals, weights : (P, 3), (P, K)
        Where to begin; where it ended.
    misfits : (P,)
        Mean over the lit values of Cauchy's log(1 + (miss / WIDTH)^2).
    stiffness : (P,)
        Smaller eigenvalue of the normal's information, its weights eliminated, in units of 1 / (relative misfit)^2.
    """
    pixels, count = lit.shape
    bases, functions = coefficients.shape[:2]
    own = 2 + bases
    for p in prange(pixels):
        tangents, scratch, value = np.empty((2, 3)), np.empty((4, functions)), np.empty(3)
        by_normal, by_light = np.empty((2, 3)), np.empty((3, 3))
        by_weight, by_lobe = np.empty((bases, 3)), np.empty(functions)
        a, b, slope = np.empty((own, own)), np.empty(own), np.empty(own)
        kept_a, kept_b, kept_tangents = np.zeros((own, own)), np.zeros(own), np.zeros((2, 3))
        normal, weight = normals[p].copy(), weights[p].copy()
        least, damping = np.inf, 1e-3
        for step in range(STEPS + 1):
            a[:], b[:] = 0.0, 0.0
            frame(normal, tangents)
            robust, seen = 0.0, 0.0
            for k in range(count):
                if lit[p, k] <= 0.0:
                    continue
                value[:] = 0.0
                above = respond(
                    normal, views[p], lights[k], weight, coefficients, tangents, scratch, value, by_normal,
                    by_weight, by_light, by_lobe,
                )  # fmt: skip
                sure = lit[p, k] * certainty_of(values[p, k], value, usual[p])
                size = max((values[p, k, 0] + values[p, k, 1] + values[p, k, 2]) / 3.0, usual[p])
                robust -= lit[p, k] * math.log(sure / lit[p, k] * 3.0 * size**2 * WIDTH**2)
                seen += lit[p, k]
                if not above:
                    continue
                for c in range(3):
                    miss = values[p, k, c] - value[c]
                    slope[0], slope[1] = by_normal[0, c], by_normal[1, c]
                    for n in range(bases):
                        slope[2 + n] = by_weight[n, c]
                    for i in range(own):
                        b[i] += sure * slope[i] * miss
                        for j in range(i + 1):
                            a[i, j] += sure * slope[i] * slope[j]
            for i in range(own):
                for j in range(i):
                    a[j, i] = a[i, j]
            if not robust < least:  # back to where it was, with a shorter step next time
                damping *= 10.0
                if step == STEPS or damping > 1e3:
                    break
            else:
                least, damping = robust, damping / 4.0
                normals[p], weights[p] = normal, weight
                misfits[p] = robust / max(seen, 1.0)
                stiffness[p] = _stiffness(a.copy(), weight, b.copy())
                kept_a[:], kept_b[:], kept_tangents[:] = a, b, tangents
            if step == STEPS:
                break
            a[:], b[:], tangents[:] = kept_a, kept_b, kept_tangents
            factorise(a, weights[p], b, damping)
            for i in range(own):
                for j in range(i):
                    b[i] -= a[i, j] * b[j]
                b[i] /= a[i, i]
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
def _stiffness(a: Array, weights: Array, b: Array) -> float:
    """Return the smaller eigenvalue of the normal's 2 x 2 information after eliminating the weights."""
    size = b.size
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
