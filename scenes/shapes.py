"""Shapes drawn at random for datasets: closed surfaces about the origin, of no size of their own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .surfaces import Mesh, closed_grid

ROWS, COLUMNS = 128, 192
WAVES, FINEST = 24, 5.0  # of a blob's function, and how many fit the unit ball's radius at most
RINGS = 9  # knots of a vase's profile


def blob(detail: float, random: np.random.Generator) -> Mesh:
    """Return a ball whose radius is multiplied by the exponential of a smooth random function of direction."""
    polar, around = _angles()
    direction = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
    total = np.zeros(polar.shape)
    for _ in range(WAVES):
        axis = random.random(3) * 2 - 1
        frequency, phase = 1 + (FINEST - 1) * random.random(), 2 * np.pi * random.random()
        total += np.sin(direction @ (frequency * axis / max(np.linalg.norm(axis), 1e-3)) + phase) / frequency
    return closed_grid(direction * np.exp(0.5 * detail * total)[..., None])


def vase(detail: float, random: np.random.Generator) -> Mesh:
    """Return a body turned about z from a random profile."""
    polar, around = _angles()
    knots = 1 + 1.6 * detail * (random.random(RINGS) - 0.5)
    place = polar[:, 0] / np.pi * (RINGS - 1)
    below = np.minimum(place.astype(int), RINGS - 2)
    beyond = place - below
    beyond = beyond * beyond * (3 - 2 * beyond)  # smooth at the knots
    width = knots[below] * (1 - beyond) + knots[below + 1] * beyond
    tall = 0.8 + 0.8 * random.random()
    radius = 0.6 * np.sin(polar) ** 0.6 * width[:, None]  # fuller than a ball's
    return closed_grid(np.stack([radius * np.cos(around), radius * np.sin(around), tall * np.cos(polar)], axis=-1))


def superquadric(detail: float, random: np.random.Generator) -> Mesh:
    """Return a superquadric, from a box with rounded edges to a spindle, as far from a ball as ``detail`` says.

    Source: Barr, "Superquadrics and angle-preserving transformations", 1981.
    """
    polar, around = _angles()
    tall, wide = (1 + 1.5 * detail * (random.random() - 0.5) for _ in range(2))
    horizontal = _power(np.sin(polar), tall)
    round_about = [horizontal * _power(np.cos(around), wide), horizontal * _power(np.sin(around), wide)]
    x, y, z = ((1 - 0.6 * detail * random.random()) * part for part in (*round_about, _power(np.cos(polar), tall)))
    turn = 2 * np.pi * random.random()
    return closed_grid(np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z], axis=-1))


SHAPES: dict[str, Callable[[float, np.random.Generator], Mesh]] = {
    "blob": blob,
    "vase": vase,
    "superquadric": superquadric,
}


def _angles() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return polar angle and azimuth of a grid, the poles in its first and last row."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, ROWS), 2 * np.pi * np.arange(COLUMNS) / COLUMNS, indexing="ij")
    return polar, around


def _power(values: NDArray[np.float64], exponent: float) -> NDArray[np.float64]:
    return np.asarray(np.sign(values) * np.abs(values) ** exponent)
