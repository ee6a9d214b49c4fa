"""Surfaces from normals: known surfaces come back, depth edges stay, and measured depths give way only where wrong."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from pipeline.core.camera import Camera
from pipeline.core.errors import LightsphereError
from pipeline.core.shape import Shape, integration, multigrid
from pipeline.core.shape.integration import integrate
from pipeline.core.shape.tangents import disagreement, neighbour_pairs
from tests import drawn, synthetic

SIZE = 48
MODELS = ("orthographic", "pinhole")
HINGED = np.array([0.0, -0.7, 1.0]) / np.hypot(0.7, 1.0)


def footprints(found: NDArray[np.float64], true: Shape) -> NDArray[np.float64]:
    """Depth errors in footprints after the shift (orthographic) or scale (pinhole) that normals leave open."""
    known = np.isfinite(true.depth) & np.isfinite(found)
    a, b = found[known], true.depth[known].astype(np.float64)
    a = a * np.median(b / a) if true.camera.model == "pinhole" else a + np.median(b - a)
    return np.asarray((a - b) / true.camera.pixel_size(b))


def whole(true: Shape) -> NDArray[np.bool_]:
    return np.isfinite(true.depth)


def flap(view: Camera) -> tuple[Shape, NDArray[np.bool_]]:
    """A plane out of which a flap is folded: it joins at the hinge, its two sides are depth edges of growing height."""
    size = view.resolution[0]
    low, high = synthetic.plane(view, np.array([0.0, 0.0, 1.0])), synthetic.plane(view, HINGED)
    column, row = np.meshgrid(np.arange(size), np.arange(size))
    raised = (column >= size // 3) & (column < 2 * size // 3) & (row < size // 2)
    normal = np.where(raised[..., None], high.normal, low.normal)
    depth = np.where(raised, high.depth, low.depth).astype(np.float64)
    return synthetic.shape_of(view, depth, view.normals_to_world(normal)), raised


def noisy(normal: NDArray[np.float32], degrees: float) -> NDArray[np.float64]:
    turned = normal + np.radians(degrees) * np.random.default_rng(0).standard_normal(normal.shape)
    return np.asarray(turned / np.linalg.norm(turned, axis=-1, keepdims=True))


@pytest.mark.parametrize("model", MODELS)
def test_a_ball_comes_out_as_that_ball(model: str) -> None:
    true = synthetic.ball(synthetic.camera(SIZE, model))
    found = integrate(true.normal, whole(true), true.camera)
    assert np.abs(footprints(found, true)).max() < 1e-3  # mean normals are exact on spheres
    assert np.array_equal(np.isfinite(found), whole(true))
    inward = true.normal * np.array([-1, -1, 1], np.float32)
    assert np.abs(footprints(integrate(inward, whole(true), true.camera), true)).max() > 5  # a hollow is no ball


@pytest.mark.parametrize("model", MODELS)
def test_a_tilted_plane_is_exact(model: str) -> None:
    tilted = synthetic.plane(synthetic.camera(SIZE, model), np.array([0.3, 0.2, np.sqrt(1 - 0.13)]))
    assert np.abs(footprints(integrate(tilted.normal, whole(tilted), tilted.camera), tilted)).max() < 1e-4


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("degrees", [0.0, 1.5])
def test_a_folded_flap_keeps_its_edges(model: str, degrees: float) -> None:
    true, _ = flap(synthetic.camera(SIZE, model))
    error = np.abs(footprints(integrate(noisy(true.normal, degrees), whole(true), true.camera), true))
    assert error.max() < 0.5
    jump = true.depth[0, SIZE // 3 - 1] - true.depth[0, SIZE // 3]
    assert jump > 10 * true.camera.pixel_size(true.depth[0, SIZE // 3])


@pytest.mark.parametrize("model", MODELS)
def test_plain_least_squares_would_bridge_them(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The negative control: the same equations with one round of equal weights."""
    monkeypatch.setattr(integration, "_weight", np.ones_like)
    true, raised = flap(synthetic.camera(SIZE, model))
    error = np.abs(footprints(integrate(true.normal, whole(true), true.camera), true))
    assert error[raised.ravel()].mean() > 2 and np.percentile(error, 90) > 1


