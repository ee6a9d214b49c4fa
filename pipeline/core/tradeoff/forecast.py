"""What settings will cost and give, foretold from trials on a part of a capture's pixels."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..capture import Capture
from ..errors import LightsphereError
from ..progress import Progress, Work, finish
from . import Trial, Variant
from .excerpt import SINGLE, Excerpt, Size, excerpt
from .goal import COMPLETE, Goal, Promise, choose, stated

TRIALS_SHARE = 0.3  # of the budget, after which no more settings are tried
USEFUL = 0.5  # of the pixels: trials go on, however late, until some settings recover as many


def foretold(
    variants: Callable[[Capture], Sequence[Variant]],
    capture: Capture,
    pixels: NDArray[np.bool_],
    goal: Goal,
    size: Size = SINGLE,
) -> Work[Promise]:
    """Try a stage's settings on two excerpts of some pixels (H, W), and choose for the goal; see :func:`tried`."""
    large, opening = yield from excerpt(capture, pixels, size)
    return (yield from tried(variants, large, opening, int(pixels.sum()), goal))


def tried(
    variants: Callable[[Capture], Sequence[Variant]], large: Excerpt, opening: float, total: int, goal: Goal
) -> Work[Promise]:
    """Try a stage's settings on an excerpt and on a part of it, the lightest first; choose for the goal.

    Time is taken to be linear in pixels, by the two excerpts, and in the pictures that are opened; the error is that of
    the whole excerpt. Judging counts: the stage does it, too, to state what it obtained. Trials end when settings
    reach the target, when they would take longer than what is left of the budget, or when the next trial would be
    beyond :data:`TRIALS_SHARE` of it. Not modelled: work that grows faster than linearly, memory that spills to disk,
    and writing the result.

    Parameters
    ----------
    variants : callable
        Gives the settings that are tried on a capture.
    large : Excerpt
    opening : float
        Seconds that a picture of the whole takes to open.
    total : int
        Pixels that the stage is to solve.
    goal : Goal

    Raises
    ------
    LightsphereError
        Of the last settings, where none work.
    """
    small = large.smaller()
    pairs = list(zip(variants(small), variants(large), strict=True))
    pairs.sort(key=lambda pair: pair[1].weight)
    found: list[Trial] = []
    problem: LightsphereError | None = None
    warm, cost = False, 0.0
    for number, (few, many) in enumerate(pairs):
        is_late = goal.budget is not None and goal.spent + cost * many.weight > TRIALS_SHARE * goal.budget
        if is_late and any(trial.recovered_pct >= 100 * USEFUL for trial in found):
            break
        yield Progress("try", number, len(pairs), "settings")
        try:
            if not warm:  # kernels are compiled and caches filled
                _timed(few, small)
                warm = True
            less, _, _ = _timed(few, small)
            more, errors, reads = _timed(many, large)
        except LightsphereError as error:
            problem = error
            continue
        counts = (len(small.values[0]), len(large.values[0]))
        seconds = linear((less, more), counts, total) + reads * opening
        cost = (less + more) / many.weight
        found.append(Trial(many.label, many.settings, seconds, errors))
        if _is_settled(found[-1], goal):
            break
    yield Progress("try", len(pairs), len(pairs), "settings")
    if not found:
        assert problem is not None
        raise problem
    return choose(found, goal)


def linear(seconds: tuple[float, float], counts: tuple[int, int], total: int) -> float:
    """Return the seconds that so many pixels in all take, from those of two counts of pixels, the larger one last."""
    slope = max(seconds[1] - seconds[0], 0.0) / max(counts[1] - counts[0], 1)
    return seconds[1] + slope * (total - counts[1])


def _timed(variant: Variant, part: Excerpt) -> tuple[float, dict[str, float], int]:
    """Do and judge a variant; return seconds, errors, and how many pictures were opened."""
    part.reads.clear()
    start = time.perf_counter()
    errors = variant.judge(finish(variant.work()))
    return time.perf_counter() - start, errors, len(part.reads)


def _is_settled(trial: Trial, goal: Goal) -> bool:
    """Tell whether heavier settings need not be tried any more."""
    if goal.target is not None and trial.recovered_pct >= 100 * COMPLETE and stated(trial) <= goal.target:
        return True
    return goal.budget is not None and trial.recovered_pct >= 100 * USEFUL and goal.spent + trial.seconds > goal.budget
