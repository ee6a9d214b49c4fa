"""Non-negative least squares of one basis on sums over the pairs of directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

RIDGE = 1e-7  # of each unknown's own square

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Sums:
    """``J(x) = x.gram x - 2 moments.x + power``, added up over three colours.

    Parameters
    ----------
    gram : (U, U) float64
        Of the columns of all lobes and stops.
    moments : (U, 4) float64
        Of the three colours and of their mean.
    power : (4,) float64
    """

    gram: Array
    moments: Array
    power: Array

    def mean_colour(self, unknowns: Index) -> float:
        """Return the least J over some unknowns (V,) of the mean colour alone."""
        gram, moments = self._part(unknowns)
        found = non_negative(gram, moments[:, 3])
        return float(self.power[3] - 2 * moments[:, 3] @ found + found @ gram @ found)

    def colours(self, unknowns: Index, grey: NDArray[np.bool_]) -> tuple[float, Array]:
        """Return the least J over some unknowns (V,) and where it is, (V, 3).

        Unknowns that ``grey`` (V,) marks are the same for all colours and at most 1.
        """
        gram, moments = self._part(unknowns)
        if grey.any():
            found = _with_grey(gram, moments, grey)
        else:
            found = np.stack([non_negative(gram, moments[:, i]) for i in range(3)], axis=1)
        cost = self.power[:3].sum() - 2 * (moments[:, :3] * found).sum() + (found * (gram @ found)).sum()
        return max(float(cost), 0.0), found

    def equations(self, unknowns: Index) -> Array:
        """Return the normal equations (V, V) of some unknowns."""
        return self.gram[np.ix_(unknowns, unknowns)]

    def _part(self, unknowns: Index) -> tuple[Array, Array]:
        return self.equations(unknowns), self.moments[unknowns]


def non_negative(gram: Array, moments: Array) -> Array:
    """Return the x >= 0 of the least x.gram x - 2 moments.x (Lawson and Hanson 1974).

    Unknowns that hardly count are not told apart: each is scaled by its own square, and a ridge keeps them low.
    """
    if not len(gram):
        return np.zeros(0)
    diagonal = np.diag(gram)
    scale = 1 / np.sqrt(np.maximum(diagonal, 1e-14 * diagonal.max()))
    scaled = gram * scale * scale[:, None] + RIDGE * np.eye(len(gram))
    root = np.linalg.cholesky(scaled).T
    return np.asarray(nnls(root, np.linalg.solve(root.T, moments * scale))[0] * scale)


def _with_grey(gram: Array, moments: Array, grey: NDArray[np.bool_]) -> Array:
    """Solve for all colours at once; grey unknowns above 1 are set to 1 and the others solved anew."""
    own, shared = np.flatnonzero(~grey), np.flatnonzero(grey)
    count = 3 * len(own)
    whole = np.zeros((count + len(shared), count + len(shared)))
    whole[:count, :count] = np.kron(np.eye(3), gram[np.ix_(own, own)])
    whole[:count, count:] = np.tile(gram[np.ix_(own, shared)], (3, 1))
    whole[count:, :count] = whole[:count, count:].T
    whole[count:, count:] = 3 * gram[np.ix_(shared, shared)]
    right = np.concatenate([moments[own, :3].T.ravel(), moments[shared, :3].sum(axis=1)])
    found = non_negative(whole, right)
    if (found[count:] > 1).any():
        found[count:] = np.minimum(found[count:], 1.0)
        found[:count] = non_negative(whole[:count, :count], right[:count] - whole[:count, count:] @ found[count:])
    result = np.zeros((len(gram), 3))
    result[own], result[shared] = found[:count].reshape(3, -1).T, found[count:, None]
    return result
