"""What a solver of unknown lights gives back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .joint import Joint

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Found:
    """Lights, and normals and reflectance of P pixels, in the unit of their pictures.

    Parameters
    ----------
    end : Joint, optional
        The solution of the coarse pictures, where another can begin from it.
    lights : (L, N) float64
        As in :mod:`.lamps`.
    centre, offsets : (3,), (P, 3) float64
        Of the surface to which near lights' places refer.
    normals, weights : (P, 3), (P, K, M) float64
    table : (TH, TD, K, S) float64
        Bases: what lights of strength one show, over the cosine.
    misfit : (P,) float64
        Mean over the lit values of Cauchy's cost.
    normal_deviation : (P,) float64
        [rad].
    deviations : ((L,), (L,)) float64
        Of the lights' directions [degrees], and of their distances as a share; infinite of distant lights.
    doubts : tuple of str
        What the photographs leave open.
    notes : dict
        Cost of every end, and the course of the best one's.
    """

    end: Joint | None
    lights: Array
    centre: Array
    offsets: Array
    normals: Array
    weights: Array
    table: Array
    misfit: Array
    normal_deviation: Array
    deviations: tuple[Array, Array]
    doubts: tuple[str, ...]
    notes: dict[str, Any]
