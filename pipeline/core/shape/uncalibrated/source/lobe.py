"""What a normal shows under lights: its Lambertian part, and the simplified lobe of Torrance and Sparrow."""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ....brdf.parametric import STEEPEST, torrance_sparrow
from ....compiled import kernel, parallel_kernel
from ..lobes import at_nodes

Array = NDArray[np.float64]


@kernel
def facing(normal: Array, view: Array, light: Array) -> tuple[float, float, float]:
    """Return n . d, the squared half angle [rad^2] and n . v of unit vectors (3,)."""
    half, cos_i, cos_o, cos_h = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        half += (light[i] + view[i]) ** 2
        cos_i += normal[i] * light[i]
        cos_o += normal[i] * view[i]
    cos_h = min((cos_i + cos_o) / math.sqrt(max(half, 1e-12)), 1.0)
    return cos_i, math.acos(max(cos_h, -1.0)) ** 2, cos_o


@kernel
def glow(cos_i: float, square: float, cos_o: float, width: float) -> float:
    """Return the lobe times the cosine of the light, of what :func:`facing` returns and the width sigma [rad]."""
    if cos_i <= 0.0:
        return 0.0
    oblique = 4.0 * max(cos_i, STEEPEST) * max(cos_o, STEEPEST)
    return float(cos_i * math.exp(-0.5 * square / (width * width)) / oblique)


@parallel_kernel
def parts(normals: Array, views: Array, lights: Array, widths: Array, matt: Array, gloss: Array) -> None:
    """Fill in what an albedo of one and weights of one show of lights of strength one.

    Parameters
    ----------
    normals, views, lights : (P, 3), (P, 3), (L, 3)
        Unit.
    widths : (K,)
        [rad].
    matt, gloss : (P, L), (P, L, K)
    """
    for p in prange(len(normals)):
        for k in range(len(lights)):
            cos_i, square, cos_o = facing(normals[p], views[p], lights[k])
            matt[p, k] = max(cos_i, 0.0)
            for n in range(widths.size):
                gloss[p, k, n] = glow(cos_i, square, cos_o, widths[n])


def tables(widths: Array) -> Array:
    """Return the Lambertian basis and one for every lobe of a width (K,) as bivariate tables (TH, TD, 1 + K, 1)."""

    def functions(cos_h: Array, cos_i: Array, cos_o: Array) -> Array:
        theta_h = np.arccos(np.minimum(cos_h, 1.0))
        lobes = [torrance_sparrow(theta_h, cos_i, cos_o, width) for width in widths]
        return np.stack([np.full(len(cos_h), 1.0 / np.pi), *lobes], axis=1)

    return np.ascontiguousarray(at_nodes(functions)[..., None])
