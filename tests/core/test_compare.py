"""Figures against truth, on errors that were planted."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.core.capture import Truth
from pipeline.core.compare.lights import captured_lights, new_lights
from pipeline.core.compare.pictures import Comparison, picture_error, relative_rmse, structural_similarity
from pipeline.core.compare.shapes import depth_error_pct, normal_error_deg, shape_errors
from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights
from pipeline.core.shape import Shape
from tests import oracles, synthetic


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


def test_structural_similarity_is_one_for_equal_pictures_and_as_defined_for_even_ones() -> None:
    rng = np.random.default_rng(2)
    reference = rng.uniform(0, 1, (20, 24, 3))
    assert structural_similarity(reference, reference) == pytest.approx(1)
    even = structural_similarity(np.full((9, 9, 3), 0.5), np.full((9, 9, 3), 0.25))
    assert even == pytest.approx((2 * 0.125 + 1e-4) / (0.3125 + 1e-4))
    mirrored = structural_similarity(1 - reference, reference)
    assert mirrored.mean() < -0.5
    noisy = [
        structural_similarity(reference + rng.normal(0, s, reference.shape), reference).mean() for s in (0.05, 0.2)
    ]
    assert 1 > noisy[0] > noisy[1] > 0


def test_a_comparison_counts_the_object_s_pixels_and_every_light_alike() -> None:
    references = np.random.default_rng(3).uniform(0.1, 1, (2, 5, 6, 3)).astype(np.float32)
    references[1] *= 100
    mask = np.zeros((5, 6), bool)
    mask[1:3] = True
    pictures = references * np.array([1.1, 1.3], np.float32)[:, None, None, None]
    pictures[:, ~mask] = 0
    compared = Comparison("", "", pictures, references, mask)
    assert compared.relative_rmse == pytest.approx(0.2, rel=1e-5)
    assert np.isfinite(compared.error).tolist() == mask.tolist()


@pytest.mark.parametrize("model", ["near", "distant"])
def test_new_lights_lie_within_the_captured_cone_and_on_none_of_it(model: str) -> None:
    view = synthetic.camera(8)
    near = model == "near"
    captured = synthetic.lights() if near else cone_of_lights(40.0)
    found = new_lights(captured, view, 12)
    centre = captured.position.mean(axis=0) if near else np.zeros(3)
    directions = oracles.unit(found.position - centre)
    assert len(found) == 12
    assert found.kind == captured.kind
    assert directions[:, 2].min() > np.cos(np.radians(70 if near else 40)) - 1e-9
    assert np.linalg.norm(captured.position[:, None] - found.position, axis=-1).min() > 1e-3
    if near:
        reach = np.linalg.norm(captured.position - centre, axis=1)
        assert reach.min() < np.linalg.norm(found.position - centre, axis=1).min()
        assert np.linalg.norm(found.position - centre, axis=1).max() < reach.max()
    chosen = captured_lights(captured, view, 5)
    assert len(chosen) == 5
    assert oracles.unit(captured.position[chosen] - centre)[:, 2].min() > np.cos(np.radians(70)) - 1e-9


def cone_of_lights(degrees: float) -> Lights:
    """Distant lights on a ring about the view and one in its middle."""
    around = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    sine = np.sin(np.radians(degrees))
    ring = np.stack([sine * np.cos(around), sine * np.sin(around), np.full(12, np.cos(np.radians(degrees)))], axis=-1)
    directions = np.concatenate([[[0, 0, 1.0]], ring])
    return Lights("distant", directions, np.ones((13, 3)), np.full(13, 2))
