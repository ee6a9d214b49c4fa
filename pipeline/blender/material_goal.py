"""How many closures a material takes for a time or an error that is asked for."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ..core.material.surface import Surface
from ..core.progress import Progress, Work
from ..core.tradeoff import Trial
from ..core.tradeoff.goal import Goal, Promise, choose, stated
from .render_cost import relative_cost
from .round_trip import round_trip
from .tradeoff import LOBES

STEPS = 6  # pictures that tell how long all take


def promised(fitted: Callable[[int], Work[Surface]], goal: Goal) -> Work[Promise]:
    """Fit bases with more and more closures, until a target is reached or one more buys nothing; choose for a goal.

    What follows a fit, its round trip through Cycles and what its closures cost to render, is told by the first
    pictures of each. Not foretold is the time to write the asset.

    Parameters
    ----------
    fitted : callable
        Fits with at most so many closures.
    goal : Goal
    """
    trials: list[Trial] = []
    for number, most in enumerate(LOBES):
        yield Progress("try", number, len(LOBES), "settings")
        start = time.perf_counter()
        surface = yield from fitted(most)
        seconds = time.perf_counter() - start
        mixture = surface.mixture
        if len(mixture.lobes) - 1 < most and trials:
            break
        rest = paced(round_trip(mixture, surface.bases)) + paced(relative_cost(mixture))
        trials.append(Trial(f"diffuse + {most}", {"lobes": most}, seconds + rest, errors(surface)))
        if goal.target is not None and stated(trials[-1]) <= goal.target:
            break
        if goal.budget is not None and goal.spent + trials[-1].seconds > goal.budget:
            break
    yield Progress("try", len(LOBES), len(LOBES), "settings")
    return choose(trials, goal)


def errors(surface: Surface) -> dict[str, float]:
    """Return the error of a fit: the mean over the bases."""
    return {"material_rel_rms": float(np.mean(surface.notes["material_rel_rms"]))}


def paced(work: Work[Any]) -> float:
    """Return the seconds that long work takes, by its first steps, and end it; the very first one sets up."""
    start = time.perf_counter()
    first = next(work)
    begun = time.perf_counter()
    last = list(itertools.islice(work, STEPS))[-1:] or [first]
    now = time.perf_counter()
    work.close()
    done = last[0].done - first.done
    left = last[0].total - first.done
    return (begun - start) + (now - begun) * left / max(done, 1e-30) if done else now - start
