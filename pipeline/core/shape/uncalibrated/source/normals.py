"""Normals by a search of each pixel by itself: from where it is, in ever smaller steps, whatever lowers the sum."""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ....compiled import kernel, parallel_kernel
from ..equations import frame, squared_width
from .lobe import facing, glow

Array = NDArray[np.float64]

RING = 8  # directions tried about a normal
MOVES = 4  # of one size, at most
LEAST_FACING = 0.05  # cosine of view and normal
CURVED = 0.03  # angle [rad] over which the cost's curvature is taken


@kernel
def _cost(
    normal: Array, view: Array, lights: Array, strengths: Array, values: Array, lit: Array, usual: float, noise: float,
    sure: Array, weights: Array, tints: Array, widths: Array, pull: Array, albedo: Array, matt: Array, rest: Array,
) -> float:  # fmt: skip
    """Return a pixel's share of the sum at a normal, the albedo (3,) being the best there, which is filled in."""
    above, below = np.zeros(3), 1e-12
    for k in range(len(lights)):
        if lit[k] <= 0.0:
            continue
        cos_i, square, cos_o = facing(normal, view, lights[k])
        matt[k] = strengths[k] * max(cos_i, 0.0)
        for c in range(3):
            rest[k, c] = values[k, c]
        if cos_i > 0.0:
            for n in range(widths.size):
                if weights[n] > 0.0:
                    shine = strengths[k] * weights[n] * glow(cos_i, square, cos_o, widths[n])
                    for c in range(3):
                        rest[k, c] -= tints[n, c] * shine
        below += sure[k] * matt[k] ** 2
        for c in range(3):
            above[c] += sure[k] * matt[k] * rest[k, c]
    for c in range(3):
        albedo[c] = max(above[c] / below, 0.0)
    cost = -2.0 * (normal[0] * pull[0] + normal[1] * pull[1] + normal[2] * pull[2])
    for k in range(len(lights)):
        if lit[k] > 0.0:
            miss = 0.0
            for c in range(3):
                miss += (rest[k, c] - albedo[c] * matt[k]) ** 2 / 3.0
            size = max((values[k, 0] + values[k, 1] + values[k, 2]) / 3.0, usual)
            cost += lit[k] * math.log(1.0 + miss / squared_width(size, noise))
    return float(cost)


@kernel
def _turned(normal: Array, tangents: Array, angle: float, number: int, there: Array) -> None:
    """Fill in the normal turned by an angle in one of the ring's directions."""
    along = 2.0 * math.pi * number / RING
    for i in range(3):
        aside = math.cos(along) * tangents[0, i] + math.sin(along) * tangents[1, i]
        there[i] = math.cos(angle) * normal[i] + math.sin(angle) * aside


@parallel_kernel
def search(
    views: Array, lights: Array, strengths: Array, values: Array, lit: Array, usual: Array, noise: float, sure: Array,
    weights: Array, tints: Array, widths: Array, pulls: Array, angle: float, normals: Array, albedo: Array,
) -> None:  # fmt: skip
    """Turn normals (P, 3) by an angle [rad] as long as that lowers the sum, in place, the albedo (P, 3) following.

    Parameters
    ----------
    views, lights, strengths : (P, 3), (L, 3), (L,)
    values, lit, usual, noise : (P, L, 3), (P, L), (P,), float
    sure : (P, L)
        Weights of the values in the albedo's least squares.
    weights, tints, widths : (P, K), (K, 3), (K,)
    pulls : (P, 3)
        What is known of a normal otherwise adds -2 n . pull.
    """
    for p in prange(len(views)):
        tangents, there, best, shade = np.empty((2, 3)), np.empty(3), normals[p].copy(), np.empty(3)
        matt, rest = np.empty(len(lights)), np.empty((len(lights), 3))
        own = albedo[p].copy()
        least = _cost(
            best, views[p], lights, strengths, values[p], lit[p], usual[p], noise, sure[p], weights[p], tints, widths,
            pulls[p], own, matt, rest,
        )  # fmt: skip
        for _ in range(MOVES):
            before = least
            frame(normals[p], tangents)
            for number in range(RING):
                _turned(normals[p], tangents, angle, number, there)
                if there[0] * views[p, 0] + there[1] * views[p, 1] + there[2] * views[p, 2] < LEAST_FACING:
                    continue
                cost = _cost(
                    there, views[p], lights, strengths, values[p], lit[p], usual[p], noise, sure[p], weights[p], tints,
                    widths, pulls[p], shade, matt, rest,
                )  # fmt: skip
                if cost < least:
                    least = cost
                    best[:], own[:] = there, shade
            if least == before:
                break
            normals[p] = best
        albedo[p] = own


@parallel_kernel
def stiffnesses(
    views: Array, lights: Array, strengths: Array, values: Array, lit: Array, usual: Array, noise: float, sure: Array,
    weights: Array, tints: Array, widths: Array, pulls: Array, normals: Array, stiffness: Array,
) -> None:  # fmt: skip
    """Fill in the least curvature (P,) [1 / rad^2] of the sum about normals, of what :func:`search` takes."""
    for p in prange(len(views)):
        tangents, there, shade = np.empty((2, 3)), np.empty(3), np.empty(3)
        matt, rest, ring = np.empty(len(lights)), np.empty((len(lights), 3)), np.empty(RING)
        frame(normals[p], tangents)
        for number in range(RING):
            _turned(normals[p], tangents, CURVED, number, there)
            ring[number] = _cost(
                there, views[p], lights, strengths, values[p], lit[p], usual[p], noise, sure[p], weights[p], tints,
                widths, pulls[p], shade, matt, rest,
            )  # fmt: skip
        here = _cost(
            normals[p], views[p], lights, strengths, values[p], lit[p], usual[p], noise, sure[p], weights[p], tints,
            widths, pulls[p], shade, matt, rest,
        )  # fmt: skip
        least = np.inf
        for number in range(RING // 2):
            least = min(least, (ring[number] + ring[number + RING // 2] - 2.0 * here) / CURVED**2)
        stiffness[p] = max(least, 0.0)
