"""How much light a material returns, and whether it treats light and viewer alike."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from . import STOPS, Mixture, stop_shares
from .quadrature import Directions, turned, view

BETWEEN = 4  # cosines per interval of two stops at which albedos are taken
LEAST_COSINE = 2e-3  # flatter views than 89.9 degrees have no area


def cosines() -> NDArray[np.float64]:
    """Return the cosines (C,) at which albedos are stated, every stop among them but for the horizon."""
    steps = np.arange(BETWEEN) / BETWEEN
    inner = (STOPS[:-1, None] + np.diff(STOPS)[:, None] * steps).ravel()
    return np.asarray(np.append(np.maximum(inner, LEAST_COSINE), 1.0))


def directional_albedo(
    f_cos: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]], isotropic: bool = True
) -> NDArray[np.float64]:
    """Return the share of light that is returned towards each view, (C, ...) at :func:`cosines`.

    ``rho(theta_o) = integral of f cos(theta_i) dwi``. Of what is not isotropic, the largest over eight azimuths of the
    view.

    Parameters
    ----------
    f_cos : callable
        f cos(theta_i) (N, ...) of unit directions wi and wo (N, 3).
    """
    albedos = []
    for cosine in cosines():
        wi, weight = view(float(cosine))
        wo = np.broadcast_to([np.sqrt(1 - cosine**2), 0.0, cosine], wi.shape)
        turns = [0.0] if isotropic else np.arange(8) * np.pi / 8
        values = [np.tensordot(weight, f_cos(turned(wi, turn), turned(wo, turn)), axes=1) for turn in turns]
        albedos.append(np.max(values, axis=0))
    return np.asarray(albedos)


def bounded(mixture: Mixture) -> Mixture:
    """Return the mixture with curves lowered where a basis would return more light than it receives.

    Both stops beside a view take the lower factor, so that no view between them exceeds 1.
    """
    isotropic = all(lobe.aspect == 1 for lobe in mixture.lobes)
    albedo = directional_albedo(mixture.evaluate, isotropic)
    factor = np.minimum(1.0, 1 / np.maximum(albedo.max(axis=2), 1e-30))  # (C, K)
    beside = stop_shares(cosines()) > 0
    lowest = np.min(np.where(beside[:, :, None], factor[:, None], 1.0), axis=0)  # (J, K)
    lowered = dataclasses.replace(mixture, curves=mixture.curves * lowest.T[:, None, :, None])
    after = albedo if (lowest == 1).all() else directional_albedo(lowered.evaluate, isotropic)
    most = {"albedo_unbounded": albedo, "albedo": after}
    notes = {name: values.max(axis=(0, 2)).tolist() for name, values in most.items()}
    return dataclasses.replace(lowered, notes=mixture.notes | notes)


def reciprocity_error(mixture: Mixture, pairs: Directions) -> NDArray[np.float64]:
    """Return the RMS of f(wi, wo) - f(wo, wi) over the RMS of f, (K,), both times cos(theta_i) cos(theta_o).

    The cosines keep grazing pairs from being all that counts.
    """
    there = mixture.evaluate(pairs.wi, pairs.wo) * pairs.wo[:, 2, None, None]
    back = mixture.evaluate(pairs.wo, pairs.wi) * pairs.wi[:, 2, None, None]
    weight = (pairs.weight / pairs.wo[:, 2])[:, None]
    power = (weight * (there**2).mean(axis=2)).sum(axis=0)
    return np.asarray(np.sqrt((weight * ((there - back) ** 2).mean(axis=2)).sum(axis=0) / np.maximum(power, 1e-300)))
