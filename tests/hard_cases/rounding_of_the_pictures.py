"""Pictures rounded to single, half and fewer digits: how every solver's error grows with that of its input.

Why: rounding and noise differ by their size alone; a solver that magnifies one magnifies all.
Must: the relative change of what is solved stays below that of the pictures, but for where iterations stop.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests import drawn
from tests.hard_cases.catalogue import Outcome
from tests.hard_cases.order_threads_and_runs import SOLVERS, captures

SLOW = True
GROWTH = 1.0  # the most
STOPS = {"acls": 3e-4}  # change below which iterations stop: a sixtieth of a degree
BITS = {24: "single", 16: "16 bits", 11: "half", 8: "8 bits"}


def rounded(pictures: NDArray[np.float64], bits: int) -> NDArray[np.float64]:
    """Return floating-point numbers with a fraction of so many bits."""
    fraction, exponent = np.frexp(pictures)
    return np.ldexp(np.round(fraction * 2.0**bits) / 2.0**bits, exponent)


def changes(solve: Callable[[drawn.Drawn], NDArray[Any]], capture: drawn.Drawn, bits: int) -> tuple[float, float]:
    """Return the relative change of what is solved, its median over its size, and that of the pictures."""
    exact = capture.pictures
    assert exact is not None
    fewer = rounded(exact, bits)
    lit = exact > 0
    own = float(np.sqrt(np.mean((fewer[lit] / exact[lit] - 1) ** 2)))
    before, after = (
        solve(dataclasses.replace(capture, pictures=pictures)).astype(np.float64) for pictures in (exact, fewer)
    )
    known = np.isfinite(before) & np.isfinite(after) & (before != 0)
    scale = float(np.sqrt(np.mean(before[known] ** 2)))
    return float(np.median(np.abs(before - after)[known])) / scale, own


def run() -> list[Outcome]:
    made = captures(np.float64)
    found = []
    for name, (kind, solve, _) in SOLVERS.items():
        for bits, word in BITS.items():
            change, own = changes(solve, made[kind], bits)
            most = GROWTH * own + STOPS.get(name, 0.0)
            told = f"{change / own:.2g} times that of the pictures"
            found.append(Outcome(f"{name}: {word}", change, most, "relative change", told))
    return found
