"""Material: a recovered reflectance as closures that Cycles renders.

A :class:`Mixture` holds K basis BRDFs as non-negative mixtures of a few closures that all of them share::

    f_k(wi, wo) cos(theta_i) = sum_l c_kl(cos(theta_o)) closure_l(wi, wo)

The curves c are linear between :data:`STOPS`, per colour: what a colour ramp in a node material is. They make the
mixture depend on the view as the true material does; the price is that it is not exactly reciprocal.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..settings import setting
from .closures import Lobe

MOST_BASES = 4
#: cos(theta_o) of the stops. Cycles keeps a colour ramp as 256 values: stops on these are kept exactly. They are
#: dense towards grazing views, where highlights of the same lobe grow most.
STOPS = np.array([0, 6, 13, 26, 51, 77, 102, 153, 204, 255]) / 255


@dataclass(frozen=True)
class MaterialSettings:
    """How a reflectance becomes a node material and the shape a mesh."""

    lobes: int = setting(
        4, "most glossy closures that the bases share; fewer where one more buys nothing", low=1, high=8
    )
    principled: bool = setting(False, "a Principled BSDF as the object's material, the faithful one beside it")
    textures: str = setting(
        "packed", "where textures go: into the .blend or into a folder", choices=("packed", "beside")
    )
    back: str = setting("open", "what closes the relief behind", choices=("open", "closed"))
    keep: float = setting(
        1.0, "share of the triangles that is kept; a normal map carries the rest", low=0.001, high=1.0
    )


@dataclass(frozen=True)
class Mixture:
    """K basis BRDFs as mixtures of L closures.

    Parameters
    ----------
    lobes : tuple of L Lobe
        The diffuse closure first.
    curves : (K, L, J, 3) float64
        c at STOPS, non-negative; grey and at most 1 for fresnel lobes, which nothing but a Mix Shader can scale.
    notes : dict
        Errors of the fit.
    """

    lobes: tuple[Lobe, ...]
    curves: NDArray[np.float64]
    notes: dict[str, Any] = field(default_factory=dict)

    def evaluate(self, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return f cos(theta_i) (N, K, 3) for unit directions (N, 3) above the horizon."""
        share = stop_shares(wo[:, 2])
        total = np.zeros((len(wi), len(self.curves), 3))
        for lobe, curve in zip(self.lobes, self.curves.transpose(1, 2, 0, 3), strict=True):
            total += lobe.evaluate(wi, wo)[:, None, None] * np.tensordot(share, curve, axes=1)
        return total


def stop_shares(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how much each stop counts at cosines (N,): (N, J), the weights of linear interpolation."""
    below = np.clip(np.searchsorted(STOPS, cosine, side="right") - 1, 0, len(STOPS) - 2)
    beyond = (cosine - STOPS[below]) / (STOPS[below + 1] - STOPS[below])
    shares = np.zeros((len(cosine), len(STOPS)))
    rows = np.arange(len(cosine))
    shares[rows, below], shares[rows, below + 1] = 1 - beyond, beyond
    return shares
