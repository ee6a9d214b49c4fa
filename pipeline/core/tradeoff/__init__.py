"""Error against time: a stage done with several settings, each measured, and which of them others beat.

:mod:`.shape`, :mod:`.reflectance` and :mod:`.relight` say which settings of a stage matter; what renders, capture,
material and inverse, is in :mod:`pipeline.blender.tradeoff`. Settings for a time or an error that is asked for are
chosen (:mod:`.goal`) among forecasts, which trials on a part of the pixels give (:mod:`.forecast`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from ..progress import Progress, Work, retold, shares

STAGES = ("capture", "shape", "reflectance", "material", "relight", "inverse")
#: What each error is, in the words of a plot's axis.
WORDS = {
    "depth_median_pct": "median depth error, % of the object",
    "depth_expected_pct": "expected depth error, median, % of the object",
    "normal_mae_deg": "mean angle between normals, degrees",
    "normal_expected_deg": "expected error of normals, median, degrees",
    "material_rel_rms": "relative error of the reflectance",
    "picture_rel_mae": "mean error of the pictures over their light",
    "reflectance_expected_pct": "expected error of reflectances, the largest, %",
    "relight_rel_rmse": "relative error of the pictures",
    "rerendered_rel_rmse": "relative error of the picture",
}


@dataclass(frozen=True)
class Trial:
    """What some settings cost and gave.

    Parameters
    ----------
    label : str
        Short, e.g. ``"80/20 source"``.
    settings : dict
        What was varied.
    seconds : float
        Of the stage, reading the pictures included.
    errors : dict of str to float
        The first is the one to judge by, a key of :data:`WORDS`. ``recovered_pct`` counts, too, if it is there.
    """

    label: str
    settings: dict[str, Any]
    seconds: float
    errors: dict[str, float]

    @property
    def error(self) -> str:
        """The name of the error to judge by."""
        return next(name for name in self.errors if name in WORDS)

    @property
    def recovered_pct(self) -> float:
        """How much of the object was recovered [%]; everything where that is no question."""
        return self.errors.get("recovered_pct", 100.0)


@dataclass(frozen=True)
class Variant:
    """Settings that are tried.

    Parameters
    ----------
    label : str
    settings : dict
    weight : float
        Expected cost, relative to that of other variants.
    work : callable
        Does the stage: what is timed.
    judge : callable
        Takes what the work returned and gives the errors of a :class:`Trial`.
    phases : dict of str to float, optional
        The work's own stages and what share of the time each takes; see :func:`pipeline.core.progress.shares`.
    """

    label: str
    settings: dict[str, Any]
    weight: float
    work: Callable[[], Work[Any]]
    judge: Callable[[Any], dict[str, float]]
    phases: Mapping[str, float] = field(default_factory=dict)


def measure(
    variants: Sequence[Variant], warm_up: bool = True, found: list[tuple[Trial, Any]] | None = None
) -> Work[list[tuple[Trial, Any]]]:
    """Try every variant in turn.

    Parameters
    ----------
    variants : sequence of Variant
    warm_up : bool
        Whether the lightest variant of every method is done once before, uncounted: that compiles kernels and fills
        caches. Methods are told apart by those settings that are words.
    found : list, optional
        Filled with what is returned, one variant after the other: what is known if this is stopped.

    Returns
    -------
    list of (Trial, what the variant's work returned)
    """
    total = sum(variant.weight for variant in variants)
    for variant in _lightest(variants) if warm_up else ():
        for _ in variant.work():
            yield Progress("warm up", 0.0, 100.0, "%")
    found, done = [] if found is None else found, 0.0
    for variant in variants:
        start = time.perf_counter()
        result = yield from retold(shares(variant.work(), variant.phases), partial(_tried, done, variant.weight, total))
        seconds = time.perf_counter() - start
        done += variant.weight
        trial = Trial(variant.label, variant.settings, seconds, variant.judge(result))
        found.append((trial, result))
        yield Progress("try", 100 * done / total, 100.0, "%")
    return found


def _lightest(variants: Sequence[Variant]) -> list[Variant]:
    """Return the lightest variant of every method."""
    found: dict[tuple[str, ...], Variant] = {}
    for variant in sorted(variants, key=lambda variant: variant.weight):
        found.setdefault(tuple(value for value in variant.settings.values() if isinstance(value, str)), variant)
    return list(found.values())


def _tried(done: float, weight: float, total: float, share: float) -> Progress:
    """Tell of a share of a variant as a part of all."""
    return Progress("try", 100 * (done + weight * share) / total, 100.0, "%")


def dominated(trials: Sequence[Trial]) -> list[str]:
    """Name for every trial one that is no slower, no worse and no less complete, and better in one; ``""`` if none.

    Trials named ``""`` are the Pareto front over seconds, error and ``recovered_pct``: a solve that leaves the
    difficult pixels out is not the better for it.
    """

    def costs(trial: Trial) -> tuple[float, float, float]:
        wrong = trial.errors[trial.error]  # not a number where nothing was recovered
        return trial.seconds, np.inf if np.isnan(wrong) else wrong, -trial.recovered_pct

    names = []
    for trial in trials:
        own = costs(trial)
        better = [
            other
            for other in trials
            if costs(other) != own and all(a <= b for a, b in zip(costs(other), own, strict=True))
        ]
        names.append(min(better, key=lambda other: costs(other)[1]).label if better else "")
    return names


def as_row(trial: Trial, better: str) -> dict[str, Any]:
    """Return a trial as one flat row of a table."""
    return {
        "label": trial.label,
        **trial.settings,
        "seconds": trial.seconds,
        **trial.errors,
        "beaten_by": better,
    }
