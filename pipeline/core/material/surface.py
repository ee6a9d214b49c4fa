"""What a node material shows: bases as mixtures of closures, and how much of each every texel has."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..brdf import Brdf
from ..progress import Work
from ..reflectance import Reflectance
from ..reflectance.bivariate import Bivariate
from . import Mixture
from .closures import Lobe
from .energy import directional_albedo
from .fit import fit

WHITE = np.ones(3)
POSSIBLE = 2.0  # usual albedo beyond which a weight is no surface's, but a wrong pixel's
FULL = 0.95  # share of a weight map's sum that lies in weights of at most 1
TILE = 65536  # texels whose albedos are held at once


@dataclass(frozen=True)
class Surface:
    """``f = sum_k w_k f_k`` at every texel, f_k of a mixture.

    Parameters
    ----------
    mixture : Mixture
        Of K bases.
    weights : (H, W, K, M) float32
        M = 1, or 3 where they carry the colour; NaN where nothing was recovered.
    bases : sequence of K Brdf
        What the mixture was fitted to.
    notes : dict
        Errors that the material carries.
    """

    mixture: Mixture
    weights: NDArray[np.float32]
    bases: Sequence[Brdf] = ()
    notes: dict[str, Any] = field(default_factory=dict)


def surface(reflectance: Bivariate, lobes: int) -> Work[Surface]:
    """Return a recovered reflectance as closures that Cycles renders.

    A basis and its weights are known up to a factor: it is chosen so that the full weight is 1, a basis being then a
    material that an object could have.

    Parameters
    ----------
    reflectance : Bivariate
    lobes : int
        Most glossy lobes, see :func:`.fit.fit`.

    Raises
    ------
    LightsphereError
        When a basis is black.
    """
    known = np.isfinite(reflectance.weights).all(axis=(2, 3))
    strongest = reflectance.weights[known].max(axis=-1)
    full = np.array([_full(weights, reflectance.basis(k)) for k, weights in enumerate(strongest.T)])
    scaled = dataclasses.replace(
        reflectance,
        table=reflectance.table * full[:, None],
        weights=(reflectance.weights / full[:, None]).astype(np.float32),
    )
    bases = [scaled.basis(k) for k in range(len(full))]
    mixture = yield from fit(bases, lobes, fresnel=reflectance.weights.shape[3] == 1)
    weights, lowered = _bounded(mixture, scaled.weights)
    return Surface(mixture, weights, bases, {**_figures(mixture), "texels_lowered": lowered})


def uniform(brdfs: Sequence[Brdf], lobes: int) -> Work[Surface]:
    """Return BRDFs as the bases of one material that shows the first alone, everywhere alike."""
    mixture = yield from fit(brdfs, lobes)
    weights = np.zeros((1, 1, len(brdfs), 1), np.float32)
    weights[..., 0, :] = 1.0
    return Surface(mixture, weights, brdfs, _figures(mixture))


@dataclass(frozen=True)
class White:
    """A closure of no colour as a BRDF."""

    lobe: Lobe
    isotropic = True

    def evaluate(self, wi: NDArray[Any], wo: NDArray[Any]) -> NDArray[np.float64]:
        """Return f [1/sr], (N, 3), for unit directions (N, 3) above the surface."""
        return np.asarray((self.lobe.evaluate(wi, wo) / wi[:, 2])[:, None] * WHITE)


def bases_of(recovered: Reflectance | Surface) -> tuple[Sequence[Brdf], NDArray[np.float32]]:
    """Return the basis BRDFs and weights (H, W, K, M) of a recovered reflectance.

    Those of a diffuse and one glossy lobe are white closures: the diffuse one, and a glossy one and its gain towards
    grazing angles for every roughness.
    """
    if isinstance(recovered, Surface):
        return recovered.bases, recovered.weights
    bases: list[Brdf] = [White(Lobe("diffuse"))]
    weights = [recovered.albedo]
    for roughness in np.unique(recovered.roughness[np.isfinite(recovered.roughness)]):
        own = np.where(np.isnan(recovered.roughness), np.nan, recovered.roughness == roughness)[..., None]
        bases += [White(Lobe("ggx", float(roughness))), White(Lobe("fresnel", float(roughness)))]
        weights += [recovered.specular * own, (recovered.edge[..., None] * own).repeat(3, axis=-1)]
    return bases, np.stack(weights, axis=2).astype(np.float32)


def _full(weights: NDArray[np.float32], basis: Brdf) -> float:
    """Return which of a basis's weights (P,) becomes 1: few wrong pixels do not set it, nor is one of few pixels lost.

    A wrong pixel's may be thousands of times the others: none counts for more than a surface could have.
    """
    possible = POSSIBLE / _usual_albedo(basis)
    ascending = np.sort(np.minimum(weights.astype(np.float64), possible))
    total = np.cumsum(ascending)
    return float(ascending[np.searchsorted(total, FULL * total[-1])]) or 1.0


def _usual_albedo(basis: Brdf) -> float:
    """Return the share of light that a basis returns to the usual view, in the colour that it returns most of."""
    albedo = directional_albedo(lambda wi, wo: basis.evaluate(wi, wo) * wi[:, 2:])
    return max(float(np.median(albedo, axis=0).max()), 1e-30)


def _bounded(mixture: Mixture, weights: NDArray[np.float32]) -> tuple[NDArray[np.float32], float]:
    """Lower the weights of texels that would return more light than they receive; return their share, too."""
    albedo = directional_albedo(mixture.evaluate)  # (C, K, 3)
    flat = weights.reshape(-1, *weights.shape[2:]).copy()
    lowered = 0
    for start in range(0, len(flat), TILE):
        part = flat[start : start + TILE]
        most = np.einsum("cks,pkm->pcsm" if part.shape[2] == 1 else "cks,pks->pcs", albedo, part)
        most = most.reshape(len(part), -1).max(axis=1)
        over = most > 1
        part[over] /= most[over, None, None]
        lowered += int(over.sum())
    return flat.reshape(weights.shape), lowered / max(int(np.isfinite(flat[:, 0, 0]).sum()), 1)


def _figures(mixture: Mixture) -> dict[str, Any]:
    errors = ("material_rel_rms", "cube_root_rel_rms", "reciprocity_error", "error_by_view", "error_by_lobes")
    names = (*errors, "albedo", "condition")
    return {name: mixture.notes[name] for name in names} | {
        "model": "mixture of closures",
        "lobes": [f"{lobe.kind} {lobe.roughness:.3g}" for lobe in mixture.lobes],
    }
