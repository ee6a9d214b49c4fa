"""One pixel against the table: its weights, exactly, and its normal, by Gauss-Newton on what the weights leave over.

The model of a value is ``y = cos(theta_i) sum_k w_k B_k(theta_h, theta_d)``. For a given normal it is linear in the
weights, which are therefore eliminated (variable projection: Golub and Pereyra 1973).
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ...compiled import kernel, parallel_kernel
from ...reflectance.nonnegative import MOST, solve
from .foreseen import foresee, noise_of
from .sight import directions

STEPS = 4  # Gauss-Newton steps a round
FINEST = 2e-5  # a step below this angle [rad] is the last
LARGEST = 0.2  # longest step [rad]
SHADOWED, LIT = 0.25, 0.75  # share of the foreseen value at which a light is shadowed, and not
SHADOW = 0.3  # how much a cast shadow counts beside light that nothing explains
GRAZING = 0.02  # least cosine between normal and view of a surface that is seen


@kernel
def _weigh(
    columns: NDArray[np.float64],
    values: NDArray[np.float32],
    certainty: NDArray[np.float32],
    gram: NDArray[np.float64],
    moments: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> float:
    """Find the non-negative weights (K, M) of one pixel and return the weighted squared error that they leave."""
    lights, bases, colours = columns.shape
    sets = weights.shape[1]
    gram[:] = 0.0
    moments[:] = 0.0
    total = 0.0
    for k in range(lights):
        c = certainty[k]
        if c <= 0.0:
            continue
        for i in range(values.shape[1]):
            total += c * values[k, i] * values[k, i]
            m, s = (i, 0) if sets > 1 else (0, min(i, colours - 1))
            for q in range(bases):
                moments[m, q] += c * columns[k, q, s] * values[k, i]
        for s in range(colours):
            for q in range(bases):
                product = c * columns[k, q, s]
                for r in range(q, bases):
                    gram[q, r] += product * columns[k, r, s]
    for q in range(bases):
        for r in range(q):
            gram[q, r] = gram[r, q]
    found = np.empty(MOST)
    for m in range(sets):
        total -= solve(gram, moments[m], bases, found)
        for q in range(bases):
            weights[q, m] = found[q]
    return max(total, 0.0)


@kernel
def _tangents(normal: NDArray[np.float64], first: NDArray[np.float64], second: NDArray[np.float64]) -> None:
    """Fill in two unit vectors across the normal and each other."""
    axis = 0 if abs(normal[0]) < 0.7 else 1
    for i in range(3):
        first[i] = (1.0 if i == axis else 0.0) - normal[axis] * normal[i]
    length = math.sqrt(first[0] ** 2 + first[1] ** 2 + first[2] ** 2)
    for i in range(3):
        first[i] /= length
    second[0] = normal[1] * first[2] - normal[2] * first[1]
    second[1] = normal[2] * first[0] - normal[0] * first[2]
    second[2] = normal[0] * first[1] - normal[1] * first[0]


@kernel
def _newton(
    first: NDArray[np.float64],
    second: NDArray[np.float64],
    to_light: NDArray[np.float64],
    half: NDArray[np.float64],
    values: NDArray[np.float32],
    certainty: NDArray[np.float32],
    columns: NDArray[np.float64],
    slopes: NDArray[np.float64],
    normal: NDArray[np.float64],
    gram: NDArray[np.float64],
    weights: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Fill in the reduced Gauss-Newton system (5,) of a step across the normal: H11, H12, H22, g1, g2."""
    lights, bases, colours = columns.shape
    sets = weights.shape[1]
    out[:] = 0.0
    across = np.zeros((sets, bases, 2))
    for k in range(lights):
        c = certainty[k]
        cosine = normal[0] * to_light[k, 0] + normal[1] * to_light[k, 1] + normal[2] * to_light[k, 2]
        if c <= 0.0 or cosine <= 0.0:
            continue
        h1 = first[0] * half[k, 0] + first[1] * half[k, 1] + first[2] * half[k, 2]
        h2 = second[0] * half[k, 0] + second[1] * half[k, 1] + second[2] * half[k, 2]
        l1 = (first[0] * to_light[k, 0] + first[1] * to_light[k, 1] + first[2] * to_light[k, 2]) / cosine
        l2 = (second[0] * to_light[k, 0] + second[1] * to_light[k, 1] + second[2] * to_light[k, 2]) / cosine
        for i in range(values.shape[1]):
            m, s = (i, 0) if sets > 1 else (0, min(i, colours - 1))
            model = 0.0
            slope = 0.0
            for q in range(bases):
                model += weights[q, m] * columns[k, q, s]
                slope += weights[q, m] * slopes[k, q, s]
            d1 = slope * h1 + model * l1
            d2 = slope * h2 + model * l2
            miss = values[k, i] - model
            out[0] += c * d1 * d1
            out[1] += c * d1 * d2
            out[2] += c * d2 * d2
            out[3] += c * d1 * miss
            out[4] += c * d2 * miss
            for q in range(bases):
                across[m, q, 0] += c * columns[k, q, s] * d1
                across[m, q, 1] += c * columns[k, q, s] * d2
    for m in range(sets):
        _eliminate(gram, weights[:, m], across[m], out)


