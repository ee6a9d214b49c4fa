"""Four of five values in shadow, at random.

Why: a shadow is a value of zero that no smooth reflectance explains, and here they are the rule.
Must: pixels that keep enough lights are found; the others have no depth instead of a wrong one.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from tests import drawn, synthetic, tolerances
from tests.hard_cases.catalogue import Outcome

SHARE = 0.8


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(14))
    capture = drawn.draw(ball, drawn.two_spheres(320, 80), drawn.ggx)
    dark = np.random.default_rng(1).uniform(size=capture.pictures.shape[:3]) < SHARE
    pictures = np.where(dark[..., None], np.float32(0), capture.pictures)
    shape = drawn.solved(dataclasses.replace(capture, pictures=pictures))
    known = np.isfinite(shape.depth)
    errors = drawn.errors(shape, ball)
    told = f"solved {known.sum()} of {np.isfinite(ball.depth).sum()} pixels"
    return [
        Outcome(f"{100 * SHARE:g} % shadowed", float(np.percentile(errors, 95)), tolerances.DEPTH_BECKMANN,
                "depth, % of the object (95 of 100)", told)
    ]  # fmt: skip
