"""What is expected of a pixel under a light: a diffuse term and GGX lobes of fixed widths, non-negative weights.

    M(u) = x_0 c + sum over a of (x_a g_a + x'_a e_a)

with the columns c, g, e of :mod:`pipeline.core.reflectance.lobes` at ROUGHNESSES. A narrow lobe falls between the
lights for most pixels, so that each is drawn towards the weights of the cell of the picture it lies in, as far as its
own pictures do not determine them. Not modelled: interreflection; the residual ratio holds it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ..compiled import kernel, parallel_kernel
from ..reflectance.lobes import lobe_columns

ROUGHNESSES = np.geomspace(0.1, 1.0, 14)
ALPHAS = ROUGHNESSES**2
COLUMNS = 1 + 2 * len(ALPHAS)
CELL = 24  # pixels
PULL = 0.5  # of the cell's knowledge of a weight
SWEEPS = 200
LIT_SHARE = 0.05  # of the median of value over cosine: below it a value counts as shadow


@kernel
def columns(normal: Any, view: Any, light: Any, out: Any) -> None:
    """Write the columns (COLUMNS,) for unit vectors; zeros below the horizon."""
    for a in range(len(ALPHAS)):
        c, g, e = lobe_columns(normal, view, light, ALPHAS[a])
        out[0] = c
        out[1 + 2 * a] = g
        out[2 + 2 * a] = e


@kernel
def direction(point: Any, light: Any, out: Any) -> Any:
    """Write the unit direction from a point to a light; return the squared distance."""
    d2 = 0.0
    for k in range(3):
        out[k] = light[k] - point[k]
        d2 += out[k] * out[k]
    for k in range(3):
        out[k] /= math.sqrt(d2)
    return d2


@kernel
def _equations(point: Any, normal: Any, view: Any, lights: Any, values: Any, matrix: Any, right: Any) -> Any:
    """Add up one pixel's normal equations, matrix (C, C) and right (C, 3); return the number of lit lights.

    Squares are weighed by 1 / (value + mean), as differences of square roots: a highlight does not drown the rest.
    """
    u, row = np.empty(3), np.empty(COLUMNS)
    gray = np.zeros(len(lights))
    ratios = np.empty(len(lights))
    count = 0
    for i in range(len(lights)):
        d2 = direction(point, lights[i], u)
        cosine = normal[0] * u[0] + normal[1] * u[1] + normal[2] * u[2]
        y = d2 * (values[i, 0] + values[i, 1] + values[i, 2]) / 3.0
        if cosine > 0.02 and y > 0.0:  # false for NaN
            gray[i] = y / cosine
            ratios[count] = gray[i]
            count += 1
    matrix[:] = 0.0
    right[:] = 0.0
    if count == 0:
        return 0
    limit = LIT_SHARE * np.median(ratios[:count])
    mean, lit = 0.0, 0
    for i in range(len(lights)):
        if gray[i] > limit:
            d2 = direction(point, lights[i], u)
            mean += d2 * (values[i, 0] + values[i, 1] + values[i, 2]) / 3.0
            lit += 1
    mean /= lit
    for i in range(len(lights)):
        if gray[i] <= limit:
            continue
        d2 = direction(point, lights[i], u)
        columns(normal, view, u, row)
        y = d2 * (values[i, 0] + values[i, 1] + values[i, 2]) / 3.0
        weight = 1.0 / ((y + mean) * mean * lit)  # relative to the pixel's own level
        for a in range(COLUMNS):
            weighed = weight * row[a]
            for b in range(a + 1):
                matrix[a, b] += weighed * row[b]
            for k in range(3):
                right[a, k] += weighed * d2 * values[i, k]
    for a in range(COLUMNS):
        for b in range(a):
            matrix[b, a] = matrix[a, b]
    return lit


@kernel
def non_negative(matrix: Any, right: Any, x: Any) -> None:
    """Improve x (C, 3) to the non-negative minimum of x'Ax - 2b'x per colour, by coordinate descent."""
    for k in range(x.shape[1]):
        for _ in range(SWEEPS):
            moved, size = 0.0, 1e-30
            for a in range(len(x)):
                if matrix[a, a] <= 0.0:
                    continue
                slope = right[a, k]
                for b in range(len(x)):
                    slope -= matrix[a, b] * x[b, k]
                new = max(0.0, x[a, k] + slope / matrix[a, a])
                moved += matrix[a, a] * (new - x[a, k]) ** 2
                size += matrix[a, a] * new * new
                x[a, k] = new
            if moved < 1e-12 * size:
                break


@parallel_kernel
def cell_equations(
    points: Any, normals: Any, views: Any, lights: Any, values: Any, starts: Any, order: Any, matrices: Any, rights: Any
) -> None:
    """Add up the equations of the pixels ``order[starts[n]:starts[n + 1]]`` of every cell n."""
    for n in prange(len(starts) - 1):
        matrix, right = np.empty((COLUMNS, COLUMNS)), np.empty((COLUMNS, 3))
        count = 0
        for at in range(starts[n], starts[n + 1]):
            p = order[at]
            if _equations(points[p], normals[p], views[p], lights, values[p], matrix, right) > 0:
                matrices[n] += matrix
                rights[n] += right
                count += 1
        matrices[n] /= max(count, 1)
        rights[n] /= max(count, 1)


@parallel_kernel
def solve_cells(matrices: Any, rights: Any, weights: Any) -> None:
    """Solve every cell: matrices (N, C, C), rights (N, C, 3), weights (N, C, 3)."""
    for n in prange(len(matrices)):
        matrix = matrices[n].copy()
        for a in range(COLUMNS):
            matrix[a, a] *= 1.0 + 1e-6
        non_negative(matrix, rights[n], weights[n])


@parallel_kernel
def solve_pixels(
    points: Any, normals: Any, views: Any, lights: Any, values: Any, cells: Any, matrices: Any, shared: Any, out: Any
) -> None:
    """Solve every pixel, drawn to the weights of its cell: cells (P,), shared (N, C, 3), out (P, C, 3)."""
    for p in prange(len(points)):
        matrix, right = np.empty((COLUMNS, COLUMNS)), np.empty((COLUMNS, 3))
        lit = _equations(points[p], normals[p], views[p], lights, values[p], matrix, right)
        cell = cells[p]
        x = shared[cell].copy()
        if lit > 0:
            for a in range(COLUMNS):
                pull = PULL * matrices[cell, a, a]
                matrix[a, a] += pull
                for k in range(3):
                    right[a, k] += pull * shared[cell, a, k]
            non_negative(matrix, right, x)
        out[p] = x


@parallel_kernel
def expected(points: Any, normals: Any, views: Any, light: Any, weights: Any, out: Any) -> None:
    """Write M under a light: weights (P, C, 3), out (P, 3)."""
    for p in prange(len(points)):
        u, row = np.empty(3), np.empty(COLUMNS)
        direction(points[p], light, u)
        columns(normals[p], views[p], u, row)
        for k in range(3):
            value = 0.0
            for a in range(COLUMNS):
                value += weights[p, a, k] * row[a]
            out[p, k] = value


def cells_of(rows: NDArray[np.int64], columns_: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the number of the cell that each pixel lies in, (P,), cells without pixels left out."""
    _, cells = np.unique(np.stack([rows, columns_]) // CELL, axis=1, return_inverse=True)
    return np.asarray(cells.reshape(-1), np.int64)
