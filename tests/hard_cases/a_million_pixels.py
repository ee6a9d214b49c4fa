"""A picture of a million pixels.

Why: memory and time must be linear in pixels, and a surface through a million normals is one sparse system.
Must: normals and surface as exact as those of few pixels; memory below 2 GB per million pixels and twelve pictures.
"""

from __future__ import annotations

import tracemalloc

import numpy as np

from pipeline.core.compare.shapes import angles_deg
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.rig import hemisphere
from pipeline.core.shape.photometric.recover import recover
from pipeline.core.shape.settings import ShapeSettings
from tests import drawn, oracles, synthetic
from tests.hard_cases.catalogue import Outcome

SLOW = True
SIDE, LIGHTS = 1430, 12  # of which the ball covers a million
MOST = 2.0  # GB beside the pictures


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(SIDE, "orthographic"))
    towards = oracles.unit(hemisphere(LIGHTS) * [0.5, 0.5, 1.0])[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    lights = Lights("distant", towards, np.full((LIGHTS, 3), np.pi), np.full(LIGHTS, 2))
    capture = drawn.draw(ball, lights, drawn.lambert)
    pixels = int(capture.mask().sum())
    tracemalloc.start()
    shape = finish(recover(capture, ShapeSettings(method="lambertian")))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    found = shape.shape
    known = found.confidence > 0
    off = angles_deg(found.normal[known].astype(np.float64), ball.normal[known].astype(np.float64))
    apart = np.abs(found.levelled(ball.depth).depth.astype(np.float64) - ball.depth)[known]
    condition = f"{pixels / 1e6:.2f} million pixels"
    told = f"solved {100 * known.sum() / pixels:.1f} % of them"
    return [
        Outcome(condition, float(np.median(off)), 0.02, "normals, degrees (median)", told),
        Outcome(condition, 100 * float(np.median(apart)) / drawn.DIAMETER, 0.5, "surface, % of the object", told),
        Outcome(
            condition, most / 1e3 / pixels, MOST, "memory beside the pictures, GB per million", "kept within bounds"
        ),
    ]
