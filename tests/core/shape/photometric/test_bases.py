"""The tables' convex program: against the general algorithm, and against what it promises."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from pipeline.core.shape.photometric import bases

NODES_H, STRIDE = 9, 4
COUNT = NODES_H * STRIDE


def problem(seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """A positive definite matrix as a band and in full, and moments, some of which ask for rising tables."""
    rng = np.random.default_rng(seed)
    rows = np.zeros((3 * COUNT, COUNT))
    for row in rows:
        first = rng.integers(COUNT - STRIDE)
        row[first : first + STRIDE + 1] = rng.uniform(size=STRIDE + 1)
    matrix = rows.T @ rows + 1e-3 * np.eye(COUNT)
    width = STRIDE + 1
    band = np.zeros((COUNT, width))
    for offset in range(width):
        band[: COUNT - offset, offset] = np.diagonal(matrix, offset)
    return band, matrix, matrix @ rng.normal(0.5, 1, COUNT)


def test_band_multiplies_like_the_matrix() -> None:
    band, matrix, right = problem(0)
    np.testing.assert_allclose(bases.multiply(band, right), matrix @ right)


def test_minimum_is_that_of_the_general_algorithm() -> None:
    """A table that falls to 0 or above is a sum of non-negative steps: x = T s, s >= 0."""
    steps = np.kron(np.triu(np.ones((NODES_H, NODES_H))), np.eye(STRIDE))
    for seed in range(5):
        band, matrix, moments = problem(seed)
        factor = np.linalg.cholesky(matrix).T
        wanted = steps @ nnls(factor @ steps, np.linalg.solve(factor.T, moments))[0]
        found = bases.minimise(band, moments, (NODES_H, STRIDE))
        least = 0.5 * wanted @ matrix @ wanted - moments @ wanted
        reached = 0.5 * found @ matrix @ found - moments @ found
        assert abs(reached - least) < 1e-5 * abs(least)
        np.testing.assert_allclose(found, wanted, atol=1e-2 * np.abs(wanted).max())
        free = np.linalg.solve(matrix, moments)
        assert np.abs(free - wanted).max() > 0.1  # the constraints matter


def test_result_is_feasible_exactly() -> None:
    for seed in range(5):
        band, _, moments = problem(seed)
        table = bases.minimise(band, moments, (NODES_H, STRIDE)).reshape(NODES_H, STRIDE)
        assert table.min() >= 0 and np.diff(table, axis=0).max() <= 0


def test_falling_tables_are_left_alone() -> None:
    band, matrix, _ = problem(3)
    table = np.linspace(2, 1, NODES_H)[:, None] * np.ones(STRIDE)
    found = bases.minimise(band, matrix @ table.ravel(), (NODES_H, STRIDE))
    np.testing.assert_allclose(found, table.ravel(), rtol=1e-3)


def test_straight_tables_cost_no_smoothness_and_bent_ones_do() -> None:
    shape = (7, 4, 2)
    ones = np.ones(shape)
    band = bases.smoothness(ones, ones, 1.0, 1.0, 0.0)

    def cost(table: NDArray[np.float64]) -> float:
        return float(table.ravel() @ bases.multiply(band, table.ravel()))

    straight = np.arange(7)[:, None, None] + 3 * np.arange(4)[None, :, None] + np.zeros(2)
    assert abs(cost(straight)) < 1e-9
    assert cost(straight**2) > 1
