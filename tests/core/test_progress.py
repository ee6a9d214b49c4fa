"""Long work returns its result whoever drives it, and can be dropped half way."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from pipeline.core.errors import LightsphereError
from pipeline.core.progress import Progress, Work, finish, shares


def count(total: int, closed: list[str]) -> Work[str]:
    try:
        for done in range(total):
            yield Progress("count", done + 1, total, "numbers")
        return f"counted to {total}"
    finally:
        closed.append("closed")


def test_finish_returns_the_result_and_reports_every_step() -> None:
    steps: list[Progress] = []
    closed: list[str] = []
    assert finish(count(3, closed), steps.append) == "counted to 3"
    assert [step.done for step in steps] == [1, 2, 3]
    assert closed == ["closed"]
    assert finish(count(0, closed)) == "counted to 0"


def test_an_interrupt_from_the_reporter_ends_the_work_cleanly() -> None:
    def interrupt(step: Progress) -> None:
        if step.done == 2:
            raise KeyboardInterrupt

    closed: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        finish(count(3, closed), interrupt)
    assert closed == ["closed"]


def test_an_error_of_the_work_reaches_the_caller() -> None:
    def fail() -> Iterator[Progress]:
        yield Progress("fail", 0, 1)
        raise LightsphereError("nothing; do something")

    with pytest.raises(LightsphereError, match="nothing; do something"):
        finish(fail())


def test_a_works_own_stages_become_shares_of_the_whole_that_never_fall() -> None:
    def work() -> Work[str]:
        for stage, done in (("read", 1), ("read", 2), ("solve", 1), ("other", 2), ("solve", 2), ("read", 1)):
            yield Progress(stage, done, 2)
        return "done"

    running = shares(work(), {"read": 0.2, "solve": 0.8})
    told = []
    try:
        while True:
            told.append(next(running))
    except StopIteration as end:
        assert end.value == "done"
    assert told == pytest.approx([0.1, 0.2, 0.6, 1.0, 1.0])
    assert list(shares(work(), {})) == [0.5, 1.0, 1.0, 1.0, 1.0, 1.0]
