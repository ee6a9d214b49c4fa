"""Fewer lights, evenly chosen; which settings are beaten."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.core.capture import Capture
from pipeline.core.errors import LightsphereError
from pipeline.core.shape.settings import ShapeSettings
from pipeline.core.tradeoff import Trial, as_row, dominated, light_counts, thinned
from tests import synthetic


@pytest.fixture
def capture() -> Capture:
    lights = synthetic.lights(320, 80)
    names = tuple(f"{i}.exr" for i in range(400))
    return Capture(Path("nowhere"), synthetic.camera(), lights, names, ("",) * 400, {})


def gaps(positions: np.ndarray) -> np.ndarray:
    """Angle from every light to its nearest neighbour [degrees]."""
    unit = positions / np.linalg.norm(positions, axis=1, keepdims=True)
    cosine = unit @ unit.T - 2 * np.eye(len(unit))
    return np.degrees(np.arccos(np.clip(cosine.max(axis=1), -1, 1)))


def test_the_lights_kept_are_evenly_spread(capture: Capture) -> None:
    part = thinned(capture, 80, 20)
    inner = part.lights.position[part.lights.on("inner")]
    assert len(part.lights.on("inner")) == 80 and len(part.lights.on("outer")) == 20
    assert len(set(part.files)) == 100
    assert gaps(inner).min() > 0.6 * np.degrees(np.sqrt(4 * np.pi / 80))
    assert gaps(capture.lights.position[:80]).min() < 0.6 * np.degrees(np.sqrt(4 * np.pi / 80))  # a bad choice fails
    for name, position in zip(part.files, part.lights.position, strict=True):
        np.testing.assert_array_equal(position, capture.lights.position[int(name.partition(".")[0])])


def test_all_lights_are_all_lights(capture: Capture) -> None:
    assert thinned(capture, 320, 80).files == capture.files
    with pytest.raises(LightsphereError, match="80 outer lights"):
        thinned(capture, 320, 81)


def test_fractions_become_counts_of_at_least_eight(capture: Capture) -> None:
    found = light_counts(capture, (0.01, 0.25, 1.0), ShapeSettings())
    assert [variant.label for variant in found] == ["8/8", "80/20", "320/80"]
    assert light_counts(capture, (1.0,), ShapeSettings(objective="source"))[0].label == "320/80 source"


def trial(label: str, seconds: float, error: float, recovered: float = 100.0) -> Trial:
    return Trial(label, 1, seconds, {"depth_median_pct": error, "recovered_pct": recovered})


def test_the_pareto_front_is_what_nothing_beats() -> None:
    trials = [trial("slow", 9, 0.1), trial("quick", 1, 0.5), trial("bad", 2, 0.6), trial("holes", 0.5, 0.05, 40)]
    assert dominated(trials, "depth_median_pct") == ["", "", "quick", ""]
    assert dominated([trial("a", 1, 1), trial("b", 1, 1)], "depth_median_pct") == ["", ""]
    assert dominated([trial("a", 1, 1), trial("b", 1, 1, 90)], "depth_median_pct") == ["", "a"]
    nothing = trial("nothing", 3, np.nan, 0)
    assert dominated([trial("a", 1, 1), nothing], "depth_median_pct") == ["", "a"]


def test_a_row_is_flat() -> None:
    assert as_row(trial("quick", 1, 0.5), "slow") == {
        "label": "quick",
        "lights": 1,
        "seconds": 1,
        "depth_median_pct": 0.5,
        "recovered_pct": 100.0,
        "beaten_by": "slow",
    }
