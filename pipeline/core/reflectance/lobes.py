"""The two lobes of a first reflectance, compiled: per-pixel sums over the lights, and predictions.

Everywhere ``y = L d^2 / I`` is the apparent BRDF of one light, modelled as ``albedo c + specular g + edge e``::

    c = max(0, n.wi) / pi                       Diffuse BSDF, roughness 0, times n.wi
    g = D(h; alpha) G(wi, wo) / (4 n.wo)        Glossy BSDF, GGX, times n.wi
    e = g (1 - h.wo)^5                          Metallic BSDF, GGX, of a black base colour, times n.wi

``specular + edge (1 - h.wo)^5`` is Schlick's Fresnel factor (1994) when ``edge = 1 - specular``. D after
Trowbridge and Reitz 1975, G = 1 / (1 + Lambda_i + Lambda_o) after Heitz 2014, equation 99, as in Cycles.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ..compiled import kernel, parallel_kernel

SMALLEST_COSINE = 0.02  # light and view flatter than 88.9 degrees tell of the normal's error, not of the material
SHADOW = (0.05, 0.2)  # share of the usual diffuse response from which a value begins to count, and counts fully


@kernel
def lobe_columns(normal: Any, view: Any, light: Any, alpha: Any) -> Any:
    """Return the columns c, g, e for unit vectors; zeros where light or view is below the horizon."""
    cos_i = normal[0] * light[0] + normal[1] * light[1] + normal[2] * light[2]
    cos_o = normal[0] * view[0] + normal[1] * view[1] + normal[2] * view[2]
    if cos_i <= 0.0 or cos_o <= 0.0:
        return 0.0, 0.0, 0.0
    hx, hy, hz = light[0] + view[0], light[1] + view[1], light[2] + view[2]
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    cos_d = (view[0] * hx + view[1] * hy + view[2] * hz) / length
    cos_h = (normal[0] * hx + normal[1] * hy + normal[2] * hz) / length
    a2 = alpha * alpha
    spread = cos_h * cos_h * (a2 - 1.0) + 1.0
    d = a2 / (math.pi * spread * spread)
    masking = 1.0 + _lambda(cos_i, a2) + _lambda(cos_o, a2)
    glossy = d / (4.0 * cos_o * masking)
    return cos_i / math.pi, glossy, glossy * (1.0 - cos_d) ** 5


@kernel
def _lambda(cosine: Any, a2: Any) -> Any:
    tan2 = (1.0 - cosine * cosine) / (cosine * cosine)
    return 0.5 * (math.sqrt(1.0 + a2 * max(tan2, 0.0)) - 1.0)


@kernel
def _towards(point: Any, light: Any, direction: Any) -> Any:
    """Write the unit direction from a point to a light; return the squared distance."""
    d2 = 0.0
    for i in range(3):
        direction[i] = light[i] - point[i]
        d2 += direction[i] * direction[i]
    for i in range(3):
        direction[i] /= math.sqrt(d2)
    return d2


@kernel
def _ramp(value: Any, low: Any, high: Any) -> Any:
    t = min(max((value - low) / (high - low), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@parallel_kernel
def visibility(points: Any, normals: Any, lights: Any, values: Any, y: Any, weight: Any) -> None:
    """Turn pictures into apparent BRDFs and say how far each value is lit and usable.

    Parameters
    ----------
    points, normals : (P, 3) float64
        World space.
    lights : (L, 3) float64
        Positions.
    values : (P, L, 3) float32
        Radiance over the light's intensity; NaN where saturated or bad.
    y : (P, L, 3) float32, written
    weight : (P, L) float32, written
        0 in attached and cast shadow and where a value is bad, 1 where lit. A cast shadow is seen by its
        value: a small share of the pixel's median response over the cosine. Indirect light that fills shadows
        to more than that share is taken as light.
    """
    for p in prange(points.shape[0]):
        direction = np.empty(3)
        ratio = np.zeros(lights.shape[0])
        lit = 0
        ratios = np.empty(lights.shape[0])
        for k in range(lights.shape[0]):
            d2 = _towards(points[p], lights[k], direction)
            cosine = 0.0
            for i in range(3):
                cosine += normals[p, i] * direction[i]
                y[p, k, i] = values[p, k, i] * d2
            gray = (y[p, k, 0] + y[p, k, 1] + y[p, k, 2]) / 3.0
            if cosine > SMALLEST_COSINE and gray > 0.0:  # false for NaN
                ratio[k] = gray / cosine
                ratios[lit] = ratio[k]
                lit += 1
        usual = np.median(ratios[:lit]) if lit > 0 else 1.0
        for k in range(lights.shape[0]):
            weight[p, k] = _ramp(ratio[k] / usual, SHADOW[0], SHADOW[1])


@parallel_kernel
def sums(points: Any, normals: Any, views: Any, lights: Any, y: Any, weight: Any, alphas: Any, out: Any) -> None:
    """Add up the normal equations of every pixel for several roughnesses.

    Parameters
    ----------
    y, weight
        Of :func:`visibility`; the weight is divided by ``gray y + its mean`` here, so that squares of
        differences weigh about as differences of square roots: a highlight does not drown the rest.
    alphas : (P, A) float64
        The roughnesses squared to try at each pixel.
    out : (P, A, 18) float64, written
        ``cc, cg, gg, ce, ge, ee``, then ``cy, gy, ey, yy`` per colour.
    """
    for p in prange(points.shape[0]):
        direction = np.empty(3)
        mean = 0.0
        total = 1e-30
        for k in range(lights.shape[0]):
            if weight[p, k] > 0.0:
                mean += weight[p, k] * (y[p, k, 0] + y[p, k, 1] + y[p, k, 2]) / 3.0
                total += weight[p, k]
        mean = mean / total + 1e-30
        out[p] = 0.0
        for k in range(lights.shape[0]):
            if weight[p, k] <= 0.0:
                continue
            _towards(points[p], lights[k], direction)
            w = weight[p, k] * mean / ((y[p, k, 0] + y[p, k, 1] + y[p, k, 2]) / 3.0 + mean)
            for a in range(alphas.shape[1]):
                c, g, e = lobe_columns(normals[p], views[p], direction, alphas[p, a])
                out[p, a, 0] += w * c * c
                out[p, a, 1] += w * c * g
                out[p, a, 2] += w * g * g
                out[p, a, 3] += w * c * e
                out[p, a, 4] += w * g * e
                out[p, a, 5] += w * e * e
                for i in range(3):
                    value = w * y[p, k, i]
                    out[p, a, 6 + 4 * i] += c * value
                    out[p, a, 7 + 4 * i] += g * value
                    out[p, a, 8 + 4 * i] += e * value
                    out[p, a, 9 + 4 * i] += y[p, k, i] * value


@parallel_kernel
def held_out_squares(
    points: Any, normals: Any, views: Any, lights: Any, y: Any, weight: Any, maps: Any, out: Any
) -> None:
    """Add up the squared error of the prediction and the squared value over lights.

    Parameters
    ----------
    maps : (P, 8) float64
        Albedo, specular, edge and alpha of every pixel.
    out : (P, 2) float64, written
        Sum of (prediction - y)^2 and of y^2 over lit values and colours.
    """
    for p in prange(points.shape[0]):
        direction = np.empty(3)
        out[p] = 0.0
        for k in range(lights.shape[0]):
            if weight[p, k] <= 0.0:
                continue
            _towards(points[p], lights[k], direction)
            c, g, e = lobe_columns(normals[p], views[p], direction, maps[p, 7])
            for i in range(3):
                miss = maps[p, i] * c + maps[p, 3 + i] * g + maps[p, 6] * e - y[p, k, i]
                out[p, 0] += weight[p, k] * miss * miss
                out[p, 1] += weight[p, k] * y[p, k, i] * y[p, k, i]


def without_edge(equations: NDArray[np.float64], edge: Any) -> NDArray[np.float64]:
    """Take a known edge strength out of the sums of :func:`sums`.

    Parameters
    ----------
    equations : (P, 18) float64
    edge : float or (P,) float64

    Returns
    -------
    (P, 12) float64
        ``cc, cg, gg``, then ``cy, gy, yy`` per colour, of ``y - edge e``.
    """
    edge = np.broadcast_to(edge, len(equations))[:, None]
    ce, ge, ee = (equations[:, i, None] for i in (3, 4, 5))
    cy, gy, ey, yy = (equations[:, i::4] for i in (6, 7, 8, 9))
    left = np.stack([cy - edge * ce, gy - edge * ge, yy - 2 * edge * ey + edge**2 * ee], axis=-1)
    return np.concatenate([equations[:, :3], left.reshape(len(equations), 9)], axis=1)


def non_negative(equations: NDArray[np.float64], prior: NDArray[np.float64], pull: Any) -> NDArray[np.float64]:
    """Solve the two-column least squares of every pixel and colour with both coefficients non-negative.

    Parameters
    ----------
    equations : (P, 12) float64
        Of :func:`without_edge`.
    prior : (3,) or (P, 3) float64
        Specular colour towards which pixels that saw no highlight are drawn.
    pull : float or (P,) float64
        Weight of the prior, in the unit of ``gg``.

    Returns
    -------
    (P, 3, 2) float64
        Diffuse and specular coefficient per colour: of the four active sets the feasible one with the least cost.
    """
    cc, cg = equations[:, 0, None], equations[:, 1, None]
    pull = np.broadcast_to(pull, len(equations))[:, None]
    gg = equations[:, 2, None] + pull
    cy = equations[:, 3::3]
    gy = equations[:, 4::3] + pull * prior
    tiny = 1e-30
    determinant = np.maximum(cc * gg - cg * cg, tiny)
    both = np.stack([(gg * cy - cg * gy) / determinant, (cc * gy - cg * cy) / determinant], axis=-1)
    zero = np.zeros_like(cy)
    diffuse_only = np.stack([np.maximum(cy / np.maximum(cc, tiny), 0), zero], axis=-1)
    specular_only = np.stack([zero, np.maximum(gy / np.maximum(gg, tiny), 0)], axis=-1)
    gain_diffuse = diffuse_only[..., 0] * cy
    gain_specular = specular_only[..., 1] * gy
    single = np.where((gain_diffuse >= gain_specular)[..., None], diffuse_only, specular_only)
    feasible = (both >= 0).all(-1, keepdims=True) & (cc * gg - cg * cg > 1e-9 * cc * gg)[..., None]
    return np.asarray(np.where(feasible, both, single))


def cost(equations: NDArray[np.float64], solution: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sum of squares left by a solution, over the colours, (P,)."""
    a, s = solution[..., 0], solution[..., 1]
    cc, cg, gg = (equations[:, i, None] for i in range(3))
    cy, gy, yy = equations[:, 3::3], equations[:, 4::3], equations[:, 5::3]
    left = yy - 2 * (a * cy + s * gy) + a * a * cc + 2 * a * s * cg + s * s * gg
    return np.asarray(np.maximum(left, 0.0).sum(axis=-1))
