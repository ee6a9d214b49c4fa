"""The best Principled BSDF: base colour, metallic, roughness and specular tint of every basis, blended by weights.

As Cycles evaluates it for an opaque surface without coat and sheen (distribution GGX, diffuse roughness 0), with base
colour b, specular tint t, metallic m and G the ggx closure::

    f cos = (1 - m) (G (t F0 + (1 - t F0) s) + (1 - E) b cos_i / pi) + m G (b + (1 - b) (1 - cos theta_d)^5)
    s = (F_dielectric(theta_d) - F0) / (1 - F0)        index of refraction by F0
    E(theta_o)                                         directional albedo of the first term for the largest t

The metal's edge is white; Cycles tints it by t, too, which a material with a share of both leaves out here. What is
minimised is the error of square roots, which weighs every direction by the light that goes there: squares of f itself
would rather have no highlight than one a little wrong. Not modelled: anisotropy, sheen, coat.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ..brdf import Brdf
from .closures import Lobe
from .energy import cosines
from .quadrature import Directions, directions, view

F0 = 0.08  # of specular IOR level 1: a tint below white is any weaker reflection
LEVEL = 1.0
LEAST_ROUGHNESS = 0.05
STARTS = [(roughness, metallic) for roughness in (0.1, 0.4) for metallic in (0.05, 0.95)]
EVERY = 13  # how many-th pair is tried in the search
GREY = np.array([0.2126, 0.7152, 0.0722])  # Rec.709 luminance

Array = NDArray[np.float64]
Maps = NDArray[np.float32]


@dataclass(frozen=True)
class Parameters:
    """One Principled BSDF: base and tint (3,), metallic, roughness, all 0 to 1."""

    base: Array
    tint: Array
    metallic: float
    roughness: float

    def evaluate(self, wi: Array, wo: Array) -> Array:
        """Return f cos(theta_i) (N, 3) for unit directions (N, 3) above the horizon."""
        gloss = Lobe("ggx", self.roughness).evaluate(wi, wo)[:, None]
        cos_d = np.linalg.norm(wi + wo, axis=1)[:, None] / 2
        s, edge = _dielectric(cos_d), (1 - cos_d) ** 5
        below = 1 - _specular_albedo(self.roughness, wo[:, 2], float(np.max(self.tint)))[:, None]
        coated = gloss * (F0 * self.tint * (1 - s) + s) + below * self.base * wi[:, 2, None] / np.pi
        return np.asarray((1 - self.metallic) * coated + self.metallic * gloss * (self.base * (1 - edge) + edge))


@dataclass(frozen=True)
class Principled:
    """Maps of a Principled BSDF with specular IOR level :data:`LEVEL`, index of refraction 1.5 and distribution GGX.

    Parameters
    ----------
    base, tint : (H, W, 3) float32
        Base colour and specular tint, linear, 0 to 1; NaN where nothing was recovered.
    metallic, roughness : (H, W) float32
    notes : dict
        Per basis ``principled_rel_rms``, the ``material_rel_rms`` of its Principled BSDF, and
        ``principled_cube_root_rel_rms``.
    """

    base: Maps
    tint: Maps
    metallic: Maps
    roughness: Maps
    notes: dict[str, Any] = field(default_factory=dict)


def fit_principled(bases: Sequence[Brdf], weights: Maps) -> Principled:
    """Fit a Principled BSDF to every basis and blend their parameters by the weights.

    Diffuse and metallic reflection add up as the weights say; roughness is the mean, weighted by specular reflection.

    Parameters
    ----------
    bases : sequence of K Brdf
    weights : (H, W, K, M) float32
        M = 1, or 3 where they carry the colour; NaN where nothing was recovered.
    """
    pairs = directions()
    found, errors, roots = [], [], []
    for brdf in bases:
        wanted = brdf.evaluate(pairs.wi, pairs.wo) * pairs.wi[:, 2, None]
        found.append(fit_parameters(pairs, wanted))
        value = found[-1].evaluate(pairs.wi, pairs.wo)
        errors.append(pairs.relative_rms(value, wanted))
        roots.append(pairs.relative_rms(np.cbrt(value), np.cbrt(wanted)))
    notes = {"principled_rel_rms": errors, "principled_cube_root_rel_rms": roots}
    return Principled(*_blended(found, weights), notes)


def fit_parameters(pairs: Directions, wanted: Array) -> Parameters:
    """Return the Principled BSDF nearest to f cos(theta_i) (N, 3) in square roots."""
    some = slice(EVERY // 2, None, EVERY)
    wi, wo, roots = pairs.wi[some], pairs.wo[some], np.sqrt(wanted[some])
    weight = np.sqrt(pairs.weight[some])[:, None]

    def residuals(x: Array) -> Array:
        return np.asarray((weight * (np.sqrt(_parameters(x).evaluate(wi, wo)) - roots)).ravel())

    low, high = np.zeros(8), np.ones(8)
    low[7] = LEAST_ROUGHNESS
    colour = np.clip(np.pi * np.median(wanted / pairs.wi[:, 2, None], axis=0), 0.01, 0.9)
    best = None
    for roughness, metallic in STARTS:
        start = np.array([*colour, 0.5, 0.5, 0.5, metallic, roughness])
        trial = least_squares(residuals, start, bounds=(low, high), max_nfev=20, x_scale=0.1)
        best = trial if best is None or trial.cost < best.cost else best
    assert best is not None
    return _parameters(best.x)


def _parameters(x: Array) -> Parameters:
    return Parameters(x[:3], x[3:6], float(x[6]), float(x[7]))


def _blended(found: Sequence[Parameters], weights: Maps) -> tuple[Maps, Maps, Maps, Maps]:
    """Return base, tint, metallic and roughness of texels."""
    shape = (*weights.shape[:3], 3)
    share = np.broadcast_to(weights, shape).astype(np.float64)
    base, tint = (np.stack([getattr(p, name) for p in found]) for name in ("base", "tint"))
    metallic, roughness = (np.array([getattr(p, name) for p in found]) for name in ("metallic", "roughness"))
    coloured, tinted = share * base, share * tint
    light, gloss = coloured @ GREY, tinted @ GREY  # (H, W, K)
    metal = (light * metallic).sum(axis=-1) / np.maximum(light.sum(axis=-1), 1e-9)
    shine = light * metallic + F0 * gloss * (1 - metallic) + 1e-9
    rough = (shine * roughness).sum(axis=-1) / shine.sum(axis=-1)
    maps = [np.clip(v.sum(axis=2), 0.0, 1.0) for v in (coloured, tinted)]
    return tuple(np.asarray(v, np.float32) for v in (*maps, metal, rough))  # type: ignore[return-value]


def _dielectric(cos_d: Array) -> Array:
    """Return (F - F0) / (1 - F0) of unpolarised light at a dielectric of reflectance F0 (Fresnel)."""
    index = (1 + np.sqrt(F0)) / (1 - np.sqrt(F0))
    g = np.sqrt(index**2 - 1 + cos_d**2)
    a, b = (g - cos_d) / (g + cos_d), (cos_d * (g + cos_d) - 1) / (cos_d * (g - cos_d) + 1)
    return np.asarray((a**2 * (1 + b**2) / 2 - F0) / (1 - F0))


def _specular_albedo(roughness: float, cosine: Array, tint: float) -> Array:
    """Return the directional albedo of the dielectric specular term, (N,)."""
    knots, parts = _albedo_table()
    below = int(np.clip(np.searchsorted(knots, roughness) - 1, 0, len(knots) - 2))
    beyond = (roughness - knots[below]) / (knots[below + 1] - knots[below])
    f0, s = (1 - beyond) * parts[below] + beyond * parts[below + 1]
    return np.asarray(np.interp(cosine, cosines(), tint * f0 + s))


@functools.cache
def _albedo_table() -> tuple[Array, Array]:
    """Return roughnesses (R,) and the albedos of G F0 (1 - s) and of G s there, (R, 2, C)."""
    knots = np.linspace(LEAST_ROUGHNESS, 1.0, 16)
    parts = np.empty((len(knots), 2, len(cosines())))
    for column, cosine in enumerate(cosines()):
        wi, weight = view(float(cosine), half=64, turns=32)
        wo = np.broadcast_to([np.sqrt(1 - cosine**2), 0.0, cosine], wi.shape)
        s = _dielectric(np.linalg.norm(wi + wo, axis=1) / 2)
        for row, roughness in enumerate(knots):
            gloss = weight * Lobe("ggx", float(roughness)).evaluate(wi, wo)
            gloss /= gloss.sum()  # Cycles takes what masking loses for reflected
            parts[row, :, column] = (gloss * F0 * (1 - s)).sum(), (gloss * s).sum()
    return knots, parts
