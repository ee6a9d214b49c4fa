"""Values that are not numbers, negative, infinite or black, strewn over the pictures.

Why: one such value in a sum spoils the pixel, and a pixel its neighbours.
Must: the depths stay; what was left out is counted.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from tests import drawn, synthetic, tolerances
from tests.hard_cases.catalogue import Outcome

SHARE = 0.05
KINDS = {"not a number": np.nan, "infinite": np.inf, "negative": -1.0, "black": 0.0}


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(14))
    capture = drawn.draw(ball, drawn.two_spheres(160, 40), drawn.ggx)
    hit = np.random.default_rng(0).uniform(size=capture.pictures.shape[:3]) < SHARE
    found = []
    for name, value in KINDS.items():
        pictures = np.where(hit[..., None], np.float32(value), capture.pictures)
        shape = drawn.solved(dataclasses.replace(capture, pictures=pictures))
        whole = np.isfinite(shape.depth).sum() == np.isfinite(ball.depth).sum()
        worst = float(np.percentile(drawn.errors(shape, ball), 95)) if whole else np.inf
        told = f"solved it; {shape.notes['broken_values']} values left out" if not np.isfinite(value) else "solved it"
        condition = f"{100 * SHARE:g} % {name}"
        found.append(Outcome(condition, worst, tolerances.DEPTH_BECKMANN, "depth, % of the object (95 of 100)", told))
    return found
