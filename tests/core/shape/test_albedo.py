"""The paints' being few tells the relief, which a matt body's pictures leave open."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.compare.shapes import angles_deg
from pipeline.core.shape.uncalibrated.albedo import entropy, least_entropy
from tests import oracles, synthetic, tolerances
from tests.core.shape.test_uncalibrated import BUT_ALBEDO, lamps, photographed, solved, view

Array = NDArray[Any]
AWAY = np.array([0.1, -0.15, 0.3])  # a bas-relief transformation's v
AXIS = np.array([0.0, 0.0, 1.0])


def normals_of_a_ball() -> Array:
    ball = synthetic.ball(view(20, 30))
    return ball.normal[np.isfinite(ball.depth)].astype(np.float64)


def paints(normals: Array) -> Array:
    """Three paints in patches, two of them of one hue."""
    patch = (np.floor(3 * normals + 0.4).astype(int) @ [3, 5, 7]) % 3
    return np.array([[0.7, 0.4, 0.2], [0.35, 0.2, 0.1], [0.1, 0.3, 0.5]])[patch]


def transformed(normals: Array, colours: Array, change: Array) -> tuple[Array, Array]:
    moved = normals + np.outer(normals @ AXIS, change)
    size = np.linalg.norm(moved, axis=1, keepdims=True)
    return moved / size, colours * size


def test_a_bas_relief_of_few_paints_is_found_back() -> None:
    normals = normals_of_a_ball()
    wrong, colours = transformed(normals, paints(normals), AWAY)
    views = np.broadcast_to(AXIS, normals.shape)
    found = least_entropy(colours, np.zeros(len(normals)), wrong, views)
    assert found is not None
    back, _ = transformed(wrong, colours, found.change)
    assert angles_deg(back, normals).mean() < 0.05 < 5 < angles_deg(wrong, normals).mean()
    assert 1.0 < found.albedos < 1.8
    # a state without error: nothing moves
    still = least_entropy(paints(normals), np.zeros(len(normals)), normals, views)
    assert still is not None and np.linalg.norm(still.change) < 1e-3


def test_paint_that_differs_from_pixel_to_pixel_tells_hardly_anything() -> None:
    normals = normals_of_a_ball()
    colours = np.exp(0.5 * np.random.default_rng(0).standard_normal((len(normals), 1))) * [0.5, 0.4, 0.3]
    views = np.broadcast_to(AXIS, normals.shape)
    few = least_entropy(paints(normals), np.zeros(len(normals)), normals, views)
    many = least_entropy(colours, np.zeros(len(normals)), normals, views)
    assert few is not None and many is not None
    assert many.albedos > 5
    assert np.linalg.eigvalsh(many.curvature)[-1] < 1e-3 * np.linalg.eigvalsh(few.curvature)[-1]


def test_light_of_lobes_is_no_albedo() -> None:
    normals = normals_of_a_ball()
    bright = np.full(len(normals), 3.0)
    assert least_entropy(paints(normals), bright, normals, np.broadcast_to(AXIS, normals.shape)) is None


def test_the_lights_follow_the_relief_whatever_their_scale() -> None:
    normals = normals_of_a_ball()
    wrong, colours = transformed(normals, paints(normals), AWAY)
    found = least_entropy(colours, np.zeros(len(normals)), wrong, np.broadcast_to(AXIS, normals.shape))
    assert found is not None
    lights = lamps().position @ np.linalg.inv(np.eye(3) + np.outer(AWAY, AXIS))  # those of the wrong normals
    matrix, target = found.cue(lights)

    def off(candidate: Array) -> float:
        return float(np.linalg.norm(matrix @ candidate.ravel() - target))

    right = lamps().position
    assert off(right) < 0.03 * off(lights)
    assert off(1.1 * right) < 0.13 * off(lights)
    assert off(1.1 * lights) == pytest.approx(off(lights), rel=1e-6)


def test_slopes_of_the_entropy_are_those_of_its_values() -> None:
    random = np.random.default_rng(1)
    normals = oracles.unit(random.standard_normal((50, 3)) + 2.0 * AXIS)
    logarithms, change, step = 0.2 * random.standard_normal((50, 3)), np.array([0.05, -0.1, 0.2]), 1e-5

    def at(where: Array) -> tuple[float, Array, Array]:
        return entropy(logarithms, normals, normals @ AXIS, where, 0.2)

    slope = at(change)[1]
    for i in range(3):
        ahead, behind = (at(change + s * step * np.eye(3)[i])[0] for s in (1, -1))
        assert slope[i] == pytest.approx((ahead - behind) / (2 * step), rel=1e-5)


@pytest.mark.slow
def test_a_matt_ball_seen_from_afar_comes_back_by_its_paints_alone() -> None:
    """Neither perspective nor highlights tell its relief, and outline and strengths are believed to a few degrees."""
    capture = photographed(view(20), lamps(), gloss=0.0)
    told, blind = solved(capture), solved(capture, cues=BUT_ALBEDO)
    error, without = (angles_deg(one.lights.position, lamps().position).mean() for one in (told, blind))
    assert error < tolerances.UNKNOWN_LIGHTS and error < 0.3 * without
    assert error < 4 * told.deviation.mean() and told.deviation.mean() < 0.5 * blind.deviation.mean()
