"""Fewer lights than a capture has, evenly spread."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture import Capture
from ..errors import LightsphereError

#: Shares of a capture's lights that are tried, and those tried with the source's rule.
FRACTIONS, SOURCE_FRACTIONS = (0.125, 0.25, 0.5, 1.0), (0.25, 1.0)
FEWEST = 8  # lights of a surface, or distant ones


def thinned_to(capture: Capture, count: int) -> Capture:
    """Return the capture with at most so many of its lights, evenly spread; with all of them where count is 0.

    Lights on two surfaces keep their proportion, at least :data:`FEWEST` of each, so that as many as :func:`fewer`
    leaves of either are as many again; unknown lights are spread over the order of the photographs.
    """
    if not 0 < count < len(capture):
        return capture
    lights = capture.lights
    inner, outer = (len(lights.on(surface)) for surface in ("inner", "outer"))
    if inner and outer:
        outer = fewer(count / len(capture), outer)
        return thinned(capture, max(count - outer, min(FEWEST, inner)), outer)
    if lights.kind == "unknown":
        return capture.select(evenly(len(capture), count))
    return capture.select(np.sort(spread(lights.position, count)))


def fewer(fraction: float, lights: int) -> int:
    """Return how many lights are a fraction of so many, at least FEWEST of them."""
    return max(round(fraction * lights), min(FEWEST, lights))


def thinned(capture: Capture, inner: int, outer: int) -> Capture:
    """Return the capture with so many lights of each surface, as evenly spread as they allow."""
    kept = []
    for surface, count in (("inner", inner), ("outer", outer)):
        own = capture.lights.on(surface)
        if count > len(own):
            raise LightsphereError(f"{capture.folder} has {len(own)} {surface} lights; choose at most as many")
        kept.append(own[spread(capture.lights.position[own], count)])
    return capture.select(np.sort(np.concatenate(kept)))


def spread(positions: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Choose points one after the other, each the farthest from those before it (Gonzalez 1985)."""
    directions = positions - positions.mean(axis=0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    chosen = [0]
    nearest = directions @ directions[0]
    while len(chosen) < count:
        nearest[chosen] = np.inf
        chosen.append(int(np.argmin(nearest)))
        nearest = np.maximum(nearest, directions @ directions[chosen[-1]])
    return np.array(chosen)


def evenly(total: int, count: int) -> NDArray[np.int64]:
    """Return at most so many of the numbers below a total, evenly spread, its ends left out where others will do."""
    return np.unique(np.linspace(0, total - 1, count + 2).round().astype(np.int64)[1:-1])
