"""The closures of Cycles that a material is mixed from, in closed form, as f cos(theta_i).

alpha = roughness^2; D G / (4 cos_o) with G = 1 / (1 + Lambda_i + Lambda_o) (Heitz 2014, equation 99)::

    diffuse    cos_i / pi                                        Diffuse BSDF of roughness 0
    ggx        D of Trowbridge and Reitz 1975                    Glossy BSDF, GGX
    beckmann   D of Beckmann and Spizzichino 1963                Glossy BSDF, Beckmann; Lambda after Walter et al. 2007
    fresnel    ggx (1 - h.wo)^5                                  Metallic BSDF, GGX, F82, black base, white edge
    retro      ggx about wo in place of the normal               Glossy BSDF, GGX, Normal = Incoming
    sheen      D = exp(-cot^2 theta_h / roughness^2) / (pi roughness^2 sin^4 theta_h), G of Cook and Torrance
               1982, as D G / (4 cos_o)                          Sheen BSDF, Ashikhmin (2007)

Not modelled: what Cycles does to a glossy closure where the mirrored view lies below the triangle's own plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

KINDS = ("diffuse", "ggx", "beckmann", "fresnel", "retro", "sheen")
LEAST_ROUGHNESS = 0.04  # alpha .0016: below alpha .001 Cycles' float32 half vectors are too coarse


@dataclass(frozen=True)
class Lobe:
    """One closure.

    Parameters
    ----------
    kind : str
        One of KINDS.
    roughness : float
        As Cycles' sockets have it; 0 for the diffuse one.
    aspect : float
        alpha_y / alpha_x of a ggx or beckmann lobe, whose roughness is (alpha_x alpha_y)^(1/4); 1 is isotropic.
    """

    kind: str
    roughness: float = 0.0
    aspect: float = 1.0

    @property
    def alphas(self) -> tuple[float, float]:
        """alpha along the tangent x and across it."""
        alpha, stretch = self.roughness**2, float(np.sqrt(self.aspect))
        return alpha / stretch, alpha * stretch

    def evaluate(self, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return f cos(theta_i) (N,) of the white closure for unit directions (N, 3) above the horizon."""
        if self.kind == "diffuse":
            return np.asarray(wi[:, 2] / np.pi)
        if self.kind == "sheen":
            return _sheen(wi, wo, self.roughness)
        if self.kind == "retro":
            return self._about_view(wi, wo)
        return _microfacets(wi, wo, self.kind, self.alphas)

    def _about_view(self, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the lobe in the frame whose normal is wo; it ends where light comes from behind that normal."""
        sine, cosine = np.linalg.norm(wi - wo, axis=-1) / 2, np.linalg.norm(wi + wo, axis=-1) / 2
        towards = cosine**2 - sine**2
        lit = towards > 0
        value = np.zeros(len(wi))
        light = np.stack([2 * sine * cosine, 0 * sine, towards], axis=-1)[lit]
        value[lit] = _microfacets(light, np.broadcast_to([0.0, 0.0, 1.0], light.shape), "ggx", self.alphas)
        return value


def _microfacets(
    wi: NDArray[np.float64], wo: NDArray[np.float64], kind: str, alphas: tuple[float, float]
) -> NDArray[np.float64]:
    half = wi + wo
    half = half / np.linalg.norm(half, axis=-1, keepdims=True)
    x, y, z = half[:, 0] / alphas[0], half[:, 1] / alphas[1], half[:, 2]
    slopes = [np.hypot(w[:, 0] * alphas[0], w[:, 1] * alphas[1]) / w[:, 2] for w in (wi, wo)]
    area = np.pi * alphas[0] * alphas[1]
    if kind == "beckmann":
        d, shadows = np.exp(-(x**2 + y**2) / z**2) / (area * z**4), [_lambda_beckmann(slope) for slope in slopes]
    else:
        d, shadows = 1 / (area * (x**2 + y**2 + z**2) ** 2), [(np.sqrt(1 + slope**2) - 1) / 2 for slope in slopes]
    value = d / (4 * wo[:, 2] * (1 + shadows[0] + shadows[1]))
    if kind == "fresnel":
        value = value * (1 - np.clip((wo * half).sum(axis=-1), 0.0, 1.0)) ** 5
    return np.asarray(value)


def _lambda_beckmann(slope: NDArray[np.float64]) -> NDArray[np.float64]:
    """Walter's rational fit of Lambda; slope = alpha tan(theta)."""
    a = 1 / np.maximum(slope, 1e-9)
    return np.where(a < 1.6, (1 - 1.259 * a + 0.396 * a**2) / (3.535 * a + 2.181 * a**2), 0.0)


def _sheen(wi: NDArray[np.float64], wo: NDArray[np.float64], roughness: float) -> NDArray[np.float64]:
    half = wi + wo
    half = half / np.linalg.norm(half, axis=-1, keepdims=True)
    cos_i, cos_o, cos_h = wi[:, 2], wo[:, 2], half[:, 2]
    cos_d = np.maximum((wo * half).sum(axis=-1), 1e-9)
    sine2 = np.maximum(1 - cos_h**2, 1e-9)
    d = np.exp(-(cos_h**2) / (sine2 * roughness**2)) / (np.pi * roughness**2 * sine2**2)
    masking = np.minimum(1.0, 2 * cos_h * np.minimum(cos_i, cos_o) / cos_d)
    return np.asarray(d * masking / (4 * cos_o))
