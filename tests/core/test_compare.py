"""Figures against truth, on errors that were planted."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.core.capture import Truth
from pipeline.core.compare import depth_error_pct, normal_error_deg, picture_error, relative_rmse, shape_errors
from pipeline.core.errors import LightsphereError
from pipeline.core.shape import Shape
from tests import synthetic


@pytest.fixture
def found() -> Shape:
    return synthetic.ball(synthetic.camera(24))


def truth_of(shape: Shape, diameter: float = 1.6) -> Truth:
    nothing = np.zeros(shape.depth.shape, np.int32)
    return Truth(shape.depth, shape.normal, shape.points().astype(np.float32), nothing, diameter)


def test_a_perfect_shape_has_no_error(found: Shape) -> None:
    errors = shape_errors(found, truth_of(found), np.isfinite(found.depth))
    assert errors.pop("recovered_pct") == 100
    assert all(value == 0 for value in errors.values())


def test_a_planted_offset_is_stated_in_per_cent_of_the_diameter(found: Shape) -> None:
    off = dataclasses.replace(found, depth=found.depth + np.float32(0.016))
    errors = shape_errors(off, truth_of(found), np.isfinite(found.depth))
    assert errors["depth_median_pct"] == pytest.approx(1.0, rel=1e-4)
    assert errors["depth_p95_pct"] == pytest.approx(1.0, rel=1e-4)
    assert np.nanmax(depth_error_pct(off, truth_of(found, 3.2))) == pytest.approx(0.5, rel=1e-4)


@pytest.mark.parametrize("degrees", [0.001, 30.0, 179.0])
def test_a_planted_angle_is_found(found: Shape, degrees: float) -> None:
    angle = np.radians(degrees)
    normal = found.normal.astype(np.float64)
    side = np.cross(normal, [0.3, -0.8, 0.52])
    side /= np.linalg.norm(side, axis=-1, keepdims=True)
    turned = dataclasses.replace(found, normal=np.cos(angle) * normal + np.sin(angle) * side)
    exact = dataclasses.replace(truth_of(found), normal=normal / np.linalg.norm(normal, axis=-1, keepdims=True))
    error = normal_error_deg(turned, exact)
    assert np.nanmax(np.abs(error - degrees)) < 1e-5


def test_truth_of_normals_alone_gives_figures_of_normals_alone(found: Shape) -> None:
    unknown = np.full(found.depth.shape, np.nan, np.float32)
    errors = shape_errors(found, dataclasses.replace(truth_of(found), depth=unknown), np.isfinite(found.depth))
    assert set(errors) == {"recovered_pct", "normal_mae_deg", "normal_median_deg"}
    assert (errors["recovered_pct"], errors["normal_mae_deg"]) == (100, 0)
    assert not np.isfinite(shape_errors(found, truth_of(found), found.depth < 0)["depth_median_pct"])


def test_unrecovered_pixels_are_counted_and_left_out(found: Shape) -> None:
    depth = found.depth.copy()
    mask = np.isfinite(depth)
    depth[np.nonzero(mask)[0][0]] = np.nan
    errors = shape_errors(dataclasses.replace(found, depth=depth), truth_of(found), mask)
    assert errors["recovered_pct"] == pytest.approx(100 * np.isfinite(depth).sum() / mask.sum())
    assert errors["depth_median_pct"] == 0


def test_nothing_recovered_is_not_a_perfect_result(found: Shape) -> None:
    nothing = dataclasses.replace(found, depth=np.full_like(found.depth, np.nan))
    errors = shape_errors(nothing, truth_of(found), np.isfinite(found.depth))
    assert errors["recovered_pct"] == 0
    assert np.isnan(errors["depth_median_pct"])


def test_thirds_of_confidence_are_told_apart(found: Shape) -> None:
    mask = np.isfinite(found.depth)
    confidence = np.zeros(mask.shape, np.float32)
    confidence[mask] = np.linspace(0.1, 1, mask.sum())
    worst = confidence < 0.4
    off = found.depth + np.where(worst, 0.16, 0.0016).astype(np.float32)
    shape = dataclasses.replace(found, depth=off, confidence=confidence)
    errors = shape_errors(shape, truth_of(found), mask)
    assert errors["confidence_low_p95_pct"] == pytest.approx(10, rel=1e-3)
    assert errors["confidence_high_p95_pct"] == pytest.approx(0.1, rel=1e-3)


def test_pictures_of_other_sizes_are_refused(found: Shape) -> None:
    other = truth_of(synthetic.ball(synthetic.camera(20)))
    with pytest.raises(LightsphereError, match="24x24"):
        depth_error_pct(found, other)
    with pytest.raises(LightsphereError, match="3x2"):
        relative_rmse(np.ones((2, 3, 3)), np.ones((3, 2, 3)))
    with pytest.raises(LightsphereError, match="black"):
        relative_rmse(np.ones((2, 3, 3)), np.zeros((2, 3, 3)))


def test_five_per_cent_are_five_per_cent() -> None:
    reference = np.random.default_rng(1).uniform(0.1, 2, (5, 7, 3))
    assert relative_rmse(1.05 * reference, reference) == pytest.approx(0.05)
    assert relative_rmse(np.zeros_like(reference), reference) == pytest.approx(1)
    assert relative_rmse(reference[::-1], reference) > 0.3
    only_first = np.zeros((5, 7), bool)
    only_first[0] = True
    changed = reference.copy()
    changed[1:] *= 3
    assert relative_rmse(changed, reference, only_first) == 0
    assert np.sqrt(np.mean(picture_error(1.05 * reference, reference) ** 2)) == pytest.approx(0.05)
