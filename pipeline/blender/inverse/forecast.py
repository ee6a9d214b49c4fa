"""What a search of some time is expected to find: how sure the reflectances will be, by its first steps."""

from __future__ import annotations

import time

import numpy as np

from ...core.progress import Work
from ...core.tradeoff import Trial
from .levels import ENOUGH
from .solve import LAST_DAMPING, LAST_SAMPLES, LEVEL_SAMPLES, LEVELS_END, Search

BUDGETS = (15.0, 30.0, 60.0, 120.0, 240.0, 480.0)
MOVES = 3  # of all groups together
ERROR = "reflectance_expected_pct"


class Forecast(Search):
    """A search that ends when it can tell how a whole one goes on."""

    def foretold(self, before: float, after: float) -> Work[list[Trial]]:
        """Take one step of each kind; return what budgets are expected to give.

        The time of a search is that of its first reflectances, of a level for every group that these do not explain and
        for every one that is not explained after moves of all groups together either, of derivatives, and of more such
        moves; the deviations that the first ones state fall with the root of their number. Groups that get no level in
        their share of the time count as not recovered. Not foretold: textures, levels that are changed again, what a
        wrong level of one group does to others, and groups that reflections alone show: these are known when the
        mirrors are.

        Parameters
        ----------
        before, after : float
            Seconds that a command needs beside the search.
        """
        begun = time.perf_counter()
        yield from self._begin()
        waiting = self._waiting()
        first, level = time.perf_counter() - begun, 0.0
        if waiting:
            start = time.perf_counter()
            self._choose(waiting[0], (yield from self._examined(waiting[0])))
            level = time.perf_counter() - start
        start = time.perf_counter()
        self.evidence.residuals(LAST_SAMPLES, ENOUGH)
        move = time.perf_counter() - start
        start = time.perf_counter()
        yield from self._refine("refine", rounds=MOVES, samples=LAST_SAMPLES, damping=LAST_DAMPING, least=MOVES)
        slopes = max(time.perf_counter() - start - (MOVES + 1) * move, 0.0)  # it looks back at its last step, too
        levels = level * (len(waiting) + len(self._waiting()))
        slopes *= 2 if waiting else 1  # all move together once more where levels change
        return [self._trial(budget, before + after, first, levels, slopes, move) for budget in BUDGETS]

    def _waiting(self) -> list[int]:
        """Return the groups that a search would look for a level of now, the worst first."""
        return self._open(self.evidence.errors(self.evidence.residuals(LEVEL_SAMPLES, ENOUGH)))

    def _trial(self, budget: float, beside: float, first: float, levels: float, slopes: float, move: float) -> Trial:
        left = max(budget - beside - first, 0.0)
        done = min(levels, LEVELS_END * left)
        single = 100 * self.uncertainty(only_seen=True)
        most = max((left - done - slopes) / move, MOVES)
        enough = max(MOVES * (single / self.settings.target) ** 2, MOVES)  # where the search ends by itself
        moves = min(most, enough)
        seconds = beside + first + done + slopes + moves * move
        errors = {
            ERROR: single / float(np.sqrt(moves / MOVES)),
            "recovered_pct": 100 * done / levels if levels else 100,
        }
        return Trial(f"{budget:g} s", {"budget": budget}, seconds, errors)
