"""The BRDFs and directions that the tests of this folder share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.core.brdf import Brdf
from pipeline.core.brdf.parametric import TorranceSparrow, Ward
from pipeline.core.brdf.tabulated import Tabulated
from tests import oracles

RED, GREY = np.array([0.5, 0.2, 0.1]), np.full(3, 0.3)
ISOTROPIC = Ward(RED, GREY, 0.2, 0.2)
BRUSHED = Ward(RED, GREY, 0.1, 0.3)
LOBE = TorranceSparrow(RED, 0.2 * GREY, 0.15)
UP = np.array([[0.0, 0.0, 1.0]])


def random_directions(count: int, seed: int) -> NDArray[np.float64]:
    w = np.random.default_rng(seed).normal(size=(count, 3))
    w[:, 2] = np.abs(w[:, 2]) + 0.1
    return oracles.unit(w)


def random_table(phi: int, seed: int = 5) -> Tabulated:
    rng = np.random.default_rng(seed)
    nodes = (np.arange(9) + 0.5) / 9 * np.pi / 2
    phi_d = (np.arange(phi) + 0.5) / phi * np.pi
    return Tabulated(rng.uniform(0.1, 1, (9, 9, phi, 3)), nodes, nodes, phi_d)


def reciprocal(brdf: Brdf) -> bool:
    wi, wo = random_directions(300, 1), random_directions(300, 2)
    return np.allclose(brdf.evaluate(wi, wo), brdf.evaluate(wo, wi), rtol=1e-9)


def turned_alike(brdf: Brdf) -> bool:
    """Whether turning both directions about the normal changes nothing."""
    wi, wo = random_directions(300, 3), random_directions(300, 4)
    turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    return np.allclose(brdf.evaluate(wi, wo), brdf.evaluate(wi @ turn.T, wo @ turn.T), rtol=1e-8)
