"""The functions of which a basis BRDF is made here: the Lambertian one and GGX lobes of fixed widths.

A basis is ``B = c_0 / pi + sum_j c_j pi alpha_j D(theta_h; alpha_j) V(cos_i, cos_o; alpha_j)`` with c >= 0, the GGX
distribution D (Walter et al. 2007) and the visibility ``V = G_2 / (4 cos_i cos_o)`` of Smith's model with correlated
heights (Heitz 2014, equation 99). Sums of them come near any isotropic lobe that falls with theta_h, and each is a
closure of Cycles. Not modelled: the Fresnel factor's rise towards grazing light.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...compiled import kernel
from ...reflectance.angles import difference_angles, half_angles

ALPHAS = (0.03, 0.06, 0.12, 0.2, 0.32, 0.5, 0.75)  # widths, roughness squared
COUNT = 1 + len(ALPHAS)
LEAST_FACING = 0.02  # cosine of view and normal; what is steeper is taken for this steep
NODES = (64, 13)  # of the tables given out
AZIMUTHS = 32  # of wi about h that a table's node is the mean of

Functions = Callable[[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]

_ALPHAS = np.array(ALPHAS)


@kernel
def lobes(
    cos_h: float,
    cos_i: float,
    cos_o: float,
    value: NDArray[np.float64],
    by_h: NDArray[np.float64],
    by_i: NDArray[np.float64],
    by_o: NDArray[np.float64],
) -> None:
    """Fill in the functions (J,) [1/sr] at three cosines and their derivatives by each."""
    value[0] = 1.0 / math.pi
    by_h[0] = by_i[0] = by_o[0] = 0.0
    for j in range(_ALPHAS.size):
        square = _ALPHAS[j] ** 2
        rest = 1.0 - square
        width = 1.0 - rest * cos_h * cos_h
        distribution = square * _ALPHAS[j] / (width * width)
        root_i = math.sqrt(square + rest * cos_i * cos_i)
        root_o = math.sqrt(square + rest * cos_o * cos_o)
        visibility = 0.5 / (cos_i * root_o + cos_o * root_i)
        slope = -2.0 * distribution * visibility * visibility
        value[j + 1] = distribution * visibility
        by_h[j + 1] = 4.0 * value[j + 1] / width * rest * cos_h
        by_i[j + 1] = slope * (root_o + cos_o * rest * cos_i / root_i)
        by_o[j + 1] = slope * (root_i + cos_i * rest * cos_o / root_o)


def tables(coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return bases (K, J, S) as bivariate tables (TH, TD, K, S) [1/sr]."""
    return np.ascontiguousarray(np.einsum("hdj,kjs->hdks", at_nodes(evaluated), coefficients))


def at_nodes(functions: Functions) -> NDArray[np.float64]:
    """Return functions of three cosines (N,) -> (N, J) at the nodes of bivariate tables, (TH, TD, J).

    They are the mean over the azimuth of wi about h. Pairs of directions below the surface count as those at
    :data:`LEAST_FACING` above it.
    """
    theta_h, theta_d = half_angles(NODES[0])[:, None, None], difference_angles(NODES[1])[None, :, None]
    phi = 2 * np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
    along, across = np.cos(theta_d) * np.cos(theta_h), np.sin(theta_d) * np.sin(theta_h) * np.cos(phi)
    cosines = np.broadcast_arrays(np.cos(theta_h), along - across, along + across)
    cos_h, cos_i, cos_o = (np.maximum(c, LEAST_FACING).ravel() for c in cosines)
    return np.asarray(functions(cos_h, cos_i, cos_o).reshape(*NODES, AZIMUTHS, -1).mean(axis=2))


def evaluated(
    cos_h: NDArray[np.float64], cos_i: NDArray[np.float64], cos_o: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the functions (N, J) [1/sr] at N triples of cosines."""
    values = np.empty((len(cos_h), COUNT))
    _evaluate(cos_h, cos_i, cos_o, values)
    return values


@kernel
def _evaluate(
    cos_h: NDArray[np.float64],
    cos_i: NDArray[np.float64],
    cos_o: NDArray[np.float64],
    values: NDArray[np.float64],
) -> None:
    by_h, by_i, by_o = np.empty(values.shape[1]), np.empty(values.shape[1]), np.empty(values.shape[1])
    for n in range(cos_h.size):
        lobes(cos_h[n], cos_i[n], cos_o[n], values[n], by_h, by_i, by_o)