def test_a_step_that_no_normal_shows_stays_where_depths_were_measured() -> None:
    view = synthetic.camera(SIZE)
    true = synthetic.step(view, 0.2)
    deviation = 0.1 * view.pixel_size(true.depth)
    measured = true.depth + deviation * np.random.default_rng(0).standard_normal(true.depth.shape)
    found = integrate(true.normal, whole(true), view, depth=measured, deviation=deviation)
    assert np.abs(found - true.depth).max() < 0.5 * deviation.min()
    unseen = integrate(true.normal, whole(true), view)
    assert np.ptp(unseen) < 0.1 * np.ptp(true.depth) + np.ptp(true.depth[:, : SIZE // 2])


def test_from_far_away_a_pinhole_camera_sees_as_an_orthographic_one() -> None:
    near, far = (synthetic.ball(synthetic.camera(SIZE, m, distance=5000.0)) for m in MODELS)
    both = whole(near) & whole(far)
    a, b = (integrate(true.normal, both, true.camera) for true in (near, far))
    apart = (a - b)[both]
    assert np.ptp(apart) < 0.02 * near.camera.pixel_size(near.depth[both]).min()


def test_depths_scale_with_the_scene() -> None:
    true, _ = flap(synthetic.camera(SIZE))
    deviation = 0.01 * np.ones_like(true.depth)
    found = integrate(true.normal, whole(true), true.camera, depth=true.depth, deviation=deviation)
    doubled = integrate(true.normal, whole(true), true.camera, depth=2 * true.depth, deviation=2 * deviation)
    np.testing.assert_allclose(doubled, 2 * found, rtol=1e-9)


@pytest.mark.parametrize("model", MODELS)
def test_noise_averages_out_without_a_drift(model: str) -> None:
    true = synthetic.ball(synthetic.camera(SIZE, model))
    error = np.abs(footprints(integrate(noisy(true.normal, 2.0), whole(true), true.camera), true))
    assert np.median(error) < 0.1 and error.mean() < 0.15


def test_holes_are_left_out_and_gaps_in_depth_are_filled() -> None:
    true = synthetic.ball(synthetic.camera(SIZE))
    hole = np.zeros_like(whole(true))
    hole[20:26, 18:30] = True
    normal = np.where(hole[..., None], np.nan, true.normal)
    found = integrate(normal, whole(true), true.camera)
    assert np.isnan(found[hole]).all() and np.isfinite(found[whole(true) & ~hole]).all()
    assert np.abs(footprints(found, true)).max() < 1e-3
    gap = np.where(hole, np.nan, true.depth)
    filled = integrate(true.normal, whole(true), true.camera, depth=gap, deviation=np.where(hole, np.inf, 1e-4))
    assert np.abs(filled - true.depth)[whole(true)].max() < 1e-4


def test_parts_that_nothing_joins_are_put_about_the_origin_or_the_measured_part() -> None:
    view = synthetic.camera(SIZE, "orthographic", distance=5.0)
    true = synthetic.plane(view, np.array([0.3, 0.0, np.sqrt(1 - 0.09)]))
    parts = np.zeros((SIZE, SIZE), bool)
    parts[2:9, 3:20] = parts[30:44, 8:40] = True
    found = integrate(true.normal, parts, view)
    for part in (parts & (np.arange(SIZE)[:, None] < 20), parts & (np.arange(SIZE)[:, None] > 20)):
        assert found[part].mean() == pytest.approx(5.0)
        assert np.ptp((found - true.depth)[part]) < 1e-4
    only = np.where(np.arange(SIZE)[:, None] < 20, 7.0 + true.depth, np.nan)
    found = integrate(true.normal, parts, view, depth=only, deviation=np.full_like(only, 1e-3))
    assert found[30:44, 8:40].mean() == pytest.approx(np.median(only[2:9, 3:20]), abs=1e-3)


def test_a_pixel_alone_and_one_that_only_touches_a_corner() -> None:
    view = synthetic.camera(SIZE, "orthographic", distance=5.0)
    mask = np.zeros((SIZE, SIZE), bool)
    mask[4, 5] = mask[5, 6] = True
    found = integrate(np.broadcast_to([0.0, 0.0, 1.0], (SIZE, SIZE, 3)), mask, view)
    np.testing.assert_allclose(found[mask], 5.0)


def test_wrong_depths_give_way_and_certain_ones_stay() -> None:
    view = synthetic.camera(SIZE)
    true = synthetic.ball(view)
    spoilt = true.depth.astype(np.float64)
    deviation = np.full_like(spoilt, 1e-9)
    chosen = np.random.default_rng(1).choice(np.flatnonzero(whole(true)), 60, replace=False)
    spoilt.ravel()[chosen] += 0.3
    deviation.ravel()[chosen] = 0.3
    found = integrate(true.normal, whole(true), view, depth=spoilt, deviation=deviation)
    right = whole(true).ravel()
    assert np.abs(found - true.depth).ravel()[chosen].max() < 0.01
    right[chosen] = False
    np.testing.assert_allclose(found.ravel()[right], true.depth.ravel()[right], atol=1e-6)


def test_normals_without_confidence_say_nothing() -> None:
    true = synthetic.ball(synthetic.camera(SIZE, "orthographic"))
    wrong = true.normal.copy()
    spoilt = np.zeros_like(whole(true))
    spoilt[20:24, 20:24] = True
    wrong[spoilt] = [0.6, 0.0, 0.8]
    trusted = integrate(wrong, whole(true), true.camera, confidence=np.where(spoilt, 0.0, 1.0))
    aside = ~spoilt[whole(true)]
    assert np.abs(footprints(trusted, true)[aside]).max() < 0.02


def test_without_deviations_depth_gives_the_scale_and_normals_the_relief() -> None:
    true = synthetic.ball(synthetic.camera(SIZE))
    step = 2 * float(true.camera.pixel_size(np.array(5.0)))
    coarse = np.round(true.depth / step) * step
    found = integrate(true.normal, whole(true), true.camera, depth=coarse)
    assert np.nanmean(np.abs(found - true.depth)) < 0.3 * np.nanmean(np.abs(coarse - true.depth))


def test_bad_input_is_named() -> None:
    view = synthetic.camera(8)
    normal = np.full((8, 8, 3), np.nan)
    with pytest.raises(LightsphereError, match="no pixel of the mask has a normal"):
        integrate(normal, np.ones((8, 8), bool), view)
    with pytest.raises(LightsphereError, match="depth has the shape"):
        integrate(normal, np.ones((8, 8), bool), view, depth=np.ones((4, 4)))


def test_disagreement_is_large_for_wrong_depths_and_none_at_a_step() -> None:
    true = synthetic.step(synthetic.camera(16), 0.05)
    every = np.ones((16, 16), bool)
    rays, normal = drawn.rays_of(true.camera, every), true.camera.normals_to_world(true.normal)[every]
    depth = true.depth[every].astype(np.float64)
    assert disagreement(every, rays, depth, normal, True).max() < 1e-3 * 0.05
    depth[100] += 0.3
    assert disagreement(every, rays, depth, normal, True)[100] > 0.2
    alone = np.zeros((16, 16), bool)
    alone[3, 4] = True
    assert np.isinf(disagreement(alone, rays[:1], depth[:1], normal[:1], True)).all()


@pytest.mark.parametrize("held", [0.0, 1.0])
def test_the_solver_solves_across_weak_couplings(held: float) -> None:
    """Weights over six decades, cut by lines of almost none; compared with a direct solution."""
    size, random = 60, np.random.default_rng(0)
    beside, above = neighbour_pairs(np.ones((size, size), bool))
    pairs = np.concatenate([beside, above])
    weight = 10.0 ** random.uniform(-1, 1, len(pairs))
    weight[(pairs[:, 0] % size == 20) & (pairs[:, 1] % size == 21)] = 1e-5
    rows = np.tile(np.arange(len(pairs)), 2)
    entries = (np.repeat([-1.0, 1.0], len(pairs)), (rows, pairs.T.ravel()))
    difference = sparse.csr_array(entries, shape=(len(pairs), size * size))
    own = np.where(random.random(size * size) < 0.1, 1e4 * held, 1e-8)
    matrix = (difference.T @ sparse.diags_array(weight) @ difference + sparse.diags_array(own)).tocsr()
    right = difference.T @ random.standard_normal(len(pairs))
    found = multigrid.solve(matrix, right, np.argwhere(np.ones((size, size), bool)), 1e-8)
    exact = spsolve(matrix.tocsc(), right)
    assert np.sqrt((found - exact) @ (matrix @ (found - exact))) < 1e-5 * np.sqrt(exact @ (matrix @ exact))
