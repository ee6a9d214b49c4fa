"""Pictures a million million times darker or brighter.

Why: floors that are absolute numbers (1e-6, 1e-12) hide dark pictures or let noise pass in bright ones.
Must: the depths are those of the pictures as they were, and so is which pixels are recovered.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from tests import drawn, synthetic, tolerances
from tests.hard_cases.catalogue import Outcome


def run() -> list[Outcome]:
    capture = drawn.draw(synthetic.ball(synthetic.camera(14)), drawn.two_spheres(), drawn.ggx)
    usual = drawn.solved(capture)
    found = []
    for factor in (1e-12, 1e-6, 1e6, 1e12):
        other = drawn.solved(dataclasses.replace(capture, pictures=capture.pictures * np.float32(factor)))
        same = np.array_equal(np.isfinite(other.depth), np.isfinite(usual.depth))
        apart = float(np.nanmax(drawn.errors(other, usual))) if same else np.inf
        found.append(
            Outcome(f"radiance x {factor:g}", apart, tolerances.EQUIVALENT, "depth, % of the object", "solved it alike")
        )
    return found
