"""Roughness from a mirror's to chalk's, at grazing light and view.

Why: the lobe's peak is 1 / (pi alpha^2), 300,000 for alpha = .001, and its masking is a quotient of vanishing cosines.
Must: every closure is finite and not negative to the horizon, reciprocal, and returns no more light than it receives.
"""

from __future__ import annotations

import numpy as np

from pipeline.core.material.closures import Lobe
from pipeline.core.material.energy import directional_albedo
from tests.hard_cases.catalogue import Outcome

ALPHAS = (1e-3, 1e-2, 0.1, 0.5, 1.0)
COSINES = np.array([1e-8, 1e-4, 1e-2, 0.5, 1.0])
INTEGRAL = 0.01  # a quadrature of few thousand directions on a peak


def run() -> list[Outcome]:
    found = []
    for kind in ("ggx", "beckmann"):
        for alpha in ALPHAS:
            lobe = Lobe(kind, float(np.sqrt(alpha)))
            lo, lv, turn = (part.ravel() for part in np.meshgrid(COSINES, COSINES, np.linspace(0, np.pi, 7)))
            wi = np.stack([np.sqrt(1 - lo**2), 0 * lo, lo], axis=-1)
            wo = np.stack([np.sqrt(1 - lv**2) * np.cos(turn), np.sqrt(1 - lv**2) * np.sin(turn), lv], axis=-1)
            value, back = lobe.evaluate(wi, wo) * wo[:, 2], lobe.evaluate(wo, wi) * wi[:, 2]
            wrong = float((~np.isfinite(value) | (value < 0)).sum())
            peak = np.abs(value).max()
            apart = float((np.abs(value - back) / np.maximum(np.abs(value), 1e-9 * peak)).max())
            told = "finite" if not wrong else f"{wrong:g} values are no light"
            found.append(Outcome(f"{kind}, alpha {alpha:g}", apart + wrong, 1e-5, "reciprocity", told))
            if alpha >= 0.1:  # sharper ones slip between the directions of the quadrature
                most = float(directional_albedo(lobe.evaluate).max() - 1)
                found.append(
                    Outcome(f"{kind}, alpha {alpha:g}", max(most, 0.0), INTEGRAL, "light gained", "gains nothing")
                )
    return found
