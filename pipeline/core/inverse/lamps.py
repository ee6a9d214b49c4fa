"""Powers of lamps from the pictures that each gives alone, beside unknown reflectances of groups."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from .estimate import fitting

Array = NDArray[np.float64]


def powers(
    pictures: Array,
    photograph: Array,
    weight: Array,
    group: NDArray[np.int64],
    known: Mapping[int, Array],
    fixed: Mapping[int, float],
) -> Array:
    """Return by what each lamp is to be multiplied so that the pictures of all explain a photograph.

    Every group multiplies its pixels by a factor per colour that is looked for, too: ``photograph[p] = r[g(p)] sum_l
    s_l picture_l[p]``, by least squares in s, with the r that fit it. Without a fixed lamp or a known group the
    scale is arbitrary. Not modelled: how light between surfaces changes with their reflectances.

    Parameters
    ----------
    pictures : (N, P, 3) float64
        Of each lamp alone, all surfaces at the same reflectance.
    photograph, weight : (P, 3) float64
    group : (P,) int
    known : dict of int to (3,) float64
        Factors of groups that are known.
    fixed : dict of int to float
        Factors of lamps that are known.
    """
    free = np.array([number not in fixed for number in range(len(pictures))])
    factors = np.array([fixed.get(number, 1.0) for number in range(len(pictures))])
    root = np.sqrt(weight)
    wanted = photograph * root
    even = np.ones_like(weight)
    groups = [(int(number), group == number) for number in np.unique(group)]

    def missing(found: Array) -> Array:
        """Return weighted residuals when every group reflects as fits these powers best (variable projection)."""
        factors[free] = found
        shown = np.tensordot(factors, pictures, 1) * root
        for number, mine in groups:
            factor = known[number] if number in known else fitting(shown[mine], wanted[mine], even[mine])
            shown[mine] *= factor
        return np.asarray((shown - wanted).ravel())

    if free.any():
        factors[free] = least_squares(missing, factors[free], bounds=(0.0, np.inf), x_scale="jac").x
    return factors