@kernel
def _eliminate(
    gram: NDArray[np.float64], weights: NDArray[np.float64], across: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Take out of the step's system what the positive weights would follow: X^T G^-1 X, by Cholesky."""
    factor = np.empty((MOST, MOST))
    left = np.empty((MOST, 2))
    chosen = np.empty(MOST, np.int64)
    size = 0
    for q in range(weights.shape[0]):
        if weights[q] > 0.0:
            chosen[size] = q
            size += 1
    for i in range(size):
        for j in range(i + 1):
            value = gram[chosen[i], chosen[j]]
            for r in range(j):
                value -= factor[i, r] * factor[j, r]
            if i == j:
                factor[i, i] = math.sqrt(max(value, 1e-12 * gram[chosen[i], chosen[i]]))
            else:
                factor[i, j] = value / factor[j, j]
        for t in range(2):
            value = across[chosen[i], t]
            for r in range(i):
                value -= factor[i, r] * left[r, t]
            left[i, t] = value / factor[i, i]
        out[0] -= left[i, 0] * left[i, 0]
        out[1] -= left[i, 0] * left[i, 1]
        out[2] -= left[i, 1] * left[i, 1]


@parallel_kernel
def refine(
    lights: NDArray[np.float64],
    near: bool,
    points: NDArray[np.float64],
    views: NDArray[np.float64],
    values: NDArray[np.float32],
    certainty: NDArray[np.float32],
    table: NDArray[np.float64],
    steps: int,
    normals: NDArray[np.float64],
    weights: NDArray[np.float64],
    costs: NDArray[np.float64],
    stiffness: NDArray[np.float64],
) -> None:
    """Improve normals and weights of every pixel for a given table; a cost never rises.

    Parameters
    ----------
    lights, near, points, views, values :
        As in :class:`~pipeline.core.shape.photometric.sight.Sight`.
    certainty : (P, L) float32
        Weight of every value in the squared error.
    table : (TH, TD, K, S) float64
        Basis BRDFs; S = 3 colours, or 1 when the weights carry the colour.
    steps : int
        Gauss-Newton steps; 0 finds the weights alone.
    normals : (P, 3) float64, changed
    weights : (P, K, M) float64, written
        M = 1, or 3 when the weights carry the colour.
    costs : (P,) float64, written
        Weighted squared error left.
    stiffness : (P,) float64, written
        Least curvature of half the cost over the normal's tilt [1/rad^2], the weights following; 0 without steps.
    """
    count = lights.shape[0]
    bases, colours = table.shape[2:]
    sets = weights.shape[2]
    for p in prange(points.shape[0]):
        to_light, half, difference = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
        columns, slopes = np.empty((count, bases, colours)), np.empty((count, bases, colours))
        gram, moments = np.empty((bases, bases)), np.empty((sets, bases))
        first, second, system = np.empty(3), np.empty(3), np.empty(5)
        trial, tried = np.empty(3), np.empty((bases, sets))
        directions(points[p], views[p], lights, near, to_light, half, difference)
        normal = normals[p]
        foresee(normal, to_light, half, difference, certainty[p], table, columns, slopes)
        best = _weigh(columns, values[p], certainty[p], gram, moments, weights[p])
        damping = 1e-3
        fresh = True
        stiffness[p] = 0.0
        for _ in range(steps):
            if fresh:
                _tangents(normal, first, second)
                _newton(
                    first, second, to_light, half, values[p], certainty[p], columns, slopes, normal, gram, weights[p],
                    system,
                )  # fmt: skip
                middle, apart = 0.5 * (system[0] + system[2]), 0.5 * (system[0] - system[2])
                stiffness[p] = max(middle - math.sqrt(apart * apart + system[1] * system[1]), 0.0)
            h1, h2 = system[0] * (1 + damping) + 1e-30, system[2] * (1 + damping) + 1e-30
            determinant = h1 * h2 - system[1] * system[1]
            if not determinant > 0.0:
                break
            x = (h2 * system[3] - system[1] * system[4]) / determinant
            y = (h1 * system[4] - system[1] * system[3]) / determinant
            length = math.sqrt(x * x + y * y)
            if not length > FINEST:
                break
            shrink = min(1.0, LARGEST / length)
            towards = 0.0
            norm = 0.0
            for i in range(3):
                trial[i] = normal[i] + shrink * (x * first[i] + y * second[i])
                norm += trial[i] * trial[i]
            for i in range(3):
                trial[i] /= math.sqrt(norm)
                towards += trial[i] * views[p, i]
            fresh = False
            if towards > GRAZING:
                foresee(trial, to_light, half, difference, certainty[p], table, columns, slopes)
                cost = _weigh(columns, values[p], certainty[p], gram, moments, tried)
                fresh = cost < best
            if fresh:
                best = cost
                normal[:] = trial
                weights[p] = tried
                damping *= 0.1
            else:
                damping = max(10 * damping, 0.1)
        costs[p] = best


@parallel_kernel
def settle(
    lights: NDArray[np.float64],
    near: bool,
    points: NDArray[np.float64],
    views: NDArray[np.float64],
    values: NDArray[np.float32],
    usable: NDArray[np.float32],
    scale: NDArray[np.float64],
    table: NDArray[np.float64],
    normals: NDArray[np.float64],
    weights: NDArray[np.float64],
    width: float,
    certainty: NDArray[np.float32],
) -> None:
    """Weigh every value by its noise and by how far the model explains it: shadows and strays fade out.

    With y the mean of the colours over the pixel's ``scale`` and m the model's, the weight is
    ``usable / noise(y) / scale^2``, noise being :func:`noise_of`, times a ramp from 0 at ``y = .25 m`` to 1 at
    ``y = .75 m`` (less light than foreseen is a cast shadow), times
    ``1 / (1 + ((y - m)^2 / noise(y) / width^2))``.

    Parameters
    ----------
    scale : (P,) float64
        A usual value of the pixel [1/sr].
    width : float
        Misfit at which a value counts half; 0 leaves that factor out.
    certainty : (P, L) float32, written
    """
    count = lights.shape[0]
    bases, colours = table.shape[2:]
    sets = weights.shape[2]
    for p in prange(points.shape[0]):
        to_light, half, difference = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
        columns, slopes = np.empty((count, bases, colours)), np.empty((count, bases, colours))
        directions(points[p], views[p], lights, near, to_light, half, difference)
        foresee(normals[p], to_light, half, difference, usable[p], table, columns, slopes)
        for k in range(count):
            seen, model = 0.0, 0.0
            channels = values.shape[2]
            for i in range(channels):
                m, s = (i, 0) if sets > 1 else (0, min(i, colours - 1))
                seen += values[p, k, i] / channels
                for q in range(bases):
                    model += weights[p, q, m] * columns[k, q, s] / channels
            seen /= scale[p]
            model /= scale[p]
            certainty[p, k] = 0.0
            if model > 0.0:
                even = 1.0 / noise_of(seen)
                noise = even / (scale[p] * scale[p])
                lit = min(max((seen / model - SHADOWED) / (LIT - SHADOWED), 0.0), 1.0)
                stray = (seen - model) ** 2 * even / (width * width) if width > 0.0 else 0.0
                certainty[p, k] = usable[p, k] * noise * lit / (1.0 + stray)


@parallel_kernel
def misfit(
    lights: NDArray[np.float64],
    near: bool,
    points: NDArray[np.float64],
    views: NDArray[np.float64],
    values: NDArray[np.float32],
    usable: NDArray[np.float32],
    scale: NDArray[np.float64],
    table: NDArray[np.float64],
    normals: NDArray[np.float64],
    weights: NDArray[np.float64],
    width: float,
    out: NDArray[np.float64],
) -> None:
    """Say how badly the model explains each pixel, robustly: the mean over the lights of ``e / (1 + e)``, 0 to 1.

    ``e = (y - m)^2 / noise(y) / width^2``, y and m the values seen and foreseen over the scale: a shadow or a stray
    counts 1 at most, however far it is off. All lights count, those behind the surface, too.
    """
    count = lights.shape[0]
    bases, colours = table.shape[2:]
    sets = weights.shape[2]
    channels = values.shape[2]
    for p in prange(points.shape[0]):
        to_light, half, difference = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
        columns, slopes = np.empty((count, bases, colours)), np.empty((count, bases, colours))
        directions(points[p], views[p], lights, near, to_light, half, difference)
        foresee(normals[p], to_light, half, difference, usable[p], table, columns, slopes)
        total = 0.0
        out[p] = 0.0
        for k in range(count):
            square, seen, foreseen = 0.0, 0.0, 0.0
            for i in range(channels):
                m, s = (i, 0) if sets > 1 else (0, min(i, colours - 1))
                model = 0.0
                for q in range(bases):
                    model += weights[p, q, m] * columns[k, q, s]
                square += (values[p, k, i] - model) ** 2 / channels
                seen += values[p, k, i] / channels
                foreseen += model / channels
            most = SHADOW if seen < SHADOWED * foreseen else 1.0
            e = square / (scale[p] * scale[p] * noise_of(seen / scale[p]) * width * width)
            out[p] += usable[p, k] * most * e / (1.0 + e)
            total += usable[p, k]
        out[p] /= max(total, 1e-12)
