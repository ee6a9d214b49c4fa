"""Levenberg-Marquardt for one pixel: the linear solve, the starts, and planted states found again."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.shape import fit, lobe
from tests import drawn, oracles, tolerances

NORMAL = oracles.unit(np.array([0.2, -0.3, 1.0]))
RAY = np.concatenate([[0.3, 0.2, 5.0], oracles.unit(np.array([-0.02, -0.05, -1.0]))])
TRUE = np.array([4.6, *NORMAL, np.log(0.25), 0.5, 0.4, 0.9, 0.0, 0, 0, 0, 0])
DIFFUSE = np.array([4.6, *NORMAL, np.log(0.3), 0.4, 0.4, 0.0, 0.0, 0, 0, 0, 0])
SCALES = np.array([4.0, 2.0, 1.0])


def observed(state: NDArray[np.float64], noise: float = 0.0, seed: int = 0) -> lobe.Pixel:
    """What a pixel in that state sees of 100 lights, its roots with Gaussian noise of a share of their median."""
    lights = drawn.two_spheres().position
    facing = oracles.dot(NORMAL, lights - RAY[:3] - state[0] * RAY[3:]) > 0.1
    lights = np.ascontiguousarray(lights[facing])
    nothing, roots, ones = np.zeros(lobe.UNKNOWNS), np.zeros(len(lights)), np.ones(len(lights))
    dark = lobe.Pixel(RAY, 3.0, 6.5, len(lights), lights, roots, ones, 1.0, 0.0, False, nothing, nothing)
    predicted = np.empty(len(lights))
    lobe.evaluate(state, True, dark, 1.0, predicted, np.empty((0, lobe.UNKNOWNS)))
    middle = float(np.median(predicted))
    predicted += noise * middle * np.random.default_rng(seed).standard_normal(len(lights))
    return dark._replace(roots=predicted, middle=middle)


@pytest.mark.parametrize("frozen", [[], [4], [2, 6]])
def test_the_damped_solve_is_the_linear_solve(frozen: list[int]) -> None:
    rng = np.random.default_rng(1)
    a = (lambda m: m @ m.T)(rng.standard_normal((12, 20)))
    g, step, off = rng.standard_normal(12), np.empty(12), np.zeros(12, bool)
    off[frozen] = True
    assert fit.solve_damped(a, g, 0.1, off, step)
    assert np.all(step[off] == 0)
    system = (a + 0.1 * np.diag(np.diag(a)))[np.ix_(~off, ~off)]
    np.testing.assert_allclose(step[~off], np.linalg.solve(system, -g[~off]), rtol=1e-8)


def test_an_indefinite_system_is_refused() -> None:
    a = np.eye(12)
    a[0, 1] = a[1, 0] = 2.0
    assert not fit.solve_damped(a, np.ones(12), 0.0, np.zeros(12, bool), np.empty(12))


def test_the_diffuse_start_is_exact_at_the_true_depth() -> None:
    pixel, state = observed(DIFFUSE), np.empty(lobe.STATE)
    fit.diffuse_start(state, 4.6, pixel, pixel.roots.max())
    np.testing.assert_allclose(state[1:4], NORMAL, atol=1e-6)
    assert state[lobe.DIFFUSE] == pytest.approx(0.4, rel=1e-6)
    fit.diffuse_start(state, 4.9, pixel, pixel.roots.max())  # at a wrong depth it is not
    assert np.abs(state[1:4] - NORMAL).max() > 0.01


@pytest.mark.parametrize("kappa", [0.05, 0.5, 0.65])
def test_a_planted_state_is_found_from_afar(kappa: float) -> None:
    true = TRUE.copy()
    true[lobe.KAPPA] = kappa
    pixel, summary = observed(true), np.empty(2)
    state = np.array(
        [4.75, *oracles.unit(NORMAL + np.array([0.1, 0.1, 0])), np.log(0.4), 0.4, 0.3, 0.5, 0.1, 0, 0, 0, 0]
    )
    fit.refine(state, True, pixel, SCALES, 40, summary)
    assert state[0] == pytest.approx(4.6, abs=tolerances.PLANTED_DEPTH)
    np.testing.assert_allclose(state[1:4], NORMAL, atol=1e-4)
    assert np.exp(state[lobe.LOG_ALPHA]) == pytest.approx(0.25, rel=1e-3)
    assert state[lobe.KAPPA] == pytest.approx(kappa, abs=5e-3)
    assert summary[0] < 1e-4


def test_what_is_known_beforehand_holds_an_unknown() -> None:
    pixel = observed(TRUE)
    expected, precision = np.zeros((2, lobe.UNKNOWNS))
    expected[0], precision[0] = 4.7, 1e12
    state = TRUE.copy()
    fit.refine(state, True, pixel._replace(expected=expected, precision=precision), SCALES, 40, np.empty(2))
    assert state[0] == pytest.approx(4.7, abs=1e-3)


def test_the_stated_deviation_is_the_scatter_of_noisy_fits() -> None:
    depths, stated = [], []
    for seed in range(60):
        state, summary = DIFFUSE.copy(), np.empty(2)
        fit.refine(state, False, observed(DIFFUSE, 0.003, seed), SCALES, 20, summary)
        depths.append(state[0])
        stated.append(summary[1])
    assert abs(np.mean(depths) - 4.6) < 3 * np.std(depths) / np.sqrt(60)
    assert np.median(stated) == pytest.approx(np.std(depths), rel=0.5)


def test_outliers_do_not_move_the_depth() -> None:
    pixel, state = observed(DIFFUSE), DIFFUSE.copy()
    pixel.roots[::9] *= 1.5
    fit.refine(state, False, pixel, SCALES, 20, np.empty(2))
    assert state[0] == pytest.approx(4.6, abs=tolerances.PLANTED_DEPTH)
    assert np.abs(np.mean(pixel.roots) / np.mean(observed(DIFFUSE).roots) - 1) > 0.04
