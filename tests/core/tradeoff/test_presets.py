"""Draft, Standard and Final among what is expected of settings."""

from __future__ import annotations

import math

from pipeline.core.tradeoff import Trial
from pipeline.core.tradeoff.presets import FACTORS, presets


def trial(seconds: float, error: float, recovered: float = 100.0) -> Trial:
    errors = {"depth_median_pct": error, "recovered_pct": recovered}
    return Trial(f"{seconds:g}", {"pictures": int(seconds)}, seconds, errors)


def labels(trials: list[Trial], asked: float | None = None) -> list[str]:
    return [one["label"] for one in presets(trials, asked).values()]


def test_each_is_the_quickest_within_its_factor_of_the_least_error() -> None:
    trials = [trial(1, 9.0), trial(2, 2.9), trial(4, 1.4), trial(8, 1.0), trial(16, 1.2)]
    assert labels(trials) == ["2", "4", "8"]
    for name, one in presets(trials).items():
        assert one["value"] <= FACTORS[name] * 1.0
        assert not [t for t in trials if t.seconds < one["seconds"] and t.errors["depth_median_pct"] <= FACTORS[name]]


def test_an_error_that_is_asked_for_is_standard_s() -> None:
    trials = [trial(n, 10.0 / n**0.5) for n in (1, 4, 16, 64, 256)]
    assert labels(trials, 2.5) == ["4", "16", "64"]


def test_where_the_error_asked_for_is_out_of_reach_the_best_is_taken() -> None:
    assert labels([trial(1, 9.0), trial(2, 5.0)], 0.1) == ["2", "2", "2"]


def test_settings_that_recover_little_or_nothing_do_not_serve() -> None:
    trials = [trial(1, 0.1, recovered=20.0), trial(2, 1.0), trial(3, math.nan)]
    assert labels(trials) == ["2", "2", "2"]
