"""Closed forms that pictures are compared with, written from the literature and independent of the pipeline."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

Vectors = NDArray[Any]


def dot(a: Vectors, b: Vectors) -> NDArray[np.float64]:
    return np.asarray((np.asarray(a, np.float64) * b).sum(axis=-1))


def unit(v: Vectors) -> NDArray[np.float64]:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def lambert_cosine(normal: Vectors, to_light: Vectors, albedo: float) -> NDArray[np.float64]:
    """Return f cos(theta_i) of a Lambertian surface: albedo cos / pi."""
    return albedo * np.maximum(dot(normal, to_light), 0) / np.pi


def ggx_cosine(normal: Vectors, to_light: Vectors, to_viewer: Vectors, roughness: float) -> NDArray[np.float64]:
    """Return f cos(theta_i) of a white GGX mirror facet lobe without Fresnel: D G / (4 cos_o).

    Walter et al., "Microfacet models for refraction through rough surfaces", 2007, with the height-correlated
    G = 1 / (1 + Lambda_i + Lambda_o) of Heitz, "Understanding the masking-shadowing function", 2014;
    alpha = roughness^2.
    """
    alpha = roughness**2
    half = unit(to_light + to_viewer)
    cos_i, cos_o, cos_h = (np.clip(dot(normal, v), 1e-9, 1) for v in (to_light, to_viewer, half))
    d = alpha**2 / (np.pi * (cos_h**2 * (alpha**2 - 1) + 1) ** 2)
    smith = [(np.sqrt(1 + alpha**2 * (1 / c**2 - 1)) - 1) / 2 for c in (cos_i, cos_o)]
    lit = (dot(normal, to_light) > 0) & (dot(normal, to_viewer) > 0)
    return np.where(lit, d / (1 + smith[0] + smith[1]) / (4 * cos_o), 0)


def beckmann_cosine(normal: Vectors, to_light: Vectors, to_viewer: Vectors, roughness: float) -> NDArray[np.float64]:
    """Return f cos(theta_i) of a white Beckmann mirror facet lobe without Fresnel: D G / (4 cos_o).

    Walter et al. 2007, with Smith's exact Lambda = (erf(a) - 1) / 2 + exp(-a^2) / (2 a sqrt(pi)),
    a = 1 / (alpha tan theta), and Heitz's height-correlated G; alpha = roughness^2.
    """
    alpha = roughness**2
    half = unit(to_light + to_viewer)
    cos_i, cos_o, cos_h = (np.clip(dot(normal, v), 1e-9, 1) for v in (to_light, to_viewer, half))
    d = np.exp((1 - 1 / cos_h**2) / alpha**2) / (np.pi * alpha**2 * cos_h**4)
    smith = []
    for cosine in (cos_i, cos_o):
        a = cosine / (alpha * np.sqrt(np.maximum(1 - cosine**2, 1e-18)))
        smith.append((erf(a) - 1) / 2 + np.exp(-(a**2)) / (2 * a * np.sqrt(np.pi)))
    lit = (dot(normal, to_light) > 0) & (dot(normal, to_viewer) > 0)
    return np.where(lit, d / (1 + smith[0] + smith[1]) / (4 * cos_o), 0)
