"""Basis BRDFs and weights on known normals: the alternation of :mod:`.acls` with the normals held.

Highlights of one lobe grow as 1 / cos(theta_d)^2 towards grazing light (Kelemen and Szirmay-Kalos 2001): nodes evenly
spaced in theta_d, and smoothness between them, cannot follow that. Solved for is therefore the *level* table
``z = B max(cos(theta_d), LEAST_COSINE)^2`` from the level values ``y max(cos(theta_d), LEAST_COSINE)^2``, in which the
model is as linear as before; B is given out on FINE nodes. Since the factor does not depend on theta_h, "not rising with
theta_h" says the same of both.

A value's noise is judged beside the RMS of its pixel, not beside its usual value: normals that are known need no
dark values to be found by, and the tables' error is stated relative to the RMS.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...progress import Work
from ...reflectance.angles import difference_angles
from .acls import Alternation, Options, alternate, usual
from .pixel import noise_of, refine, settle
from .sight import TINY, Sight, cosines_of_difference
from .start import Start, begin

NODES = (64, 10)
FINE = 181  # nodes of the tables that are given out along theta_d; FINE - 1 is a multiple of the level ones' intervals
LEAST_COSINE = 0.05  # as in the start's lobe
WORTH = 9.0  # fewer bases are taken while the misfit, a square, of the usual pixel stays below so many times that of all
TURNS = 3  # in which weights and certainty of a pixel settle under known tables


class Level(Sight):
    """Values times max(cos(theta_d), LEAST_COSINE)^2."""

    def scale(self) -> NDArray[np.float64]:
        """Return the RMS of every pixel's values (P,) [1/sr], tiny where all are dark."""
        square = np.square(self.values.mean(axis=2)).mean(axis=1, dtype=np.float64)
        return np.asarray(np.maximum(np.sqrt(square), TINY))


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
        return level / rise[:, None, None], np.where(reached, (1 - beyond) * low + beyond * high, 0.0)


def tabulate(sight: Sight, normals: NDArray[np.float64], bases: int) -> Work[Tables]:
    """Find the basis BRDFs of pixels of known normals.

    Fewer bases are taken where they explain the usual pixel nearly as well: what a second basis adds to one material
    is how it departs from a bivariate BRDF at some views.

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
        if usual(tried[0]) < WORTH * usual(most[0]):
            return _tables(*tried)
    return _tables(*most)


def weigh(sight: Sight, normals: NDArray[np.float64], tables: Tables) -> NDArray[np.float64]:
    """Return the non-negative weights (P, K, 1) of pixels of known normals under known tables."""
    level = levelled(sight)
    scale, pixels = level.scale(), len(normals)
    geometry = (level.lights, level.near, level.points, level.views, level.values)
    certainty = (level.usable / noise_of.py_func(level.values.mean(axis=2) / scale[:, None]) / scale[:, None] ** 2).astype(
        np.float32
    )
    weights, held = np.empty((pixels, tables.level.shape[2], 1)), normals.copy()
    for turn in range(TURNS):
        if turn > 0:
            settle(*geometry, level.usable, scale, tables.level, held, weights, 0.0, certainty)
        refine(*geometry, certainty, tables.level, 0, held, weights, np.empty(pixels), np.empty(pixels))
    return weights


def levelled(sight: Sight) -> Level:
    """Return the values without the rise towards grazing light."""
    values = (sight.values * _rise(cosines_of_difference(sight))[..., None]).astype(np.float32)
    return Level(values, sight.usable, sight.lights, sight.near, sight.points, sight.views)
