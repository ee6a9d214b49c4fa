"""Long work as generators: one function serves the command line, tests, operators and workers."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from typing import TypeVar

Result = TypeVar("Result")
Step = TypeVar("Step")


@dataclass(frozen=True)
class Progress:
    """A step of long work.

    Parameters
    ----------
    stage : str
        What is being done, in words that a user reads, e.g. ``"render"``.
    done, total : float
        Work done and work in all, in the stage's own unit; ``done <= total``.
    unit : str
        The unit of ``done`` and ``total``, e.g. ``"pictures"``.
    """

    stage: str
    done: float
    total: float
    unit: str = ""


Work = Generator[Progress, None, Result]


def retold(work: Generator[Step, None, Result], tell: Callable[[Step], Progress]) -> Work[Result]:
    """Let long work that is a part of another tell its steps as steps of that."""
    while True:
        try:
            step = next(work)
        except StopIteration as end:
            result: Result = end.value
            return result
        yield tell(step)


def shares(work: Work[Result], phases: Mapping[str, float]) -> Generator[float, None, Result]:
    """Run long work; yield how much of it is done, from 0 to 1, never less than before, and return its result.

    Parameters
    ----------
    work : generator of Progress
    phases : dict of str to float
        The work's own stages in order and what share of the time each takes; others are not told. Where it is empty,
        every stage counts as the whole.
    """
    starts, before = {}, 0.0
    for name, share in phases.items():
        starts[name], before = before, before + share
    reached = 0.0
    while True:
        try:
            step = next(work)
        except StopIteration as end:
            result: Result = end.value
            return result
        if step.stage in starts or not phases:
            share = starts.get(step.stage, 0.0) + phases.get(step.stage, 1.0) * step.done / max(step.total, 1e-30)
            reached = max(reached, min(share, 1.0))
            yield reached


def finish(work: Work[Result], report: Callable[[Progress], None] | None = None) -> Result:
    """Run a generator to its end and return its result.

    Parameters
    ----------
    work : generator of Progress
        The long work.
    report : callable, optional
        Called with every step.

    Returns
    -------
    The value that the generator returns.
    """
    while True:
        try:
            step = next(work)
        except StopIteration as end:
            result: Result = end.value
            return result
        if report is not None:
            report(step)
