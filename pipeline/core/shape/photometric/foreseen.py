"""What a table of basis BRDFs makes each light show of a pixel, and how noisy such a value is.

The model of a value is ``y = cos(theta_i) sum_k w_k B_k(theta_h, theta_d)``.
"""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ...compiled import kernel, parallel_kernel
from ...reflectance.angles import cell, half_coordinate
from .sight import directions

EVEN = 0.5  # of a pixel's usual value: below it values are equally noisy, above it their variance grows with them
BRIGHT = 2.0  # from there on the error is a share of the value: a highlight does not outweigh everything


@kernel
def noise_of(value: float) -> float:
    """Return the variance of a value over the pixel's usual one: even, then growing with it, then with its square."""
    return EVEN + value + (value / BRIGHT) ** 2


@kernel
def foresee(
    normal: NDArray[np.float64],
    to_light: NDArray[np.float64],
    half: NDArray[np.float64],
    difference: NDArray[np.float64],
    certainty: NDArray[np.float32],
    table: NDArray[np.float64],
    columns: NDArray[np.float64],
    slopes: NDArray[np.float64],
) -> None:
    """Fill in the model's columns A (L, K, S) and dA / d(n.h) (L, K, S); 0 where the light is behind or unused."""
    nodes_h, nodes_d, bases, colours = table.shape
    for k in range(to_light.shape[0]):
        cosine = normal[0] * to_light[k, 0] + normal[1] * to_light[k, 1] + normal[2] * to_light[k, 2]
        if cosine <= 0.0 or certainty[k] <= 0.0:
            columns[k] = 0.0
            slopes[k] = 0.0
            continue
        middle = normal[0] * half[k, 0] + normal[1] * half[k, 1] + normal[2] * half[k, 2]
        u = half_coordinate(middle)
        i, a = cell(u, nodes_h)
        j, b = cell(difference[k], nodes_d)
        beside = j + 1 if nodes_d > 1 else j
        # u = (1 - c)^(1/4): du / dc = -u / (4 (1 - c))
        rate = -cosine * (nodes_h - 1) * u / (4.0 * max(1.0 - middle, 1e-9))
        for q in range(bases):
            for s in range(colours):
                low = (1.0 - b) * table[i, j, q, s] + b * table[i, beside, q, s]
                high = (1.0 - b) * table[i + 1, j, q, s] + b * table[i + 1, beside, q, s]
                columns[k, q, s] = cosine * (low + a * (high - low))
                slopes[k, q, s] = rate * (high - low)


@parallel_kernel
def predict(
    lights: NDArray[np.float64],
    near: bool,
    points: NDArray[np.float64],
    views: NDArray[np.float64],
    table: NDArray[np.float64],
    normals: NDArray[np.float64],
    weights: NDArray[np.float64],
    out: NDArray[np.float32],
) -> None:
    """Fill in the model's values f cos(theta_i) of every pixel, light and colour (P, L, 3) [1/sr]."""
    count = lights.shape[0]
    bases, colours = table.shape[2:]
    sets = weights.shape[2]
    for p in prange(points.shape[0]):
        to_light, half, difference = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
        columns, slopes = np.empty((count, bases, colours)), np.empty((count, bases, colours))
        directions(points[p], views[p], lights, near, to_light, half, difference)
        foresee(normals[p], to_light, half, difference, np.ones(count, np.float32), table, columns, slopes)
        for k in range(count):
            for i in range(3):
                m, s = (i, 0) if sets > 1 else (0, min(i, colours - 1))
                value = 0.0
                for q in range(bases):
                    value += weights[p, q, m] * columns[k, q, s]
                out[p, k, i] = value
