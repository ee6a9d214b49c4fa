"""What a search of some time is expected to find: how sure the reflectances will be, by its first steps."""

from __future__ import annotations

import time

import numpy as np

from ...core.inverse import COLOURED
from ...core.progress import Work
from ...core.tradeoff import Trial
from .solve import LEVELS_END, WORST, WORTH, Search

BUDGETS = (15.0, 30.0, 60.0, 120.0, 240.0, 480.0)
SAMPLES, DAMPING = 32, 0.03  # of the last moves of all groups together
ERROR = "reflectance_expected_pct"


class Forecast(Search):
    """A search that ends when it can tell how a whole one goes on."""

    def foretold(self, before: float, after: float) -> Work[list[Trial]]:
        """Take one step of each kind; return what budgets are expected to give.

        The time of a search is that of its first reflectances, of one level for every group that these do not explain,
        twice, of derivatives, and of moves of all groups together; the deviations that the first move states fall with
        the root of the number of moves. Groups that get no level in their share of the time count as not recovered.
        Not foretold: textures, levels that are changed again, what a wrong level of one group does to others, and
        groups that reflections alone show: these are known when the mirrors are.

        Parameters
        ----------
        before, after : float
            Seconds that a command needs beside the search.
        """
        begun = time.perf_counter()
        yield from self._diffuse()
        residuals = self.evidence.even_residuals()
        errors = [self.evidence.unexplained(residuals, number) for number in range(len(self.masks))]
        errors = [0.0 if number in self.room.known else error for number, error in enumerate(errors)]
        waiting = [number for number, error in enumerate(errors) if error > max(WORTH, WORST * max(errors))]
        first, level = time.perf_counter() - begun, 0.0
        if waiting:
            number = max(waiting, key=errors.__getitem__)
            start = time.perf_counter()
            self._choose(number, (yield from self._examined(number)))
            level = time.perf_counter() - start
        start = time.perf_counter()
        self.evidence.residuals(SAMPLES)
        move = time.perf_counter() - start
        start = time.perf_counter()
        yield from self._refine("refine", rounds=1, samples=SAMPLES, damping=DAMPING, least=1)
        slopes = max(time.perf_counter() - start - 2 * move, 0.0)  # it looks back at its last step, too
        return [
            self._trial(budget, before + after, first, 2 * level * len(waiting), slopes, move) for budget in BUDGETS
        ]

    def _trial(self, budget: float, beside: float, first: float, levels: float, slopes: float, move: float) -> Trial:
        left = max(budget - beside - first, 0.0)
        done = min(levels, LEVELS_END * left)
        single = 100 * self._seen_uncertainty()
        most = max((left - done - 2 * slopes) / move, 1.0)
        enough = max(2 * ((single / self.settings.target) ** 2 - 1), 1.0)  # where the search ends by itself
        moves = min(most, enough)
        seconds = beside + first + done + 2 * slopes + moves * move
        errors = {
            ERROR: single / float(np.sqrt(1 + moves / 2)),
            "recovered_pct": 100 * done / levels if levels else 100,
        }
        return Trial(f"{budget:g} s", {"budget": budget}, seconds, errors)

    def _seen_uncertainty(self) -> float:
        """Return the largest relative deviation of what pixels show themselves."""
        seen = {n: word == "directly" for n, word in enumerate(self.seen)}
        parts = [max(sd) for (n, kind), sd in self.deviations.items() if kind in COLOURED and seen[n]]
        return max(parts, default=0.0)
