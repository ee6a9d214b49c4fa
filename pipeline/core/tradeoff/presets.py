"""Draft, Standard and Final: three settings of a stage among those whose cost and error are expected."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from . import Trial
from .goal import complete, stated, unit

#: How many times the error aimed at a preset may have.
FACTORS = {"draft": 3.0, "standard": 1.5, "final": 1.0}


def presets(trials: Sequence[Trial], asked: float | None = None) -> dict[str, dict[str, Any]]:
    """Return the quickest settings whose expected error is within a factor of the one aimed at.

    Settings that recover fewer pixels than others do not serve, see :data:`.goal.COMPLETE`.

    Parameters
    ----------
    trials : sequence of Trial
        What the stage is expected to cost and give; not empty.
    asked : float, optional
        The error that Standard is to have, where the stage's settings ask for one. Else the least that is
        expected of any settings is aimed at, which is that of Final.

    Returns
    -------
    dict of str to dict
        Draft, standard and final: ``label``, ``settings``, ``seconds``, ``error``, its name, ``value`` and ``unit``.

    Examples
    --------
    >>> trials = [Trial(f"{n}", {"pictures": n}, n, {"depth_median_pct": 12 / n}) for n in (2, 4, 8, 12)]
    >>> {name: one["label"] for name, one in presets(trials).items()}
    {'draft': '4', 'standard': '8', 'final': '12'}
    """
    serving = complete(trials)
    aim = min(map(stated, serving)) if asked is None else asked / FACTORS["standard"]
    found = {}
    for name, factor in FACTORS.items():
        good = [trial for trial in serving if stated(trial) <= factor * aim]
        chosen = min(good, key=lambda trial: trial.seconds) if good else min(serving, key=stated)
        found[name] = {
            "label": chosen.label,
            "settings": chosen.settings,
            "seconds": chosen.seconds,
            "error": chosen.error,
            "value": stated(chosen),
            "unit": unit(chosen.error),
        }
    return found
