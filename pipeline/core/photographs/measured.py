"""A camera's response measured from exposures of one thing: the light behind their values is in the ratio of times.

    f(z_a) / t_a = f(z_b) / t_b,   f(0) = 0, f(1) = 1, f rising

for every pixel and pair of exposures (Debevec and Malik, "Recovering high dynamic range radiance maps from
photographs", 1997). f is a broken line whose rises are non-negative least squares. All colours share it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from ..errors import LightsphereError
from .photographs import Shot
from .response import Response

Array = NDArray[np.float64]

PIECES = 24  # of the broken line
TRUSTED = (0.1, 0.95)  # stored values of the longer exposure: above the noise, below where cameras bend and clip
MOST, FEWEST = 4000, 200  # pairs of values of each light, and altogether
ROUNDS = 5  # of weighing by the light found
SMOOTH = (
    1.0  # weight of what no polynomial of degree three is, relative to the pairs; pairs of one ratio leave waves open
)
LIGHTS = 8  # whose exposures are looked at
NOISE, BENT = 0.005, 0.01  # of a stored value, and relative misfit of a broken line


def measured(lights: Sequence[Sequence[Shot]]) -> Response:
    """Return the response that explains the exposures of some lights best.

    Parameters
    ----------
    lights : sequence of sequence of Shot
        The exposures of each light, their times known.

    Raises
    ------
    LightsphereError
        When there are no exposures of different times, or hardly a value that is well exposed twice.
    """
    kept = np.unique(np.linspace(0, len(lights) - 1, LIGHTS).round().astype(int))
    parts = [_pairs(lights[k]) for k in kept]
    short, long, ratio = (np.concatenate(column) for column in zip(*parts, strict=True))
    if len(short) < FEWEST:
        raise LightsphereError(
            "the exposures do not tell the camera's response: too few values are well exposed in two of them; state it "
            "by --response srgb, or a gamma"
        )
    rows = _ramps(short) - ratio[:, None] * _ramps(long)
    rises, place = np.full(PIECES, 1.0 / PIECES), np.linspace(0.0, 1.0, PIECES + 1)
    smooth = SMOOTH * np.sqrt(len(rows)) / BENT * PIECES * np.diff(np.eye(PIECES), 3, axis=0)
    seen = np.arange(1, PIECES + 1) <= TRUSTED[1] * PIECES  # beyond, the slope goes on
    total = 1e3 * np.sqrt(len(rows)) * seen[None].astype(np.float64)
    for _ in range(ROUNDS):
        slope = np.gradient(np.append(0.0, np.cumsum(rises)), place)
        slopes = [np.interp(value, place, slope) for value in (short, long)]
        noise = NOISE * np.hypot(slopes[0], ratio * slopes[1])
        weight = 1.0 / np.hypot(noise, BENT * ratio * (_ramps(long) @ rises))
        system = np.vstack([weight[:, None] * rows, smooth, total])
        rises, _ = nnls(system, np.append(np.zeros(len(system) - 1), total[0, 0]))
    line = np.append(0.0, np.cumsum(rises)) / rises.sum()
    return Response("of the exposures", lambda value: np.interp(value, place, line))


def _pairs(shots: Sequence[Shot]) -> tuple[Array, Array, Array]:
    """Return stored values (N,) of the shorter and the longer exposure, and the ratio of their times, below 1."""
    pictures = [shot.read() for shot in shots]
    seconds = [shot.seconds or picture.seconds for shot, picture in zip(shots, pictures, strict=True)]
    known = [time for time in seconds if time is not None]
    if len(known) < 2 or len(known) < len(shots) or len(set(known)) < len(known):
        raise LightsphereError(
            f"a response from exposures needs several of {shots[0].name} with times that are known and differ; give "
            "more, or state it by --response srgb"
        )
    found = []
    order = np.argsort(known)
    for a, b in pairwise(order):
        short, long = (pictures[i].pixels.astype(np.float64).ravel() for i in (a, b))
        good = np.flatnonzero((long > TRUSTED[0]) & (long < TRUSTED[1]))
        good = good[:: max(len(good) // MOST, 1)]
        found.append((short[good], long[good], np.full(len(good), known[a] / known[b])))
    short, long, ratio = (np.concatenate(column) for column in zip(*found, strict=True))
    return short, long, ratio


def _ramps(value: Array) -> Array:
    """Return how much of each piece's rise lies below stored values, (N, PIECES)."""
    return np.asarray(np.clip(value[:, None] * PIECES - np.arange(PIECES), 0.0, 1.0))
