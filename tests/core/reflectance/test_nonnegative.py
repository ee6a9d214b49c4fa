"""Least squares with few non-negative unknowns, against the general algorithm."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from pipeline.core.reflectance.nonnegative import MOST, solve


@pytest.mark.parametrize("count", range(1, MOST + 1))
def test_same_as_the_general_algorithm(count: int) -> None:
    rng = np.random.default_rng(count)
    clipped = 0
    for _ in range(200):
        matrix, right = rng.normal(size=(12, count)), rng.normal(size=12)
        out = np.empty(count)
        gain = solve(matrix.T @ matrix, matrix.T @ right, count, out)
        wanted, norm = nnls(matrix, right)
        np.testing.assert_allclose(out, wanted, atol=1e-10)
        assert gain == pytest.approx(right @ right - norm**2, abs=1e-10)
        clipped += (wanted == 0).any()
    assert clipped > 20


def test_nothing_helps() -> None:
    out = np.empty(2)
    assert solve(np.eye(2), np.array([-1.0, -2.0]), 2, out) == 0
    assert (out == 0).all()


def test_equal_columns_share_one_weight() -> None:
    out = np.empty(2)
    assert solve(np.ones((2, 2)), np.array([3.0, 3.0]), 2, out) == pytest.approx(9)
    assert out.sum() == pytest.approx(3)
