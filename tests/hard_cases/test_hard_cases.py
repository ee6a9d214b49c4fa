"""Every case of the catalogue ends as its file says."""

from __future__ import annotations

from types import ModuleType

import pytest

from tests.hard_cases.catalogue import Outcome, cases, title


def as_parameter(case: ModuleType) -> object:
    return pytest.param(case, id=title(case), marks=[pytest.mark.slow] if getattr(case, "SLOW", False) else [])


@pytest.mark.parametrize("case", [as_parameter(case) for case in cases()])
def test_hard_case(case: ModuleType) -> None:
    assert "Why:" in case.__doc__ and "Must:" in case.__doc__
    outcomes = case.run()
    assert outcomes
    assert not [one for one in outcomes if not one.holds]


def test_what_is_no_number_or_too_far_off_does_not_hold() -> None:
    assert Outcome("", 0.0, 0.0, "", "said it").holds
    assert not Outcome("", float("nan"), 1.0, "", "").holds
    assert not Outcome("", 1.1, 1.0, "", "").holds
