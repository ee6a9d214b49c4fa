"""What is chosen among settings is never beaten, and serves where anything does."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.tradeoff import Trial, dominated
from pipeline.core.tradeoff.goal import Goal, choose, complete, stated
from pipeline.core.tradeoff.presets import presets

ERRORS = st.one_of(st.floats(0, 1e3), st.just(float("nan")))


@st.composite
def trials(draw: st.DrawFn) -> list[Trial]:
    """Settings with times, errors and shares of pixels."""
    values = draw(st.lists(st.tuples(st.floats(0.01, 1e4), ERRORS, st.floats(1, 100)), min_size=1, max_size=6))
    return [
        Trial(str(number), {}, seconds, {"depth_expected_pct": error, "recovered_pct": recovered})
        for number, (seconds, error, recovered) in enumerate(values)
    ]


@given(trials())
def test_the_front_is_beaten_by_none_and_beats_the_rest(found: list[Trial]) -> None:
    names = dominated(found)
    front = [trial for trial, name in zip(found, names, strict=True) if not name]
    assert front
    for trial, name in zip(found, names, strict=True):
        if name:
            other = next(one for one in found if one.label == name)
            assert other.seconds <= trial.seconds and stated(other) <= stated(trial)
            assert other.recovered_pct >= trial.recovered_pct


@given(trials(), st.one_of(st.none(), st.floats(0.01, 1e5)), st.one_of(st.none(), st.floats(0.01, 1e3)))
def test_a_choice_serves_where_anything_does(found: list[Trial], budget: float | None, target: float | None) -> None:
    promise = choose(found, Goal(budget, target))
    serving = complete(found)
    assert promise.expected in serving
    timely = [trial for trial in serving if budget is None or trial.seconds < 0.99 * budget - 1]
    good = [trial for trial in timely if target is not None and stated(trial) <= target]
    if good:
        assert not promise.lacks and stated(promise.expected) <= (target or np.inf)
        assert promise.expected.seconds <= min(trial.seconds for trial in good)
    elif timely and target is None:
        assert stated(promise.expected) <= min(map(stated, timely))


@given(trials(), st.one_of(st.none(), st.floats(0.01, 100)))
def test_presets_cost_more_the_better_they_are(found: list[Trial], asked: float | None) -> None:
    named = presets(found, asked)
    draft, standard, final = (named[name] for name in ("draft", "standard", "final"))
    errors = [np.inf if np.isnan(one["value"]) else one["value"] for one in (draft, standard, final)]
    if all(np.isfinite(errors)) and asked is None:
        assert draft["seconds"] <= standard["seconds"] <= final["seconds"]
        assert errors[2] <= min(map(stated, complete(found)))
