"""Fusion on two planes with a step between them: outliers go, the edge stays."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.shape.fusion import disagreement, fuse, pair_equations, pairs
from tests import drawn, synthetic

CAMERA = synthetic.camera(16)
HEIGHT = 0.05
STEP = synthetic.step(CAMERA, HEIGHT)
ALL = np.ones((16, 16), bool)
RAYS = drawn.rays_of(CAMERA, ALL)
DEPTH = STEP.depth[ALL].astype(np.float64)
NORMAL = CAMERA.normals_to_world(STEP.normal)[ALL]
NOISE = 3e-3
RIGHT = (np.arange(256) % 16) >= 8
BESIDE = np.isin(np.arange(256) % 16, (7, 8))


@pytest.fixture
def noisy() -> NDArray[np.float64]:
    return DEPTH + NOISE * np.random.default_rng(0).standard_normal(256)


def rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_neighbours_are_paired_once() -> None:
    mask = np.array([[1, 1, 0], [0, 1, 1]], bool)
    assert {tuple(sorted(p)) for p in pairs(mask).tolist()} == {(0, 1), (1, 2), (2, 3)}
    assert len(pairs(ALL)) == 2 * 15 * 16


def test_a_plane_fulfils_its_equations() -> None:
    tilted = synthetic.plane(CAMERA, np.array([0.3, 0.2, np.sqrt(1 - 0.13)]))
    depth, normal = tilted.depth[ALL].astype(np.float64), CAMERA.normals_to_world(tilted.normal)[ALL]
    both = pairs(ALL)
    a, b, distance = pair_equations(RAYS, depth, normal, both)
    assert np.abs((a * depth[both] * [1, -1]).sum(1) + b).max() < 1e-5 * distance.min()
    np.testing.assert_allclose(distance, 0.125, rtol=0.15)
    a, b, _ = pair_equations(RAYS, depth, np.broadcast_to([0.0, 0, 1], normal.shape), both)  # wrong normals do not
    assert np.abs((a * depth[both] * [1, -1]).sum(1) + b).max() > 0.1 * distance.min()


def test_noise_shrinks_and_the_step_stays(noisy: NDArray[np.float64]) -> None:
    fused = fuse(ALL, RAYS, noisy, np.full(256, NOISE), NORMAL)
    assert rms(fused - DEPTH) < 0.6 * rms(noisy - DEPTH)
    height = np.mean(fused[BESIDE & ~RIGHT]) - np.mean(fused[BESIDE & RIGHT])
    assert height == pytest.approx(HEIGHT, rel=0.1)


def test_plain_least_squares_would_blur_the_step(noisy: NDArray[np.float64]) -> None:
    """The negative control: the same equations without robust weights."""
    both = pairs(ALL)
    a, b, distance = pair_equations(RAYS, noisy, NORMAL, both)
    matrix = np.zeros((len(both), 256))
    matrix[np.arange(len(both)), both[:, 0]], matrix[np.arange(len(both)), both[:, 1]] = a[:, 0], -a[:, 1]
    weight = 1 / (0.02 * distance)
    left = np.concatenate([matrix * weight[:, None], np.eye(256) / NOISE])
    right = np.concatenate([-b * weight, noisy / NOISE])
    blurred = np.linalg.lstsq(left, right, rcond=None)[0]
    height = np.mean(blurred[BESIDE & ~RIGHT]) - np.mean(blurred[BESIDE & RIGHT])
    assert height < 0.9 * HEIGHT


def test_wrong_depths_give_way_to_their_neighbours(noisy: NDArray[np.float64]) -> None:
    wrong = np.random.default_rng(1).choice(np.flatnonzero(~BESIDE), 20, replace=False)
    spoilt = noisy.copy()
    spoilt[wrong] += np.where(np.arange(20) % 2, 0.3, -0.3)
    deviation = np.full(256, NOISE)
    deviation[wrong] = 0.1
    fused = fuse(ALL, RAYS, spoilt, deviation, NORMAL)
    assert np.abs(fused - DEPTH)[wrong].max() < 0.02
    assert rms(np.delete(fused - DEPTH, wrong)) < 1.2 * rms(np.delete(noisy - DEPTH, wrong))
    assert disagreement(ALL, RAYS, spoilt, NORMAL)[wrong].min() > 0.2
    assert np.median(disagreement(ALL, RAYS, spoilt, NORMAL)) < 3 * NOISE


def test_certain_depths_are_kept_to_the_last_digit() -> None:
    fused = fuse(ALL, RAYS, DEPTH, np.full(256, 1e-9), NORMAL)
    np.testing.assert_allclose(fused, DEPTH, rtol=0, atol=1e-6)


def test_the_step_is_no_disagreement() -> None:
    assert disagreement(ALL, RAYS, DEPTH, NORMAL).max() < 0.01 * HEIGHT


def test_unknown_pixels_stay_unknown_and_pass_nothing_on(noisy: NDArray[np.float64]) -> None:
    holes = np.arange(256) % 5 == 0
    depth, normal = np.where(holes, np.nan, noisy), np.where(holes[:, None], np.nan, NORMAL)
    fused = fuse(ALL, RAYS, depth, np.where(holes, np.inf, NOISE), normal)
    assert np.isnan(fused[holes]).all() and np.isfinite(fused[~holes]).all()
    assert rms((fused - DEPTH)[~holes]) < rms((noisy - DEPTH)[~holes])


def test_a_pixel_alone_has_nobody_to_disagree_with() -> None:
    mask = np.zeros((16, 16), bool)
    mask[3, 4] = mask[9, 9] = True
    chosen = mask.ravel()
    assert np.isinf(disagreement(mask, RAYS[chosen], DEPTH[chosen], NORMAL[chosen])).all()
    fused = fuse(mask, RAYS[chosen], DEPTH[chosen], np.full(2, NOISE), NORMAL[chosen])
    np.testing.assert_allclose(fused, DEPTH[chosen])
