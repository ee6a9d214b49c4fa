"""Settings chosen for a time or an error that is asked for, and what was promised and obtained."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import LightsphereError
from . import Trial

COMPLETE = 0.95  # of the pixels that the most complete settings recover; settings that recover fewer do not serve


@dataclass(frozen=True)
class Goal:
    """What is asked of a stage in place of settings.

    Parameters
    ----------
    budget : float, optional
        Time that the whole command may take [s]; the settings are those of the least error within it.
    target : float, optional
        Error that will do, in its :func:`unit`; the settings are the quickest that reach it.
    start : float
        When the command began, by ``time.perf_counter``.
    """

    budget: float | None = None
    target: float | None = None
    start: float = field(default_factory=time.perf_counter)

    def __post_init__(self) -> None:
        """Raise LightsphereError for a time or an error that is not positive."""
        for name, value in (("budget", self.budget), ("target", self.target)):
            if value is not None and not value > 0:
                raise LightsphereError(f"{name} is {value:g}; it must be more than 0")

    def __bool__(self) -> bool:
        return self.budget is not None or self.target is not None

    @property
    def spent(self) -> float:
        """Seconds since the command began."""
        return time.perf_counter() - self.start


@dataclass(frozen=True)
class Promise:
    """The settings that are expected to serve a goal best.

    Parameters
    ----------
    goal : Goal
    expected : Trial
        Its settings are the chosen ones; its seconds count from the choice on.
    seconds : float
        Expected of the whole command.
    lacks : str
        Why the goal is not expected to be met; empty where it is.
    trials : sequence of Trial
        Among which was chosen.
    """

    goal: Goal
    expected: Trial
    seconds: float
    lacks: str
    trials: Sequence[Trial]

    def kept(self, errors: dict[str, float]) -> dict[str, Any]:
        """Return what was promised and what was obtained by now, as figures; ``errors`` as in :class:`Trial`."""
        name = self.expected.error
        promised = {"seconds": self.seconds, "value": stated(self.expected)}
        got = Trial(self.expected.label, self.expected.settings, self.goal.spent, errors)
        obtained = {"seconds": got.seconds, "value": stated(got)}
        asked = {"budget": self.goal.budget, "target": self.goal.target}
        chosen = {"settings": self.expected.settings, "error": name, "unit": unit(name), "lacks": self.lacks}
        return {**asked, **chosen, "promised": promised, "obtained": obtained}


def told(kept: dict[str, Any]) -> str:
    """Say what :meth:`Promise.kept` found."""
    settings = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in kept["settings"].items())
    first, then = kept["promised"], kept["obtained"]
    words = (
        f"chose {settings}; {kept['error']} promised {first['value']:.3g} {kept['unit']} in {first['seconds']:.3g} s, "
        f"obtained {then['value']:.3g} {kept['unit']} in {then['seconds']:.3g} s"
    )
    return words + (f"; {kept['lacks']}" if kept["lacks"] else "")


def choose(trials: Sequence[Trial], goal: Goal) -> Promise:
    """Choose the quickest settings that reach the target, else the best within the budget, else the quickest.

    Parameters
    ----------
    trials : sequence of Trial
        What the stage is expected to cost and give; not empty.
    goal : Goal
    """
    serving = complete(trials)
    quickest = min(serving, key=lambda trial: trial.seconds)
    spent, lacks = goal.spent, ""
    timely = [trial for trial in serving if goal.budget is None or spent + trial.seconds <= goal.budget]
    good = [trial for trial in timely if goal.target is not None and stated(trial) <= goal.target]
    if good:
        chosen = min(good, key=lambda trial: trial.seconds)
    elif timely:
        chosen = min(timely, key=stated)
        if goal.target is not None:
            within = "" if goal.budget is None else f" within {goal.budget:g} s"
            aim = f"{goal.target:g} {unit(chosen.error)}"
            lacks = f"no settings are expected to reach {aim}{within}: these are the best"
    else:
        chosen = quickest
        lacks = f"no settings are expected to end within {goal.budget:g} s: these are the quickest"
    return Promise(goal, chosen, spent + chosen.seconds, lacks, trials)


def complete(trials: Sequence[Trial]) -> list[Trial]:
    """Return the trials that recover about as many pixels as the most complete."""
    most = max(trial.recovered_pct for trial in trials)
    return [trial for trial in trials if trial.recovered_pct >= COMPLETE * most]


def unit(error: str) -> str:
    """Return the unit in which an error is stated, by its name."""
    return "degrees" if error.endswith("_deg") else "%"


def stated(trial: Trial) -> float:
    """Return the error of a trial in its unit, infinite where nothing was recovered."""
    value = trial.errors[trial.error]
    if np.isnan(value):
        return float(np.inf)
    return value if trial.error.endswith(("_pct", "_deg")) else 100 * value
