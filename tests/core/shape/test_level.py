"""A surface and its near lights at another level look the same."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.core.capture import Truth
from pipeline.core.compare.shapes import light_errors
from pipeline.core.lights import Lights
from pipeline.core.shape import Shape, level
from tests import drawn, oracles, synthetic


def lamps() -> Lights:
    random = np.random.default_rng(4)
    position = oracles.unit(random.standard_normal((7, 3)) + np.eye(3)[2] * 2) * random.uniform(1.5, 3.0, (7, 1))
    return Lights("near", position, random.uniform(2.0, 5.0, (7, 3)), np.full(7, 2))


def at(shape: Shape, moved: float) -> Shape:
    depth = level.depth_at(shape.camera, shape.depth, moved)
    return dataclasses.replace(shape, depth=depth.astype(np.float32))


@pytest.mark.parametrize(("model", "moved"), [("pinhole", 1.7), ("orthographic", -0.6)])
def test_nothing_is_seen_of_a_change_of_level(model: str, moved: float) -> None:
    camera = synthetic.camera(24, model)
    ball, lights = synthetic.ball(camera), lamps()
    there = level.lights_at(camera, lights, moved)
    before, after = drawn.draw(ball, lights, drawn.ggx), drawn.draw(at(ball, moved), there, drawn.ggx)
    np.testing.assert_allclose(after.pictures, before.pictures, rtol=1e-4, atol=1e-6)
    unmoved = drawn.draw(at(ball, moved), lights, drawn.ggx)
    assert np.abs(unmoved.pictures - before.pictures).max() > 0.1 * np.abs(before.pictures).max()  # type: ignore[operator]
    assert level.change(camera, ball.depth, at(ball, moved).depth) == pytest.approx(moved, rel=1e-5)


def test_lights_are_judged_at_the_level_of_the_truth() -> None:
    camera = synthetic.camera(24)
    ball, lights = synthetic.ball(camera), lamps()
    truth = Truth(ball.depth, ball.normal, ball.normal, np.ones((24, 24), np.int32), 1.6)
    grown, there = at(ball, 2.0), level.lights_at(camera, lights, 2.0)
    assert max(light_errors(there, lights, grown, truth).values()) < 0.01
    middle = ball.middle()
    farther = dataclasses.replace(lights, position=middle + 1.1 * (lights.position - middle))
    off = light_errors(level.lights_at(camera, farther, 2.0), lights, grown, truth)
    assert off["light_mae_deg"] < 0.01 and off["light_distance_pct"] == pytest.approx(10.0, rel=1e-3)
    distant = Lights("distant", oracles.unit(lights.position - middle), lights.intensity, lights.surface)
    assert light_errors(there, distant, grown, truth)["light_mae_deg"] < 0.01
    assert not light_errors(there, dataclasses.replace(lights, kind="unknown"), grown, truth)


def test_depths_without_any_in_common_stay() -> None:
    camera = synthetic.camera(24)
    ball = synthetic.ball(camera)
    nowhere = np.full(ball.depth.shape, np.nan)
    assert level.change(camera, ball.depth, nowhere) == 1.0
    np.testing.assert_array_equal(ball.levelled(nowhere).depth, ball.depth)
