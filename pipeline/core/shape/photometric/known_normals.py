"""Basis BRDFs and weights on known normals: the alternation of :mod:`.acls` with the normals held.

Highlights of one lobe grow as 1 / cos(theta_d)^2 towards grazing light (Kelemen and Szirmay-Kalos 2001): nodes evenly
spaced in theta_d, and smoothness between them, cannot follow that. Solved for is therefore the *level* table
``z = B max(cos(theta_d), LEAST_COSINE)^2`` from the level values ``y max(cos(theta_d), LEAST_COSINE)^2``, in which the
model is as linear as before; B is given out on FINE nodes. The factor does not depend on theta_h: "not rising with
theta_h" says the same of both.

A value's noise is judged beside the RMS of its pixel where that is above its usual value: where next to all lights
miss the highlight, the dark rest is not to outweigh it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...progress import Work
from ...reflectance.angles import difference_angles
from .acls import Alternation, Options, alternate
from .foreseen import noise_of
from .pixel import refine, settle
from .sight import Sight
from .start import Start, begin

NODES = (64, 13)  # more hardly gain: nodes at grazing light are reached by a handful of values
FINE = 181  # nodes of the tables that are given out along theta_d; FINE - 1 is a multiple of the level ones' intervals
LEAST_COSINE = 0.05  # as in the start's lobe
ALIKE, LITTLE = 1.25, 0.01  # fewer bases are taken whose misfit is at most so many times that of all, and this more
TURNS = 3  # in which weights and certainty of a pixel settle under known tables


class Level(Sight):
    """Values times max(cos(theta_d), LEAST_COSINE)^2."""

    def scale(self) -> NDArray[np.float64]:
        """Return the usual value of every pixel (P,) [1/sr], or the RMS of its values where that is larger."""
        square = np.square(self.values.mean(axis=2)).mean(axis=1, dtype=np.float64)
        return np.maximum(super().scale(), np.sqrt(square))


@dataclass(frozen=True)
class Tables:
    """K basis BRDFs.

    Parameters
    ----------
    level : (TH, TD, K, 3) float64
        B max(cos(theta_d), LEAST_COSINE)^2 [1/sr].
    seen : (TH, TD, K) float64
        Sum of certainty times squared share over the values that reached a node.
    objective : tuple of float
        J after every half round with settled certainty.
    """

    level: NDArray[np.float64]
    seen: NDArray[np.float64]
    objective: tuple[float, ...]

    def fine(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return B (TH, FINE, K, 3) [1/sr] and ``seen`` (TH, FINE, K), 0 between nodes of which one was not seen."""
        place = np.linspace(0.0, self.level.shape[1] - 1.0, FINE)
        below = np.minimum(place.astype(int), self.level.shape[1] - 2)
        beyond = (place - below)[:, None]
        level = (1 - beyond[..., None]) * self.level[:, below] + beyond[..., None] * self.level[:, below + 1]
        low, high = self.seen[:, below], self.seen[:, below + 1]
        reached = ((low > 0) | (beyond == 1)) & ((high > 0) | (beyond == 0))
        rise = _rise(np.cos(difference_angles(FINE)))
        return level * rise[:, None, None], np.where(reached, (1 - beyond) * low + beyond * high, 0.0)


def tabulate(sight: Sight, normals: NDArray[np.float64], bases: int) -> Work[Tables]:
    """Find the basis BRDFs of pixels of known normals.

    Fewer bases are taken where they explain the pixels nearly as well in the mean: what a second basis adds to one
    material is how it departs from a bivariate BRDF at some views. A material of few pixels counts in the mean.

    Parameters
    ----------
    sight : Sight
    normals : (P, 3) float64
        Unit, camera space; towards the camera.
    bases : int
        Most bases, 1 to 4.

    Yields
    ------
    Progress per roughness of the start and per round.
    """
    level = levelled(sight)
    start = yield from begin(level, normals)
    most = yield from _alternated(level, start, bases)
    for fewer in range(1, most[0].shape[2]):
        tried = yield from _alternated(level, start, fewer)
        if _mean_misfit(tried[0]) < ALIKE * _mean_misfit(most[0]) + LITTLE:
            return _tables(*tried)
    return _tables(*most)


def weigh(sight: Sight, normals: NDArray[np.float64], tables: Tables) -> NDArray[np.float64]:
    """Return the non-negative weights (P, K, 1) of pixels of known normals under known tables."""
    level = levelled(sight)
    scale, pixels = level.scale(), len(normals)
    held, weights = normals.copy(), np.zeros((pixels, tables.level.shape[2], 1))
    geometry = (level.lights, level.near, level.points, level.views, level.values)
    noise = noise_of.py_func(level.values.mean(axis=2) / scale[:, None]) * scale[:, None] ** 2
    certainty = (level.usable / noise).astype(np.float32)
    for turn in range(TURNS):
        if turn > 0:
            settle(*geometry, level.usable, scale, tables.level, held, weights, 0.0, certainty)
        refine(*geometry, certainty, tables.level, 0, held, weights, np.empty(pixels), np.empty(pixels))
    return weights


def levelled(sight: Sight) -> Level:
    """Return the values without the rise towards grazing light."""
    to_light = sight.lights - sight.points[:, None] if sight.near else sight.lights[None]
    towards = np.einsum("plc,pc->pl", to_light, sight.views) / np.linalg.norm(to_light, axis=2)
    values = sight.values / _rise(np.sqrt(np.maximum(0.5 + 0.5 * towards, 0.0)))[..., None]
    return Level(values.astype(np.float32), sight.usable, sight.lights, sight.near, sight.points, sight.views)


def _rise(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.maximum(cosine, LEAST_COSINE) ** -2.0)


def _alternated(sight: Level, start: Start, bases: int) -> Work[tuple[Alternation, list[float]]]:
    options = Options(bases, nodes_h=NODES[0], nodes_d=NODES[1])
    state = Alternation(sight, start, options)
    objective = yield from alternate(state, options, False, f"{bases} bases" if bases > 1 else "one basis")
    return state, objective


def _mean_misfit(state: Alternation) -> float:
    return float(state.misfit(state.normals, state.weights).mean())


def _tables(state: Alternation, objective: list[float]) -> Tables:
    return Tables(state.table, state.seen, tuple(objective))
