"""Highlights of a mirror's to chalk's roughness, as Cycles renders them.

Why: Cycles computes in single precision, where the half vector of a mirror's highlight has few digits left.
Must: Cycles' picture of a ball under single suns is the closed form that all solvers reckon with.
"""

from __future__ import annotations

import numpy as np

from pipeline.blender.round_trip import round_trip
from pipeline.core.material import STOPS, Mixture
from pipeline.core.material.closures import LEAST_ROUGHNESS, Lobe
from pipeline.core.material.surface import White
from pipeline.core.progress import finish
from tests.hard_cases.catalogue import Outcome

ALPHAS = (LEAST_ROUGHNESS**2, 0.01, 0.1, 0.5, 1.0)
MOST = 0.005


def run() -> list[Outcome]:
    found = []
    for alpha in ALPHAS:
        lobe = Lobe("ggx", float(np.sqrt(alpha)))
        curves = np.ones((1, 2, len(STOPS), 3)) * np.array([0.0, 1.0]).reshape(1, 2, 1, 1)
        turn = finish(round_trip(Mixture((Lobe("diffuse"), lobe), curves), [White(lobe)]))
        error = float(turn.against_table[0])
        found.append(Outcome(f"ggx, alpha {alpha:.2g}", error, MOST, "picture against closed form", "agrees"))
    return found
