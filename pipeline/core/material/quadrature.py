"""Pairs of directions over which BRDFs are compared and fitted.

With h the half vector and d the difference vector (Rusinkiewicz 1998), dwi dwo = 4 cos(theta_d) dwh dwd. The nodes are
the centres of bins that are even in sqrt(theta_h), theta_d and the azimuths: a lobe of a tenth of a degree still covers
several of them. The weight of a pair is dwi dwo cos(theta_o): a sphere seen from afar, under light from everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..brdf import tabulated

HALF, DIFFERENCE, AZIMUTH = 90, 30, 16
COARSE_HALF, COARSE_DIFFERENCE, COARSE_AZIMUTH = 48, 12, 12  # where h has an azimuth of its own to go through


@dataclass(frozen=True)
class Directions:
    """N pairs of directions in the frame of the surface, normal z and tangent x.

    Parameters
    ----------
    wi, wo : (N, 3) float64
        Unit vectors above the horizon.
    weight : (N,) float64
        dwi dwo cos(theta_o); adds up to 2 pi^2 over all pairs.
    """

    wi: NDArray[np.float64]
    wo: NDArray[np.float64]
    weight: NDArray[np.float64]

    def select(self, which: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], Directions]:
        """Return a choice of pairs (N,) and these pairs."""
        return which, Directions(self.wi[which], self.wo[which], self.weight[which])

    def relative_rms(self, found: NDArray[np.float64], true: NDArray[np.float64]) -> float:
        """Return ``material_rel_rms``: RMS of the error of f cos(theta_i) over the RMS of f cos(theta_i).

        Parameters
        ----------
        found, true : (N, ...) float64
            BRDFs times cos(theta_i) at the pairs.

        Returns
        -------
        float
            0 for equal ones, 1 for a black one, .05 for one that is 5 % too bright; infinite where the truth is black.
        """
        weight = self.weight.reshape(-1, *[1] * (true.ndim - 1))
        power = float((weight * true**2).sum())
        return float(np.sqrt((weight * (found - true) ** 2).sum() / power)) if power > 0 else np.inf


def directions(isotropic: bool = True) -> Directions:
    """Return pairs for BRDFs that do, or do not, stay the same when both directions turn about the normal."""
    if isotropic:
        return _pairs(HALF, 1, DIFFERENCE, AZIMUTH)
    return _pairs(COARSE_HALF, COARSE_AZIMUTH, COARSE_DIFFERENCE, COARSE_AZIMUTH)


def view(cosine: float, half: int = 128, turns: int = 64) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return light directions for one view direction in the plane of x and z.

    Parameters
    ----------
    cosine : float
        cos(theta_o), above 0.

    Returns
    -------
    wi : (N, 3) float64
        Above the horizon, dense about the mirror direction.
    weight : (N,) float64
        dwi = 4 (wo.h) dwh [sr]; adds up to 2 pi.
    """
    root, phi = (x.ravel() for x in np.meshgrid(_centres(half), _centres(turns) * 2 * np.pi, indexing="ij"))
    theta = root**2 * np.pi / 2
    h = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    wo = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    towards = h @ wo
    wi = 2 * towards[:, None] * h - wo
    weight = 4 * towards * np.sin(theta) * np.pi * root / half * 2 * np.pi / turns
    lit = (towards > 0) & (wi[:, 2] > 0)
    return wi[lit], weight[lit]


def _pairs(half: int, turns: int, difference: int, azimuth: int) -> Directions:
    axes = (_centres(half), _centres(turns), _centres(difference), _centres(azimuth))
    root, turn, theta_d, phi_d = (x.ravel() for x in np.meshgrid(*axes, indexing="ij"))
    theta_h, theta_d, turn = root**2 * np.pi / 2, theta_d * np.pi / 2, turn * 2 * np.pi
    if turns == 1:  # mirror images in the plane of normal and half vector are alike
        turn, phi_d = 0 * turn, phi_d * np.pi
    else:
        phi_d = phi_d * 2 * np.pi
    bins = np.pi * root / half * np.pi / (2 * difference) * (2 * np.pi) ** 2 / (turns * azimuth)
    weight = 4 * np.cos(theta_d) * np.sin(theta_d) * np.sin(theta_h) * bins
    wi, wo = (turned(w, turn) for w in tabulated.directions(theta_h, theta_d, phi_d))
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    return Directions(wi[above], wo[above], (weight * wo[:, 2])[above])


def turned(w: NDArray[np.float64], angle: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Return directions (N, 3) turned about the normal by one angle or one each [rad]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([w[:, 0] * cosine - w[:, 1] * sine, w[:, 0] * sine + w[:, 1] * cosine, w[:, 2]], axis=-1)


def _centres(bins: int) -> NDArray[np.float64]:
    return (np.arange(bins) + 0.5) / bins
