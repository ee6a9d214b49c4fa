"""Fewer lights, evenly chosen; which settings are beaten."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.capture import Capture
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import Progress, Work, finish
from pipeline.core.shape.settings import ShapeSettings
from pipeline.core.tradeoff import Trial, Variant, as_row, dominated, measure
from pipeline.core.tradeoff.shape import double_sphere
from pipeline.core.tradeoff.thinning import evenly, thinned, thinned_to
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
    found = double_sphere(capture, (0.01, 0.25, 1.0), ShapeSettings())
    assert [variant.label for variant in found] == ["8/8", "80/20", "320/80"]
    assert [variant.settings["pictures"] for variant in found] == [16, 100, 400]
    assert double_sphere(capture, (1.0,), ShapeSettings(objective="source"))[0].label == "320/80 source"


def test_numbers_are_evenly_spread_without_the_ends_where_others_will_do() -> None:
    assert evenly(400, 3).tolist() == [100, 200, 299]
    assert evenly(3, 12).tolist() == [0, 1, 2]
    assert evenly(1, 5).tolist() == [0]


def test_every_variant_is_timed_and_judged_and_the_lightest_once_before_uncounted() -> None:
    done: list[str] = []

    def variant(label: str, weight: float, seconds: float) -> Variant:
        def work() -> Work[str]:
            done.append(label)
            for part in range(4):
                time.sleep(seconds / 4)
                yield Progress("anything", part + 1, 4)
            return label.upper()

        method = "new" if "new" in label else "old"
        settings = {"n": weight, "method": method}
        return Variant(label, settings, weight, work, lambda result: {"relight_rel_rmse": float(len(result))})

    steps: list[Progress] = []
    finish(measure([variant("new", 2, 0.0), variant("new, slow", 5, 0.0), variant("old", 1, 0.0)]))
    assert done[:2] == ["old", "new"] and len(done) == 5
    done.clear()
    found = finish(measure([variant("slow one", 3, 0.08), variant("quick", 1, 0.0)]), steps.append)
    assert done == ["quick", "slow one", "quick"]
    trials = [trial for trial, _ in found]
    assert [result for _, result in found] == ["SLOW ONE", "QUICK"]
    assert [trial.errors["relight_rel_rmse"] for trial in trials] == [8.0, 5.0]
    assert trials[0].seconds >= 0.08 > trials[1].seconds  # judged by what was slept, not by the machine's speed
    shares = [step.done for step in steps if step.stage == "try"]
    assert shares == sorted(shares) and shares[-1] == 100.0 and 75.0 in shares


def trial(label: str, seconds: float, error: float, recovered: float = 100.0) -> Trial:
    return Trial(label, {"lights": 1}, seconds, {"recovered_pct": recovered, "depth_median_pct": error})


def test_the_pareto_front_is_what_nothing_beats() -> None:
    trials = [trial("slow", 9, 0.1), trial("quick", 1, 0.5), trial("bad", 2, 0.6), trial("holes", 0.5, 0.05, 40)]
    assert dominated(trials) == ["", "", "quick", ""]
    assert dominated([trial("a", 1, 1), trial("b", 1, 1)]) == ["", ""]
    assert dominated([trial("a", 1, 1), trial("b", 1, 1, 90)]) == ["", "a"]
    nothing = trial("nothing", 3, np.nan, 0)
    assert dominated([trial("a", 1, 1), nothing]) == ["", "a"]


def test_a_row_is_flat() -> None:
    assert as_row(trial("quick", 1, 0.5), "slow") == {
        "label": "quick",
        "lights": 1,
        "seconds": 1,
        "depth_median_pct": 0.5,
        "recovered_pct": 100.0,
        "beaten_by": "slow",
    }


def test_at_most_so_many_lights_keep_their_proportion(capture: Capture) -> None:
    part = thinned_to(capture, 100)
    assert [len(part.lights.on(surface)) for surface in ("inner", "outer")] == [80, 20]
    assert thinned_to(capture, 0) is capture
    assert thinned_to(capture, 400) is capture
    unknown = dataclasses.replace(capture, lights=dataclasses.replace(capture.lights, kind="unknown"))
    unknown.lights.surface[:] = 2
    assert len(thinned_to(unknown, 7)) == 7


@pytest.mark.parametrize("fraction", [0.02, 0.06, 0.125, 0.25, 0.5])
def test_as_many_pictures_as_were_tried_are_those_that_were_tried(capture: Capture, fraction: float) -> None:
    """Also where one surface keeps more than its share, for eight are the fewest."""
    tried = double_sphere(capture, (fraction,), ShapeSettings())[0]
    inner, outer = map(int, tried.label.split("/"))
    again = thinned_to(capture, tried.settings["pictures"])
    assert again.files == thinned(capture, inner, outer).files
    assert len(again) == tried.settings["pictures"]
