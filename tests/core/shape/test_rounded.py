"""Means of what roundings allow: against sampling, against least squares on a planted ball, and where shadow falls."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm, truncnorm

from pipeline.core.progress import finish
from pipeline.core.shape import coarse_to_fine, double_sphere, rounded
from tests import drawn, synthetic

BALL = synthetic.ball(synthetic.camera(14))
SLACK = 0.02


@pytest.mark.parametrize("low, high", [(-1.0, 0.5), (0.2, 0.3), (4.0, 5.0), (-9.0, -7.0), (-1e30, -3.0), (2.0, 1e30)])
def test_moments_between_limits_are_those_of_a_truncated_gaussian(low: float, high: float) -> None:
    mean, spread = 0.3, 1.7
    known = truncnorm((low - mean) / spread, (high - mean) / spread, mean, spread)
    tails = norm.sf([low, high], mean, spread) if low > mean else norm.cdf([high, low], mean, spread)
    found = rounded.truncated(mean, spread**2, low, high)
    np.testing.assert_allclose(found, (tails[0] - tails[1], known.mean(), known.var()), rtol=1e-6)


def test_nothing_between_limits_out_of_reach_is_the_nearer_limit() -> None:
    _, mean, variance = rounded.truncated(0.0, 1.0, 40.0, 41.0)
    assert mean == 40.0 and 0 < variance < 1e-3


def sampled(
    jacobian: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], other: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and covariance of the standard Gaussian's draws, weighed by what each value's limits allow."""
    draws = np.random.default_rng(11).standard_normal((400_000, jacobian.shape[1]))
    weight = np.ones(len(draws))
    for row, below, above, share in zip(jacobian, low, high, other, strict=True):
        seen = draws @ row
        weight *= share + (1 - share) * (norm.cdf((above - seen) / SLACK) - norm.cdf((below - seen) / SLACK))
    mean = np.average(draws, axis=0, weights=weight)
    return mean, np.cov(draws.T, aweights=weight)


@pytest.mark.parametrize("darkness", [0.0, 0.3])
def test_propagated_moments_are_those_of_sampling(darkness: float) -> None:
    generator = np.random.default_rng(3)
    lit, dark, step = 8, 6, 1.0
    jacobian = generator.normal(size=(lit + dark, 3))
    true = np.array([0.7, -0.4, 0.5])
    order = np.argsort(-(jacobian @ true))  # the darkest ones last, which round to 0 or lie below
    jacobian = np.ascontiguousarray(jacobian[order])
    nearest = step * np.round(jacobian @ true / step)
    low = np.where(np.arange(lit + dark) < lit, nearest - step / 2, -1e30)
    high = np.where(np.arange(lit + dark) < lit, nearest + step / 2, np.maximum(nearest, 0) + step / 2)
    shadow = np.full(lit + dark, darkness)
    outlier = np.where(np.arange(lit + dark) < lit, 0.0, darkness)
    mean, covariance = np.zeros(3), np.eye(3)
    rounded.propagate(jacobian, np.zeros(lit + dark), low, high, lit, shadow, SLACK, mean, covariance)
    expected, spread = sampled(jacobian, low, high, outlier)
    deviation = np.sqrt(np.diag(spread))
    assert (abs(mean - expected) < 0.15 * deviation).all()
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), deviation, rtol=0.2)
    assert (deviation < 0.4).all()  # the limits told something


def coarse(steps: float) -> drawn.Drawn:
    """The ball in pictures whose median lit value is so many steps."""
    capture = drawn.draw(BALL, drawn.two_spheres(160, 40), drawn.ggx)
    assert capture.pictures is not None
    step = float(np.median(capture.pictures[capture.pictures > 0])) / steps
    return dataclasses.replace(capture, pictures=(np.round(capture.pictures / step) * step).astype(np.float32))


def test_the_mean_of_what_is_allowed_beats_the_middles_of_steps() -> None:
    views = drawn.views(coarse(0.9))
    assert (views.values < 0).any()
    solution = finish(coarse_to_fine.solve(views, 12))
    true = BALL.depth[views.mask]
    before = np.abs(solution.state[:, 0] - true)
    finish(rounded.average_allowed(views, solution))
    after = np.abs(solution.state[:, 0] - true)
    assert np.median(after) < 0.7 * np.median(before)
    # What is stated is what is seen: the spread over three, since the settlement takes it threefold.
    assert 0.5 < np.median(after / solution.deviation) / norm.ppf(0.75) < 2


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_the_unit_of_the_pictures_does_not_matter(factor: float) -> None:
    depths = []
    for unit in (1.0, factor):
        capture = coarse(0.9)
        assert capture.pictures is not None
        depths.append(drawn.solved(dataclasses.replace(capture, pictures=capture.pictures * np.float32(unit))).depth)
    np.testing.assert_allclose(depths[1], depths[0], atol=1e-3 * drawn.DIAMETER)  # a quarter of the errors


def test_roundings_that_hide_nothing_are_left_to_least_squares(monkeypatch: pytest.MonkeyPatch) -> None:
    called = []
    monkeypatch.setattr(double_sphere, "average_allowed", lambda *given: called.append(given) or iter(()))
    drawn.solved(coarse(40.0))
    assert not called
    drawn.solved(coarse(0.9))
    assert len(called) == 1


def test_shadow_is_expected_where_neighbours_are_dark_that_should_be_lit() -> None:
    views = drawn.views(drawn.draw(synthetic.ball(synthetic.camera(28)), drawn.two_spheres(), drawn.lambert))
    solution = finish(coarse_to_fine.solve(views, 12))
    columns = np.argwhere(views.mask)[:, 1]
    middle = int(np.median(columns))
    light = int(np.argmax((views.values > 0).sum(axis=0)))  # one that lights nearly all of the ball
    values = views.values.copy()
    values[(columns < middle), light] *= -1
    lit = values[:, light] != 0
    noise = np.full(len(columns), 0.1 * float(np.median(np.abs(values[lit, light])) ** 3))
    found = rounded.shadowed(dataclasses.replace(views, values=values, noise=noise), solution)[:, light]
    assert found[lit & (columns < middle - 5)].min() > 0.9
    assert found[lit & (columns > middle + 5)].max() < 0.1
