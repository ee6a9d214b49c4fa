"""A light a tenth of a millimetre before the surface, among usual ones.

Why: 1 / d^2 is a hundred million there: the pixel's values span nine decades, and half of the lights see it grazing.
Must: the depths of the other pixels stay; the pixel itself is found or given up, not invented.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from tests import drawn, synthetic, tolerances
from tests.hard_cases.catalogue import Outcome


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(14))
    lights = drawn.two_spheres()
    position = lights.position.copy()
    nearest = int(np.argmax(position[:80, 2]))
    position[nearest] *= (synthetic.RADIUS + 1e-4) / np.linalg.norm(position[nearest])
    capture = drawn.draw(ball, dataclasses.replace(lights, position=position), drawn.ggx)
    shape = drawn.solved(capture)
    lost = int(np.isfinite(ball.depth).sum() - np.isfinite(shape.depth).sum())
    errors = drawn.errors(shape, ball)
    return [
        Outcome("light at .0001 m", float(np.percentile(errors, 95)), tolerances.DEPTH_EXACT,
                "depth, % of the object (95 of 100)", f"solved it, gave up {lost} pixels"),
        Outcome("light at .0001 m", float(errors.max()), tolerances.DEPTH_BECKMANN,
                "depth, % of the object (worst)", "invented nothing"),
    ]  # fmt: skip
