"""The comparison of the two surfaces: its prediction, and depths where the lobe model does not hold."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.progress import finish
from pipeline.core.rig import sphere
from pipeline.core.shape.beyond_model import FIRM, compare
from pipeline.core.shape.coarse_to_fine import solve
from pipeline.core.shape.double_sphere import OWN_ERROR
from pipeline.core.shape.lobe import DEPTH
from pipeline.core.shape.pairwise import FEWEST, NEAREST, cost_of, predict, spread_of
from tests import drawn, oracles, synthetic

BALL = synthetic.ball(synthetic.camera(14))
ONE_DEVIATION = 0.683  # share of errors below it
TARGET = oracles.unit(np.array([0.3, 0.1, 1.0]))


def smooth(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """A function that is linear in the tangent plane of TARGET."""
    across = np.cross(TARGET, [0.0, 1.0, 0.0])
    return np.asarray(0.7 + directions @ (2.0 * across))


def test_the_prediction_is_exact_for_linear_functions() -> None:
    directions = sphere(200)
    ratios = smooth(directions)
    others = np.arange(200)
    assert predict(TARGET, directions, ratios, others) == pytest.approx(0.7, abs=1e-12)
    ratios[::3] = np.nan  # what has no ratio is passed over
    assert predict(TARGET, directions, ratios, others) == pytest.approx(0.7, abs=1e-12)
    assert abs(predict(TARGET, directions, ratios**2, others) - 0.49) > 1e-4  # a curved one is not


def test_nothing_is_predicted_from_too_few_or_from_one_side() -> None:
    directions = sphere(200)
    nearest = np.argsort(-directions @ TARGET)
    assert np.isnan(predict(TARGET, directions, smooth(directions), nearest[:NEAREST]))
    assert not np.isnan(predict(TARGET, directions, smooth(directions), nearest[: NEAREST + 1]))
    one_side = nearest[(directions[nearest] - TARGET) @ np.cross(TARGET, [0.0, 1.0, 0.0]) > 0.6]
    assert np.isnan(predict(TARGET, directions, smooth(directions), one_side))


def test_too_few_differences_judge_no_depth() -> None:
    found = np.full(30, np.nan)
    found[: FEWEST - 1] = 0.1
    assert cost_of(found, 1.0) == np.inf and spread_of(found) == np.inf
    found[FEWEST - 1] = -0.1
    assert cost_of(found, 0.1) == pytest.approx(0.5) and spread_of(found) == pytest.approx(0.1)


def retroreflective(normal: NDArray[Any], to_light: NDArray[Any], to_viewer: NDArray[Any]) -> NDArray[np.float64]:
    """Brightest with the light behind the camera: no lobe of the model does that."""
    back = np.maximum(oracles.dot(to_light, to_viewer), 0) ** 6
    return np.asarray((0.2 + 0.3 * back) * oracles.lambert_cosine(normal, to_light, np.pi))


def brushed(normal: NDArray[Any], to_light: NDArray[Any], to_viewer: NDArray[Any]) -> NDArray[np.float64]:
    """An anisotropic lobe, twice as wide along x as along y."""
    half = oracles.unit(to_light + to_viewer)
    across = half - oracles.dot(normal, half)[..., None] * normal
    cosine = np.maximum(oracles.dot(normal, to_light), 0)
    lobe = np.exp(-((across[..., 0] / 0.5) ** 2) - (across[..., 1] / 0.25) ** 2)
    return np.asarray(0.2 * cosine + 0.3 * lobe * np.sqrt(cosine))


def median_errors(capture: drawn.Drawn) -> tuple[float, float, NDArray[np.float64]]:
    """Errors of the joint fit and after the comparison [%], and the share of the misfit that it explains."""
    views = drawn.views(capture)
    true = BALL.depth[capture.mask()]
    solution = finish(solve(views, 12))
    joint = 100 * np.abs(solution.state[:, DEPTH] - true) / drawn.DIAMETER
    explained = finish(compare(views, capture.lights.surface, solution))
    compared = 100 * np.abs(solution.state[:, DEPTH] - true) / drawn.DIAMETER
    return float(np.median(joint)), float(np.median(compared)), explained


@pytest.mark.parametrize("reflect", [retroreflective, brushed])
def test_depths_beyond_the_model_are_found_better(reflect: drawn.Reflect) -> None:
    joint, compared, explained = median_errors(drawn.draw(BALL, drawn.two_spheres(320, 80), reflect))
    assert joint > 0.1
    assert compared < 0.8 * joint
    assert np.nanmedian(explained) > 0.1


@pytest.mark.parametrize("reflect", [retroreflective, brushed])
def test_a_compared_depth_is_in_doubt_by_what_it_moved(reflect: drawn.Reflect) -> None:
    capture = drawn.draw(BALL, drawn.two_spheres(320, 80), reflect)
    views = drawn.views(capture)
    solution = finish(solve(views, 12))
    before, stated = solution.state[:, DEPTH].copy(), solution.deviation.copy()
    finish(compare(views, capture.lights.surface, solution))
    moved = np.abs(solution.state[:, DEPTH] - before)
    assert (moved > 0).mean() > 0.5
    assert (solution.deviation >= np.maximum(stated, moved)).all()
    error = np.abs(solution.state[:, DEPTH] - BALL.depth[capture.mask()])[moved > 0]
    assert (error < OWN_ERROR * solution.deviation[moved > 0]).mean() > ONE_DEVIATION
    firmness = (FIRM * (views.far - views.near))[moved > 0]  # by which a compared depth is held is no error bar
    assert (error < OWN_ERROR * firmness).mean() < ONE_DEVIATION


def test_depths_within_the_model_are_left_alone() -> None:
    joint, compared, explained = median_errors(drawn.draw(BALL, drawn.two_spheres(), drawn.ggx))
    assert joint == compared and np.isnan(explained).all()


def test_noise_is_not_taken_for_a_reflectance() -> None:
    capture = drawn.draw(BALL, drawn.two_spheres(), drawn.ggx)
    assert capture.pictures is not None
    capture.pictures[:] *= 1 + 0.02 * np.random.default_rng(0).standard_normal(capture.pictures.shape)
    joint, compared, explained = median_errors(capture)
    assert np.nanmedian(explained) < 0.1
    assert compared < 1.2 * joint
