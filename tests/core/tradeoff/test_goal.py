"""The settings that are chosen for a goal, and what is said of them."""

from __future__ import annotations

import time

import numpy as np
import pytest

from pipeline.core.errors import LightsphereError
from pipeline.core.tradeoff import Trial
from pipeline.core.tradeoff.goal import Goal, Promise, choose, stated, told


def trial(label: str, seconds: float, error: float, recovered: float = 100.0) -> Trial:
    return Trial(label, {"bases": len(label)}, seconds, {"material_rel_rms": error, "recovered_pct": recovered})


QUICK, MIDDLE, FINE = trial("quick", 1.0, 0.5), trial("middle", 10.0, 0.1), trial("fine", 100.0, 0.05)
ALL = (FINE, QUICK, MIDDLE)


def chosen(budget: float | None, target: float | None, trials: tuple[Trial, ...] = ALL) -> Promise:
    return choose(trials, Goal(budget, target))


@pytest.mark.parametrize(
    ("budget", "target", "label"),
    [
        (None, 60, "quick"),
        (None, 10, "middle"),
        (None, 6, "fine"),
        (200, None, "fine"),
        (50, None, "middle"),
        (5, None, "quick"),
        (200, 10, "middle"),
        (50, 60, "quick"),
    ],
)
def test_the_quickest_that_reach_the_target_or_the_best_within_the_budget(
    budget: float | None, target: float | None, label: str
) -> None:
    found = chosen(budget, target)
    assert found.expected.label == label
    assert not found.lacks


@pytest.mark.parametrize(
    ("budget", "target", "label", "said"),
    [
        (None, 1, "fine", "no settings are expected to reach 1 %: these are the best"),
        (50, 6, "middle", "no settings are expected to reach 6 % within 50 s: these are the best"),
        (0.5, None, "quick", "no settings are expected to end within 0.5 s: these are the quickest"),
        (0.5, 60, "quick", "no settings are expected to end within 0.5 s: these are the quickest"),
    ],
)
def test_a_goal_that_cannot_be_met_is_said_and_the_best_taken(
    budget: float | None, target: float | None, label: str, said: str
) -> None:
    found = chosen(budget, target)
    assert (found.expected.label, found.lacks) == (label, said)


def test_time_that_has_passed_counts() -> None:
    late = Goal(50.0, None, start=time.perf_counter() - 45)
    found = choose(ALL, late)
    assert found.expected.label == "quick"
    assert 46 <= found.seconds < 50


def test_settings_that_leave_pixels_out_do_not_serve() -> None:
    """They are quick, and what they recover is right: yet most of the object is missing."""
    sparse = trial("sparse", 0.1, 0.001, recovered=40.0)
    assert chosen(None, 10, (*ALL, sparse)).expected.label == "middle"
    assert chosen(None, 10, (sparse,)).expected.label == "sparse"
    assert chosen(None, 10, (*ALL, trial("nearly", 0.1, 0.001, recovered=96.0))).expected.label == "nearly"


def test_nothing_recovered_is_the_worst_error() -> None:
    blank = trial("blank", 0.1, float("nan"))
    assert stated(blank) == np.inf
    assert chosen(200, None, (*ALL, blank)).expected.label == "fine"


def test_errors_are_told_in_per_cent() -> None:
    assert stated(trial("", 1, 0.05)) == pytest.approx(5.0)
    assert stated(Trial("", {}, 1, {"depth_expected_pct": 0.05})) == pytest.approx(0.05)


def test_what_was_promised_and_obtained_is_said() -> None:
    goal = Goal(None, 1.0, start=time.perf_counter() - 12)
    kept = choose(ALL, goal).kept({"material_rel_rms": 0.07})
    assert kept["promised"] == {"seconds": pytest.approx(112, abs=1), "value": pytest.approx(5)}
    assert kept["obtained"] == {"seconds": pytest.approx(12, abs=1), "value": pytest.approx(7)}
    assert (kept["budget"], kept["target"], kept["error"]) == (None, 1.0, "material_rel_rms")
    assert "chose bases 4; material_rel_rms promised 5 % in 112 s, obtained 7 % in 12 s; no settings" in told(kept)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_goals_that_are_none_are_refused(value: float) -> None:
    with pytest.raises(LightsphereError, match=r"budget is .*more than 0"):
        Goal(value, None)
    with pytest.raises(LightsphereError, match=r"target is .*more than 0"):
        Goal(None, value)
    assert not Goal()
