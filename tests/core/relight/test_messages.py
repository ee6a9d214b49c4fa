"""Emitters sent as a line and read again."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import LightsphereError
from pipeline.core.relight import emitters, messages
from pipeline.core.relight.emitters import Emitter
from pipeline.core.relight.profiles import SpotProfile, SpreadProfile

ONE = np.ones(3)
POINTS = np.random.default_rng(3).normal(size=(200, 3)) * 3


def test_every_kind_of_emitter_shines_alike_at_the_other_end() -> None:
    frame = emitters.axes_along(np.array([0.6, 0.0, 0.8]))
    sent = [
        emitters.point([1.0, 2.0, 3.0], [0.1, 0.2, 1 / 3]),
        emitters.distant([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]),
        Emitter(np.array([0.0, 0.0, 4.0]), ONE, to_world=frame, profile=SpotProfile(1.1, 0.3, (0.7, 1.0))),
        Emitter(np.array([0.0, 1.0, 4.0]), ONE, facing=frame[:, 2], to_world=frame, profile=SpreadProfile(1.3)),
        *emitters.ball(np.array([1.0, 0.0, 5.0]), 0.3, ONE, 9),
        *emitters.line(np.zeros(3), np.array([0.0, 7.0, 0.0]), ONE, 5),
    ]
    line = messages.as_line(sent)
    assert "\n" not in line
    read = messages.of_line(line)
    assert len(read) == len(sent)
    for a, b in zip(sent, read, strict=True):
        np.testing.assert_array_equal(a.irradiance(POINTS), b.irradiance(POINTS))


@pytest.mark.parametrize("line", ["", "{", "[1]", "[{}]", '[{"place": [0, 0, 1]}]'])
def test_another_line_is_refused(line: str) -> None:
    with pytest.raises(LightsphereError, match="no list of emitters"):
        messages.of_line(line)


def test_a_light_that_has_moved_is_another_line() -> None:
    one, other = (messages.as_line([emitters.point([x, 0.0, 1.0], ONE)]) for x in (1.0, 1.0 + 1e-15))
    assert one != other
