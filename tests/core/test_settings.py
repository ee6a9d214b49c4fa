"""Settings are refused outside their limits, with a message that names the setting and the limit."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from pipeline.core.errors import LightsphereError
from pipeline.core.settings import check, limits_of, setting


@dataclasses.dataclass(frozen=True)
class Example:
    lights: int = setting(320, "lights on the sphere", low=4, high=1000)
    radius: float = setting(2.0, "radius", unit="m", low=0.0)
    method: str = setting("fast", "how", choices=("fast", "exact"))
    round: bool = setting(True, "whether it is round", low=5)


def test_defaults_and_both_ends_of_the_limits_are_allowed() -> None:
    for change in ({}, {"lights": 4}, {"lights": 1000}, {"radius": 0.0}, {"method": "exact"}, {"round": False}):
        settings = Example(**change)
        assert check(settings) is settings


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"lights": 3}, "lights is 3; it must be at least 4"),
        ({"lights": 1001}, "lights is 1001; it must be at most 1000"),
        ({"radius": -0.1}, "radius is -0.1; it must be at least 0"),
        ({"radius": float("nan")}, "radius is nan; it must be at least 0"),
        ({"method": "slow"}, "method is 'slow'; choose one of fast, exact"),
    ],
)
def test_a_value_out_of_its_limits_is_named(change: dict[str, Any], words: str) -> None:
    with pytest.raises(LightsphereError, match=words):
        check(Example(**change))


def test_the_field_keeps_its_explanation() -> None:
    limits = limits_of(dataclasses.fields(Example)[1])
    assert (limits.help, limits.unit, limits.low, limits.high) == ("radius", "m", 0.0, None)
