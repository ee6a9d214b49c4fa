"""The unknowns of the alternation, and the one sum that all of its steps lower."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..equations import squared_width
from ..pictures import Pictures
from .lobe import parts
from .surface import Surface

Array = NDArray[np.float64]

SURFACE = 20.0  # what a squared difference [rad^2] of a normal from the surface's counts, beside a value's cost
HIGHLIGHT = 5.0  # the same, of a highlight's normal from the half angle
UNSEEN = 1e-5  # the same, of the squared highlight of a pixel over its usual value: what no light shows is nothing
TINY = 1e-12


@dataclass
class State:
    """What is sought of P pixels under L lights, with K materials.

    Parameters
    ----------
    pictures : Pictures
    surface : Surface
    highlights : (P, L) float64
        How far a value is one, 0 to 1.
    scatter : float
        Standard deviation of the lights' strengths, as far as it is known.
    held : (L,) bool
        Which lights' directions are known.
    normals, albedo, unknown : (P, 3), (P, 3), (P,)
        The surface's unknowns are those of :mod:`.surface`.
    directions, strengths : (L, 3), (L,)
    weights, tints, widths : (P, K), (K, 3), (K,)
    course : list of (str, float)
        The sum after every step.
    """

    pictures: Pictures
    surface: Surface
    highlights: Array
    scatter: float
    held: NDArray[np.bool_]
    normals: Array
    albedo: Array
    unknown: Array
    directions: Array
    strengths: Array
    weights: Array
    tints: Array
    widths: Array
    course: list[tuple[str, float]] = field(default_factory=list)

    @property
    def pulls(self) -> Array:
        """What is known of normals beside the values, (P, 3): the sum changes as -2 n . pull."""
        bright = HIGHLIGHT * np.einsum("pl,pli->pi", self.highlights, self.halves())
        return np.asarray(SURFACE * self.surface.pulls(self.unknown) + bright)

    def parts(self) -> tuple[Array, Array]:
        """Return what an albedo of one and weights of one show (P, L), (P, L, K)."""
        matt = np.empty((len(self.normals), len(self.directions)))
        gloss = np.empty((*matt.shape, len(self.widths)))
        parts(self.normals, self.pictures.views, np.ascontiguousarray(self.directions), self.widths, matt, gloss)
        return matt * self.strengths, gloss * self.strengths[:, None]

    def shown(self, matt: Array, gloss: Array) -> Array:
        """Return what the pixels show (P, L, 3)."""
        tinted = np.einsum("plk,pk,kc->plc", gloss, self.weights, self.tints, optimize=True)
        return np.asarray(matt[..., None] * self.albedo[:, None] + tinted)

    def squared_widths(self) -> Array:
        """Return the squared misfit (P, L) at which a value counts half."""
        return np.asarray(
            squared_width(np.maximum(self.pictures.gray, self.pictures.usual[:, None]), self.pictures.noise)
        )

    def misses(self, shown: Array) -> Array:
        """Return the mean squared misfit (P, L)."""
        return np.asarray(((self.pictures.values - shown) ** 2).mean(axis=2))

    def certainty(self) -> Array:
        """Return the weights (P, L) under which the squared misfits fall as Cauchy's cost does, or less."""
        return np.asarray(self.pictures.lit / (3.0 * (self.squared_widths() + self.misses(self.shown(*self.parts())))))

    def value_costs(self) -> Array:
        """Return Cauchy's cost of every value's misfit (P, L)."""
        return np.asarray(self.pictures.lit * np.log1p(self.misses(self.shown(*self.parts())) / self.squared_widths()))

    def light_costs(self) -> Array:
        """Return the share of the sum (L,) that each light has."""
        bright = HIGHLIGHT * self.highlights * ((self.normals[:, None] - self.halves()) ** 2).sum(axis=2)
        return np.asarray((self.value_costs() + bright).sum(axis=0) + (np.log(self.strengths) / self.scatter) ** 2)

    def cost(self) -> float:
        """Return the sum."""
        lobes = float((self.unseen() * self.weights**2 * (self.tints**2).sum(axis=1)).sum())
        return float(self.light_costs().sum() + SURFACE * self.surface.cost(self.unknown, self.normals) + lobes)

    def unseen(self) -> Array:
        """Return what a squared lobe, weight times tint, adds to the sum (P, 1)."""
        level = np.exp(2.0 * np.log(self.strengths).mean())
        return np.asarray(UNSEEN / 3.0 * level / self.pictures.usual[:, None] ** 2)

    def given(self) -> tuple[Any, ...]:
        """Return what the kernels of :mod:`.normals` take beside the normals."""
        p = self.pictures
        return (
            p.views, np.ascontiguousarray(self.directions), self.strengths, p.values, p.lit, p.usual, p.noise,
            self.certainty(), self.weights, self.tints, self.widths, self.pulls,
        )  # fmt: skip

    def noted(self, step: str) -> None:
        """Write down the sum after a step."""
        self.course.append((step, self.cost()))

    def levelled(self) -> None:
        """Fix the scales that pictures leave open: strengths' geometric mean and the materials' mean weight are 1."""
        mean = np.maximum(self.weights.mean(axis=0), TINY)
        self.weights, self.tints = self.weights / mean, self.tints * mean[:, None]
        level = float(np.exp(np.log(self.strengths).mean()))
        self.strengths, self.albedo, self.tints = self.strengths / level, self.albedo * level, self.tints * level

    def halves(self) -> Array:
        """Return the unit directions (P, L, 3) half-way between lights and view."""
        half = self.directions + self.pictures.views[:, None]
        return np.asarray(half / np.maximum(np.linalg.norm(half, axis=2, keepdims=True), TINY))
