"""Parametric BRDFs of the sources: the simplified Torrance-Sparrow lobe and Ward's."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LightsphereError

Array = NDArray[np.float64]
STEEPEST = np.cos(np.radians(80.0))  # the simplified lobe is fitted up to 80 degrees; it goes on as it is there


@dataclass(frozen=True)
class TorranceSparrow:
    """``f = diffuse / pi + specular exp(-theta_h^2 / (2 sigma^2)) / (4 cos_i cos_o)``.

    Torrance and Sparrow 1967 with neither masking nor Fresnel factor, as Georghiades 2003 has it. Cosines are taken as
    those of 80 degrees where they are smaller: the uncalibrated source fits no steeper pixels, and without masking the
    lobe would return more light than it receives. The lobe is not normalised: seen from above it returns
    2 pi sigma^2 specular while sigma is small.

    Parameters
    ----------
    diffuse, specular : (3,) float64
        Colours, from 0 up.
    sigma : float
        Standard deviation of the facets' slope angle [rad], above 0.
    """

    diffuse: Array
    specular: Array
    sigma: float
    isotropic = True

    def __post_init__(self) -> None:
        _check(self, ("diffuse", "specular"), {"sigma": (1e-3, 2.0)})

    def evaluate(self, wi: Array, wo: Array) -> Array:
        """Return f [1/sr], (N, 3), for unit directions wi and wo (N, 3) above the surface."""
        half = wi + wo
        theta = np.arctan2(np.hypot(half[:, 0], half[:, 1]), half[:, 2])
        lobe = torrance_sparrow(theta, wi[:, 2], wo[:, 2], self.sigma)
        return np.asarray(self.diffuse / np.pi + lobe[:, None] * self.specular)


def torrance_sparrow(theta_h: Array, cos_i: Array, cos_o: Array, sigma: float) -> Array:
    """Return the simplified lobe (N,) of :class:`TorranceSparrow` for a specular colour of one."""
    lobe = np.exp(-(theta_h**2) / (2 * sigma**2))
    return np.asarray(lobe / (4 * np.maximum(cos_i, STEEPEST) * np.maximum(cos_o, STEEPEST)))


@dataclass(frozen=True)
class Ward:
    """Ward's lobe, isotropic or brushed, on a diffuse ground.

    ``f = diffuse / pi + specular exp(-(x^2 / ax^2 + y^2 / ay^2)) / (4 pi ax ay sqrt(cos_i cos_o))`` with the slopes
    x = h_x / h_z along the tangent and y = h_y / h_z across it of the half vector h.
    Ward 1992, equation 5a, with its own normalisation: from above it returns its colour, less about 3 alpha^2 of it;
    at the angle theta cos(theta) of its colour, the loss that Duer 2006 mends. No Fresnel factor, no masking.

    Parameters
    ----------
    diffuse, specular : (3,) float64
        Colours, from 0 up.
    alpha_x, alpha_y : float
        Standard deviation of the facets' slope along and across the tangent, above 0, at most 1.
    """

    diffuse: Array
    specular: Array
    alpha_x: float
    alpha_y: float

    def __post_init__(self) -> None:
        _check(self, ("diffuse", "specular"), {"alpha_x": (1e-3, 1.0), "alpha_y": (1e-3, 1.0)})

    @property
    def isotropic(self) -> bool:
        """Whether the lobe is as wide across the tangent as along it."""
        return self.alpha_x == self.alpha_y

    def evaluate(self, wi: Array, wo: Array) -> Array:
        """Return f [1/sr], (N, 3), for unit directions wi and wo (N, 3) above the surface."""
        half = wi + wo
        slopes = half[:, :2] / half[:, 2:] / [self.alpha_x, self.alpha_y]
        scale = 4 * np.pi * self.alpha_x * self.alpha_y * np.sqrt(np.maximum(wi[:, 2] * wo[:, 2], 1e-12))
        lobe = np.exp(-(slopes**2).sum(axis=1)) / scale
        return np.asarray(self.diffuse / np.pi + lobe[:, None] * self.specular)


MODELS: dict[str, type[Any]] = {"torrance-sparrow": TorranceSparrow, "ward": Ward}


def parameters(model: type[Any]) -> tuple[str, ...]:
    """Return the names of a model's parameters."""
    return tuple(item.name for item in fields(model))


def _check(model: Any, colours: tuple[str, ...], limits: dict[str, tuple[float, float]]) -> None:
    for name in colours:
        value = np.asarray(getattr(model, name), np.float64)
        if value.shape != (3,) or not np.isfinite(value).all() or (value < 0).any():
            raise LightsphereError(f"{name} is {value.tolist()}; give three finite numbers from 0 up")
    for name, (low, high) in limits.items():
        value = np.asarray(getattr(model, name), np.float64)
        if value.shape != () or not low <= value <= high:
            raise LightsphereError(f"{name} is {value.tolist()}; give one number from {low:g} to {high:g}")
