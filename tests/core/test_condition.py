"""Condition numbers: of a system, as a note, and of the lights that a pixel sees."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.condition import BAD, condition, noted
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.shape.photometric.recover import recover
from pipeline.core.shape.settings import ShapeSettings
from tests import drawn, oracles, synthetic


def cone(degrees: float, count: int = 12) -> NDArray[np.float64]:
    """Directions about z, half of them as far from it as some degrees."""
    turn = 2 * np.pi * np.arange(count) / count
    tilt = np.radians(degrees) * (0.5 + 0.5 * (np.arange(count) % 2))
    return oracles.unit(np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=-1))


def test_it_is_that_of_the_error_of_solutions() -> None:
    """Of the matrix scaled to a diagonal of ones: units do not count."""
    rng = np.random.default_rng(3)
    a = rng.normal(size=(50, 4))
    a[:, 3] = a[:, 2] + 1e-3 * a[:, 3]
    gram = a.T @ a
    unit = gram / np.sqrt(np.outer(np.diag(gram), np.diag(gram)))
    assert condition(gram) == pytest.approx(np.linalg.cond(unit), rel=1e-6)
    units = np.diag([1e-6, 1.0, 1e6, 3.0])
    assert condition(units @ gram @ units) == pytest.approx(condition(gram), rel=1e-4)
    assert condition(gram) > 1e5 > 10 > condition(np.eye(4))


def test_what_cannot_be_told_apart_is_infinite_and_what_is_not_there_does_not_count() -> None:
    assert condition(np.ones((2, 2))) == np.inf
    assert condition(np.diag([1.0, 0.0, 5.0])) == pytest.approx(1.0)
    assert condition(np.zeros((3, 3))) == pytest.approx(1.0)
    found = condition(np.stack([np.eye(2), np.ones((2, 2)), np.array([[1, 0.5], [0.5, 1]])]))
    assert found == pytest.approx([1.0, np.inf, 3.0])
    note = noted(found)
    assert note == {"median": pytest.approx(3.0), "worst": None, "bad_share": pytest.approx(1 / 3)}
    assert json.loads(json.dumps(note, allow_nan=False)) == note
    assert noted(np.empty(0)) == {}


def test_lights_in_a_narrow_cone_are_noted_and_lower_the_confidence() -> None:
    ball = synthetic.ball(synthetic.camera(16, "orthographic"))
    found = {}
    for degrees in (60.0, 1.0):
        towards = cone(degrees) @ ball.camera.to_world[:3, :3].T
        lights = Lights("distant", towards, np.full((12, 3), np.pi), np.full(12, 2))
        capture = drawn.draw(ball, lights, drawn.lambert)
        shape = finish(recover(capture, ShapeSettings(method="lambertian"))).shape
        facing = ball.normal[..., 2] > 0.9
        expected = float(condition(towards.T @ towards, one_unit=True))
        assert shape.notes["condition"]["lights of a pixel"]["median"] > 0.9 * expected  # some pixels see fewer
        found[degrees] = float(np.median(shape.confidence[facing & (shape.confidence > 0)]))
        assert found[degrees] == pytest.approx(1 / (1 + expected / BAD), rel=0.1)
    assert found[1.0] < 0.5 < 0.98 < found[60.0]


def test_all_lights_in_one_plane_but_one_are_worse_than_all_about() -> None:
    towards = cone(60.0)
    flat = oracles.unit(towards * [1.0, 0.01, 1.0])
    worse, usual = (float(condition(one.T @ one, one_unit=True)) for one in (flat, towards))
    assert worse > 1000 * usual
