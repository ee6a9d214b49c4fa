"""A surface that reflects nothing, and one that reflects everything.

Why: nothing divided by nothing; and a reflectance beyond 1, by however little, gains energy at every bounce.
Must: black has no depth and no confidence; white is found like any other; its albedo is 1.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests import drawn, oracles, synthetic, tolerances
from tests.hard_cases.catalogue import Outcome


def white(normal: NDArray[Any], to_light: NDArray[Any], to_viewer: NDArray[Any]) -> NDArray[np.float64]:
    return oracles.lambert_cosine(normal, to_light, 1.0)


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(14))
    capture = drawn.draw(ball, drawn.two_spheres(), white)
    shape = drawn.solved(capture)
    black = drawn.solved(dataclasses.replace(capture, pictures=np.zeros_like(capture.pictures)))
    invented = int(np.isfinite(black.depth).sum() + (black.confidence > 0).sum())
    albedo = np.nanmedian(np.abs(np.pi * shape.layers["diffuse"] - 1))
    return [
        Outcome("albedo 0", invented, 0, "pixels", "no depth, confidence 0"),
        Outcome("albedo 1", drawn.errors(shape, ball).max(), tolerances.DEPTH_EXACT, "depth, %", "solved it"),
        Outcome("albedo 1", float(albedo), tolerances.PLANTED_ALBEDO, "albedo", "solved it"),
    ]
