"""Settings live once: a frozen dataclass per stage, from which command line and panels are made."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, TypeVar

from .errors import LightsphereError

T = TypeVar("T")


@dataclass(frozen=True)
class Limits:
    """What a setting may be and how it is explained; kept in the field's metadata under ``"limits"``."""

    help: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    short: str = ""
    path: str = ""


def setting(
    default: Any,
    help: str,
    *,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    short: str = "",
    path: str = "",
) -> Any:
    """Declare one field of a settings dataclass: default, help, unit, limits (both ends allowed) or choices.

    ``path`` says that the text names a ``"file"`` or a ``"folder"``.
    """
    limits = Limits(help, unit, low, high, choices, short, path)
    return dataclasses.field(default=default, metadata={"limits": limits})


def limits_of(field: dataclasses.Field[Any]) -> Limits:
    """Return the limits that :func:`setting` stored in a field."""
    limits: Limits = field.metadata["limits"]
    return limits


def check(settings: T) -> T:
    """Return the settings unchanged, or raise a LightsphereError naming the first value out of its limits.

    Examples
    --------
    >>> @dataclass(frozen=True)
    ... class Demo:
    ...     inner: int = setting(320, "lights on the inner sphere", low=4)
    >>> check(Demo(inner=3))
    Traceback (most recent call last):
    ...
    pipeline.core.errors.LightsphereError: inner is 3; it must be at least 4
    """
    for field in dataclasses.fields(settings):  # type: ignore[arg-type]
        limits = limits_of(field)
        value = getattr(settings, field.name)
        if limits.choices and value not in limits.choices:
            raise LightsphereError(f"{field.name} is {value!r}; choose one of {', '.join(limits.choices)}")
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        if limits.low is not None and not value >= limits.low:
            raise LightsphereError(f"{field.name} is {value}; it must be at least {limits.low}")
        if limits.high is not None and not value <= limits.high:
            raise LightsphereError(f"{field.name} is {value}; it must be at most {limits.high}")
    return settings
