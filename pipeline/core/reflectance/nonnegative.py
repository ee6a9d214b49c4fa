"""Least squares with at most four non-negative unknowns, solved exactly by trying every support."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import kernel

MOST = 4
# A pivot below this share of its column's own square says that the columns depend on each other.
DEPENDENT = 1e-9


@kernel
def solve(gram: NDArray[np.float64], moments: NDArray[np.float64], count: int, out: NDArray[np.float64]) -> float:
    """Minimise w.G w - 2 b.w over w >= 0 and return by how much that lies below 0.

    Of a strictly convex problem the minimum over w >= 0 is the unconstrained minimum of its own support; the best
    among the supports whose minimum is positive is therefore the solution (Lawson and Hanson 1974).

    Parameters
    ----------
    gram : (>= K, >= K) float64
        G = A^T A; K <= 4.
    moments : (>= K,) float64
        b = A^T y.
    count : int
        K.
    out : (>= K,) float64, written
        The weights w.

    Returns
    -------
    gain : float
        2 b.w - w.G w, so that the squared error is y.y - gain.
    """
    best = 0.0
    out[:count] = 0.0
    system = np.empty((MOST, MOST + 1))
    chosen = np.empty(MOST, np.int64)
    x = np.empty(MOST)
    for support in range(1, 1 << count):
        size = 0
        for i in range(count):
            if support >> i & 1:
                chosen[size] = i
                size += 1
        for i in range(size):
            for j in range(size):
                system[i, j] = gram[chosen[i], chosen[j]]
            system[i, size] = moments[chosen[i]]
        feasible = True
        for i in range(size):
            pivot = system[i, i]
            if not pivot > DEPENDENT * gram[chosen[i], chosen[i]]:
                feasible = False
                break
            for r in range(i + 1, size):
                factor = system[r, i] / pivot
                for j in range(i, size + 1):
                    system[r, j] -= factor * system[i, j]
        if not feasible:
            continue
        gain = 0.0
        for i in range(size - 1, -1, -1):
            left = system[i, size]
            for j in range(i + 1, size):
                left -= system[i, j] * x[j]
            x[i] = left / system[i, i]
            if x[i] < 0.0:
                feasible = False
                break
            gain += x[i] * moments[chosen[i]]
        if feasible and gain > best:
            best = gain
            out[:count] = 0.0
            for i in range(size):
                out[chosen[i]] = x[i]
    return best
