"""Inverse: reflectances of a known scene from one picture, with Cycles' global illumination in the loop.

Surfaces that share a reflectance are a group. Every group has a model of a level; richer ones explain more pictures::

    diffuse           rho_d
    perfect-mirror    rho_s = 1, as sharp as Cycles can
    mirror            rho_s, as sharp
    plastic           rho_d below a smooth or rough boundary of IOR, by Fresnel's law, of slope alpha (GGX)
    diffuse-specular  rho_d and a sharp rho_s
    isotropic         rho_d, rho_s and the slope alpha of a lobe, Beckmann's or, of longer tails, GGX
    anisotropic       alpha along and across a direction of the texture's U
    texture           rho_d of every texel

Boivin and Gagalowicz 2001 name the hierarchy; Ward's lobe there is Beckmann's here, which Cycles has.
GGX: Walter et al. 2007; many polished and painted things have its tails.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LightsphereError
from ..settings import setting

LEVELS = ("diffuse", "perfect-mirror", "mirror", "plastic", "diffuse-specular", "isotropic", "anisotropic", "texture")
#: What each level estimates.
FREE = {
    "diffuse": ("diffuse",),
    "perfect-mirror": (),
    "mirror": ("specular",),
    "plastic": ("diffuse", "alpha"),
    "diffuse-specular": ("diffuse", "specular"),
    "isotropic": ("diffuse", "specular", "alpha"),
    "anisotropic": ("diffuse", "specular", "alpha", "ratio", "angle"),
    "texture": ("diffuse",),
}
IOR = 1.5  # of plastics, varnish, glass and most else that is no metal; Blender's own
BECKMANN, GGX = DISTRIBUTIONS = ("beckmann", "ggx")
POWER = "power"  # the one parameter of a lamp
COLOURED = ("diffuse", "specular")  # parameters with a value for every colour; the others serve all three
SHARP = 1e-3  # alpha of a mirror: below it Cycles' float32 half vectors are too coarse
FAINT = 0.05  # of a surface's largest reflectance
LEAST, MOST = 1e-3, 0.98  # reflectances: nothing is dropped from the render, and light fades
ALPHAS = (SHARP, 0.7)
RATIOS = (1.0, 30.0)  # of the larger alpha over the smaller

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InverseSettings:
    """How reflectances are looked for."""

    groups: str = setting(
        "materials",
        "what shares a reflectance; the property lightsphere_group of an object goes before",
        choices=("materials", "collections", "objects"),
    )
    response: str = setting(
        "auto",
        "of the camera: linear, srgb, a gamma such as 2.2, a file of two columns (value as stored, light), or "
        "exposures, which measures it from a folder of them; auto takes srgb for 8 bits and linear for more",
    )
    resolution: int = setting(160, "width of the picture that is compared", unit="px", low=16, high=1024)
    budget: float = setting(
        240.0, "time that the whole may take: the best result so far is kept then", unit="s", low=1.0, high=1e6
    )
    target: float = setting(0.5, "uncertainty of reflectances at which the search ends", unit="%", low=0.01, high=50.0)
    levels: str = setting("all", "richest level that may be chosen", choices=("all", "diffuse", *LEVELS[2:-1]))
    method: str = setting(
        "joint",
        "joint: all groups together, two seeds against noise; source: ratios and fixed thresholds (Boivin 2001)",
        choices=("joint", "source"),
    )
    thresholds: str = setting(
        "5, 50, 1, 5",
        "errors of the source's method [%]: below the first a group is diffuse or a mirror, above the second it is no "
        "mirror, below the third lobes explain it, above the fourth it has a texture",
    )
    unknown_lamps: str = setting(
        "",
        "lamps, materials that shine and worlds whose power is looked for, commas between their names, or all; of all, "
        "the brightest stays as it is unless the picture shows one",
    )
    known: str = setting("", "reflectances that are known, as GROUP=R,G,B with semicolons between: they give the scale")


@dataclass(frozen=True)
class Model:
    """What a group reflects.

    Parameters
    ----------
    level : str
        One of LEVELS.
    diffuse, specular : (3,) float64
        Reflectances; of a texture the factor of its texels.
    alpha : float
        Root mean square slope of Beckmann's lobe, the width of GGX; the geometric mean of both directions.
    ratio : float
        Of the slope across the brushing over that along it, 1 and above.
    angle : float
        From the texture's U to the brushing [degrees].
    distribution : str
        Of the lobe's slopes, one of DISTRIBUTIONS.
    """

    level: str
    diffuse: Array
    specular: Array
    alpha: float = SHARP
    ratio: float = 1.0
    angle: float = 0.0
    distribution: str = BECKMANN

    @property
    def alphas(self) -> tuple[float, float]:
        """The slopes along and across the brushing."""
        stretch = float(np.sqrt(self.ratio))
        return self.alpha / stretch, self.alpha * stretch

    def as_json(self) -> dict[str, Any]:
        """Return level and parameters as plain values."""
        values: dict[str, Any] = {"level": self.level}
        for name in COLOURED:
            if name in (FREE[self.level] or ("specular",)):  # a perfect mirror's, too, is said
                values[f"rho_{name[0]}"] = getattr(self, name).tolist()
        if "alpha" in FREE[self.level]:
            values["alpha_x"], values["alpha_y"] = self.alphas
            values["distribution"] = self.distribution
        if "angle" in FREE[self.level]:
            values["angle"] = self.angle
        return values


def uncertainty(found: Mapping[str, Any]) -> float:
    """Return the largest relative deviation of what a surface reflects, 0 where none is stated.

    What is faint beside the surface's largest reflectance, and could be nothing at all, counts by what it is beside
    FAINT of that.

    Parameters
    ----------
    found : mapping
        ``rho_d`` and ``rho_s`` (3,) as :meth:`Model.as_json` has them, where the surface has them, and ``deviation``,
        of kinds of parameters to relative deviations (3,).
    """
    spread = found.get("deviation", {})
    values = {kind: np.asarray(found[f"rho_{kind[0]}"]) for kind in COLOURED if f"rho_{kind[0]}" in found}
    least = FAINT * max((value.max() for value in values.values()), default=0.0)
    parts = [
        np.asarray(spread[kind]) * value / np.maximum(value, least) for kind, value in values.items() if kind in spread
    ]
    return max((float(part.max()) for part in parts), default=0.0)


def thresholds(text: str) -> tuple[float, float, float, float]:
    """Return the four thresholds that a text states in per cent, as shares.

    Raises
    ------
    LightsphereError
        If it is not four positive numbers.

    Examples
    --------
    >>> thresholds("5, 50, 1, 5")
    (0.05, 0.5, 0.01, 0.05)
    """
    try:
        simple, mirror, lobes, texture = (float(part) / 100 for part in text.split(","))
    except ValueError:
        raise LightsphereError(f"thresholds is {text!r}; write four numbers [%], such as 5, 50, 1, 5") from None
    if min(simple, mirror, lobes, texture) <= 0:
        raise LightsphereError(f"thresholds is {text!r}; all four must be above 0")
    return simple, mirror, lobes, texture


def known_reflectances(text: str) -> dict[str, Array]:
    """Return the diffuse reflectances that a text states.

    Raises
    ------
    LightsphereError
        If it is not GROUP=R,G,B, or a reflectance is not between 0 and 1.

    Examples
    --------
    >>> known_reflectances("Floor=.2,.3,.4; Wall=.5,.5,.5")["Floor"].tolist()
    [0.2, 0.3, 0.4]
    """
    known = {}
    for part in filter(str.strip, text.split(";")):
        name, _, values = part.rpartition("=")
        try:
            rho = np.array([float(value) for value in values.split(",")])
        except ValueError:
            rho = np.empty(0)
        if not name.strip() or rho.shape != (3,) or not ((rho > 0) & (rho < 1)).all():
            raise LightsphereError(
                f"known is {part.strip()!r}; write GROUP=R,G,B with reflectances between 0 and 1, such as Wall=.5,.5,.5"
            )
        known[name.strip()] = rho
    return known


def grey(value: float = 0.5) -> Model:
    """Return a diffuse grey."""
    return Model("diffuse", np.full(3, value), np.zeros(3))


#: How far each kind of parameter is moved to see what changes, in its own measure (see :func:`moved`).
STEPS = {"diffuse": 0.15, "specular": 0.15, "alpha": 0.15, "ratio": 0.2, "angle": 6.0, POWER: 0.15}


def moved(model: Model, kind: str, by: Array | float) -> Model:
    """Return a model one kind of whose parameters is moved: angles by degrees, all others by factors exp(by)."""
    if kind in COLOURED:
        return dataclasses.replace(model, **{kind: np.clip(getattr(model, kind) * np.exp(by), LEAST, MOST)})
    step = float(np.mean(by))
    if kind == "alpha":
        return dataclasses.replace(model, alpha=float(np.clip(model.alpha * np.exp(step), *ALPHAS)))
    if kind == "angle":
        return dataclasses.replace(model, angle=(model.angle + step) % 180.0)
    ratio = model.ratio * np.exp(step)
    if ratio < 1:  # the brushing is across
        return dataclasses.replace(model, ratio=float(1 / ratio), angle=(model.angle + 90.0) % 180.0)
    return dataclasses.replace(model, ratio=float(min(ratio, RATIOS[1])))
