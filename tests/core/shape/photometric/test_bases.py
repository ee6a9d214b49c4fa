"""The convex program of the tables."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from pipeline.core.shape.photometric import bases

SHAPE = (7, 4)  # along theta_h, and what stands beside


def problem(seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """A positive definite band of width 5 over 28 unknowns, as band and as matrix, and a right-hand side."""
    rng = np.random.default_rng(seed)
    count = SHAPE[0] * SHAPE[1]
    band = 0.3 * rng.normal(size=(count, 5))
    band[:, 0] = 3.0 + rng.random(count)
    matrix = np.diag(band[:, 0])
    for offset in range(1, 5):
        above = band[:-offset, offset]
        matrix += np.diag(above, offset) + np.diag(above, -offset)
    return band, matrix, 2.0 * rng.normal(size=count)


def test_it_is_the_constrained_minimum() -> None:
    """Against bounded least squares in the falls, x = T s with s >= 0, solved by scipy."""
    for seed in range(5):
        band, matrix, right = problem(seed)
        found = bases.minimise(band, right, SHAPE)
        sums = np.kron(np.triu(np.ones((SHAPE[0], SHAPE[0]))), np.eye(SHAPE[1]))
        root = np.linalg.cholesky(matrix).T
        expected = sums @ lsq_linear(root @ sums, np.linalg.solve(root.T, right), (0, np.inf), tol=1e-12).x
        assert np.allclose(found, expected, atol=1e-3 * abs(expected).max())
        rows = found.reshape(SHAPE)
        assert (rows >= 0).all()
        assert (np.diff(rows, axis=0) <= 0).all()
        assert not np.allclose(found, np.linalg.solve(matrix, right), atol=0.1), "no constraint was active"


def test_the_product_is_the_matrix() -> None:
    band, matrix, x = problem(0)
    assert np.allclose(bases.multiply(band, x), matrix @ x)


def test_smoothness_costs_nothing_on_a_straight_line() -> None:
    """Second differences of a table that is linear over its reference vanish; a bend costs."""
    reference = np.random.default_rng(1).random((6, 5, 2)) + 0.5
    band = bases.smoothness(reference, np.ones_like(reference), 1.0, 1.0, 0.0)
    line = np.arange(6.0)[:, None, None] + 2.0 * np.arange(5.0)[:, None] + 3.0
    straight = (line * reference).ravel()
    assert abs(straight @ bases.multiply(band, straight)) < 1e-9
    bent = straight.copy()
    bent[7] *= 1.5
    assert bent @ bases.multiply(band, bent) > 1.0
