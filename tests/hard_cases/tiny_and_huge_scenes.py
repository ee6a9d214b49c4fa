"""A scene of a millimetre, and one of ten kilometres.

Why: steps, thresholds and epsilons in metres fit the usual scene alone.
Must: depths over the size of the scene are the same.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from tests import drawn, synthetic, tolerances
from tests.hard_cases.catalogue import Outcome


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(14))
    capture = drawn.draw(ball, drawn.two_spheres(), drawn.ggx)
    usual = drawn.solved(capture)
    found = []
    for scale in (1e-3, 1e4):
        to_world = capture.camera.to_world.copy()
        to_world[:3, 3] *= scale
        lights = dataclasses.replace(capture.lights, position=scale * capture.lights.position)
        camera = dataclasses.replace(capture.camera, to_world=to_world)
        notes = capture.notes | {"diameter": scale * drawn.DIAMETER}
        other = drawn.solved(dataclasses.replace(capture, camera=camera, lights=lights, notes=notes))
        same = np.array_equal(np.isfinite(other.depth), np.isfinite(usual.depth))
        apart = float(np.nanmax(100 * np.abs(other.depth / scale - usual.depth)) / drawn.DIAMETER) if same else np.inf
        found.append(
            Outcome(f"metres x {scale:g}", apart, tolerances.EQUIVALENT, "depth, % of the object", "solved it alike")
        )
    return found
