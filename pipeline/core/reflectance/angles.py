"""The axes of a bivariate table f(theta_h, theta_d) and how it is read between its nodes.

With h the unit vector half way between wi and wo, theta_h is the angle from the normal to h and theta_d the one from
wi to h (Rusinkiewicz 1998). Nodes lie at ::

    theta_h:  1 - cos(theta_h) = (i / (TH - 1))^4,  i = 0 .. TH - 1     dense where highlights are
    theta_d:  theta_d = j / (TD - 1) pi / 2,        j = 0 .. TD - 1     one node: no dependence

and the table is linear between them in both coordinates.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..compiled import kernel


@kernel
def half_coordinate(cosine: float) -> float:
    """Return the coordinate 0 .. 1 of the half angle with the given cosine."""
    return math.sqrt(math.sqrt(max(1.0 - cosine, 0.0)))


@kernel
def difference_coordinate(towards: float) -> float:
    """Return the coordinate 0 .. 1 of the difference angle from wi.wo: cos(theta_d)^2 = (1 + wi.wo) / 2."""
    return math.acos(min(math.sqrt(max(0.5 + 0.5 * towards, 0.0)), 1.0)) / (0.5 * math.pi)


@kernel
def cell(coordinate: float, nodes: int) -> tuple[int, float]:
    """Return the node below a coordinate 0 .. 1 and how far the next one is approached, 0 .. 1."""
    if nodes == 1:
        return 0, 0.0
    place = min(max(coordinate, 0.0), 1.0) * (nodes - 1)
    below = min(int(place), nodes - 2)
    return below, place - below


def half_angles(nodes: int) -> NDArray[np.float64]:
    """Return theta_h of the nodes [rad]."""
    return np.asarray(np.arccos(1.0 - np.linspace(0.0, 1.0, nodes) ** 4))


def difference_angles(nodes: int) -> NDArray[np.float64]:
    """Return theta_d of the nodes [rad]."""
    return np.linspace(0.0, np.pi / 2, nodes) if nodes > 1 else np.zeros(1)
