<<<<<<< HEAD
"""Least squares with few non-negative unknowns, against the general algorithm."""
=======
"""The exact solution of small non-negative least squares."""
>>>>>>> 7503642 (shape: Start from normals of unit length, weigh the two normals by their misfits; test acls)

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

<<<<<<< HEAD
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
=======
from pipeline.core.reflectance.nonnegative import solve


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_it_is_the_minimum(count: int) -> None:
    """Against the active-set solution of scipy, on random problems of which most have zeros in the solution."""
    rng = np.random.default_rng(count)
    zeros = 0
    for _ in range(200):
        a, y = rng.random((9, count)), rng.normal(size=9)
        expected, norm = nnls(a, y)
        found = np.empty(4)
        gain = solve(a.T @ a, a.T @ y, count, found)
        assert np.allclose(found[:count], expected, atol=1e-9)
        assert y @ y - gain == pytest.approx(norm**2, abs=1e-9)
        zeros += int((expected == 0).any())
    assert zeros > 20


def test_dependent_columns_share_nothing() -> None:
    """Two equal columns: one of them carries the whole weight, and the error is the least there is."""
    a = np.array([[1.0, 1.0], [2.0, 2.0], [0.5, 0.5]])
    y = np.array([3.0, 6.0, 1.5])
    found = np.empty(4)
    gain = solve(a.T @ a, a.T @ y, 2, found)
    assert sorted(found[:2]) == pytest.approx([0.0, 3.0])
    assert y @ y - gain == pytest.approx(0.0, abs=1e-9)
>>>>>>> 7503642 (shape: Start from normals of unit length, weigh the two normals by their misfits; test acls)
