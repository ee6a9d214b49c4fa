"""Weighted differences on the pixels of a mask, solved in a time proportional to their number.

Conjugate gradients, preconditioned by one cycle of smoothed aggregation (Vanek, Mandel, Brezina 1996): pixels of a
square of three by three that are coupled strongly become one unknown of the next coarser level, so that a depth edge
through a square makes two unknowns of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

Vector = NDArray[np.float64]
Solver = Callable[[Vector], Vector]

STRONG = 0.08  # coupling over the root of both diagonals
DAMPING = 2 / 3  # of Jacobi's iteration; the matrices' largest eigenvalue is 2 diagonals at most
HELD = 0.5  # share of a diagonal that is not coupling, above which smoothing alone solves an unknown
SMALL = 600  # unknowns that are solved directly
SLOWEST = 0.8  # share of the unknowns that a coarser level has at most; there is none otherwise
ITERATIONS = 60


def solve(matrix: Any, right: Vector, places: NDArray[np.int64], tolerance: float) -> Vector:
    """Solve a symmetric, positive definite system of differences between neighbouring pixels.

    Parameters
    ----------
    matrix : (P, P) sparse array
        Non-positive off the diagonal, row sums not negative.
    right : (P,) float64
    places : (P, 2) int64
        Row and column of each pixel.
    tolerance : float
        Of the preconditioned residual, relative to the right side's; or after 60 iterations.
    """
    cycle = _cycle(matrix, places)
    solution, residual = np.zeros_like(right), right.copy()
    direction = np.zeros_like(right)
    power, first = 1.0, 0.0
    for _ in range(ITERATIONS):
        improved = cycle(residual)
        before, power = power, float(residual @ improved)
        first = first or power
        if power <= tolerance**2 * first:
            break
        direction = improved + power / before * direction
        image = matrix @ direction
        step = power / float(direction @ image)
        solution += step * direction
        residual -= step * image
    return solution


def _cycle(matrix: Any, places: NDArray[np.int64]) -> Solver:
    """Return an approximate inverse of the matrix: smooth, correct on the coarser level, smooth."""
    if matrix.shape[0] <= SMALL:
        return _direct(matrix)
    coupling, held = _strong(matrix)
    group, coarse_places = _squares(coupling, held, places)
    if len(coarse_places) > SLOWEST * matrix.shape[0]:
        return _direct(matrix)
    spread = _spread(coupling, group, len(coarse_places))
    coarse = _cycle((spread.T @ matrix @ spread).tocsr(), coarse_places)
    gather = spread.T.tocsr()
    damped = DAMPING / matrix.diagonal()

    def cycle(right: Vector) -> Vector:
        value = damped * right
        value += damped * (right - matrix @ value)
        value += spread @ coarse(gather @ (right - matrix @ value))
        value += damped * (right - matrix @ value)
        value += damped * (right - matrix @ value)
        return np.asarray(value)

    return cycle


def _direct(matrix: Any) -> Solver:
    solver: Solver = splu(matrix.tocsc()).solve
    return solver


def _strong(matrix: Any) -> tuple[Any, NDArray[np.bool_]]:
    """Return the strong couplings, positive, and which unknowns are held by themselves."""
    diagonal = matrix.diagonal()
    held = np.asarray(matrix.sum(axis=1)).ravel() > HELD * diagonal
    entries = matrix.tocoo()
    strong = (entries.row != entries.col) & (
        -entries.data > STRONG * np.sqrt(diagonal[entries.row] * diagonal[entries.col])
    )
    kept = (-entries.data[strong], (entries.row[strong], entries.col[strong]))
    return sparse.csr_array(kept, shape=matrix.shape), held


def _squares(
    coupling: Any, held: NDArray[np.bool_], places: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Number the groups of unknowns that share a square and are coupled in it, -1 for held ones; and their places."""
    entries = coupling.tocoo()
    square = places // 3
    inside = (square[entries.row] == square[entries.col]).all(axis=1) & ~held[entries.row] & ~held[entries.col]
    links = (np.ones(int(inside.sum()), np.int8), (entries.row[inside], entries.col[inside]))
    label = connected_components(sparse.coo_array(links, shape=coupling.shape), directed=False)[1]
    group = np.full(len(places), -1, np.int64)
    _, first, group[~held] = np.unique(label[~held], return_index=True, return_inverse=True)
    return group, square[~held][first]


def _spread(coupling: Any, group: NDArray[np.int64], groups: int) -> Any:
    """Return the interpolation from groups to unknowns: constant on each, smoothed once along strong couplings."""
    member = np.flatnonzero(group >= 0)
    constant = sparse.csr_array((np.ones(len(member)), (member, group[member])), shape=(len(group), groups))
    total = np.asarray(coupling.sum(axis=1)).ravel()
    own = np.where(total > 0, DAMPING, 0.0)
    mean = sparse.diags_array(own / np.where(total > 0, total, 1.0)) @ coupling
    return (constant - sparse.diags_array(own) @ constant + mean @ constant).tocsr()
