"""The numbers of a light: three of a distant one, four of a near one.

A light's first three numbers m are the light that reaches the object's centre: its direction times its irradiance
there. A near light's fourth is q, one over its distance from the centre, so that q = 0 is a distant light. With
s = |m|, d = m / s and a place at the offset x from the centre, ::

    u = d - q x,   light at x = s u / |u|^3

which is the inverse square law of a point at d / q.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...compiled import kernel

Array = NDArray[np.float64]

NEAREST = 0.8  # how far surface points reach towards a light, over its distance, at most
FARTHEST = 1e-3  # reach of the surface over a light's distance, at least; a light that far is a distant one


@kernel
def arriving(light: Array, offset: Array, here: Array, slopes: Array) -> None:
    """Fill in the light (3,) that reaches a place, and its derivatives (N, 3) by the light's N numbers.

    Parameters
    ----------
    light : (N,)
        Three numbers or four.
    offset : (3,)
        Of the place from the centre.
    """
    if light.size == 3:
        for i in range(3):
            here[i] = light[i]
            for j in range(3):
                slopes[i, j] = 1.0 if i == j else 0.0
        return
    strength = math.sqrt(light[0] ** 2 + light[1] ** 2 + light[2] ** 2)
    q, square, across, along = light[3], 0.0, 0.0, 0.0
    for i in range(3):
        here[i] = light[i] / strength - q * offset[i]
        square += here[i] ** 2
    cube = square * math.sqrt(square)
    for i in range(3):
        across += offset[i] * here[i]
        along += light[i] / strength * here[i]
    # the derivative of u / |u|^3 by u is G = (1 - 3 u u^T / |u|^2) / |u|^3, symmetric
    for j in range(3):
        direction_there = light[j] / strength - 3.0 * along * here[j] / square  # of d, by G |u|^3
        for i in range(3):
            direction = light[i] / strength
            own = (1.0 if i == j else 0.0) - 3.0 * here[i] * here[j] / square
            slopes[i, j] = (direction * here[j] + own - direction * direction_there) / cube
        slopes[3, j] = -strength * (offset[j] - 3.0 * across * here[j] / square) / cube
    for i in range(3):
        here[i] *= strength / cube


def held_apart(lights: Array, offsets: Array) -> Array:
    """Return the lights (L, N), near ones kept beyond the object's points, as their directions go, and not too far.

    Parameters
    ----------
    lights : (L, N)
    offsets : (P, 3)
        Of the surface.
    """
    if lights.shape[1] == 3:
        return lights
    reach = np.sqrt((offsets**2).sum(axis=1).max())
    beyond = (offsets @ directions(lights).T).max(axis=0)
    q = np.clip(lights[:, 3], FARTHEST / reach, NEAREST / np.maximum(beyond, 1e-3 * reach))
    return np.hstack([lights[:, :3], q[:, None]])


def directions(lights: Array) -> Array:
    """Return the unit directions (L, 3) of lights as the centre sees them."""
    return np.asarray(lights[:, :3] / np.linalg.norm(lights[:, :3], axis=1, keepdims=True))


def places(lights: Array) -> Array:
    """Return unit directions (L, 3) of distant lights, places (L, 3) from the centre of near ones."""
    return np.ascontiguousarray(directions(lights) / lights[:, 3:] if lights.shape[1] > 3 else directions(lights))
