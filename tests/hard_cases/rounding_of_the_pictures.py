"""Pictures rounded to fewer and fewer bits: how the solver's error grows with that of its input.

Why: float32, half float and noise differ by their size alone; a solver that magnifies one magnifies all.
Must: the depth error in per cent stays below 2 times the relative error of the pictures in per cent.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from tests import drawn, synthetic
from tests.hard_cases.catalogue import Outcome

MOST_GROWTH = 2.0


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(14))
    capture = drawn.draw(ball, drawn.two_spheres(160, 40), drawn.ggx)
    found = []
    for bits in (16, 12, 10, 8):
        fraction, exponent = np.frexp(capture.pictures.astype(np.float64))
        rounded = np.ldexp(np.round(fraction * 2**bits) / 2**bits, exponent).astype(np.float32)
        shape = drawn.solved(dataclasses.replace(capture, pictures=rounded))
        relative = 100 * 2.0**-bits / np.sqrt(12)  # RMS of a rounding of a fraction of 1/2 to 1, about
        growth = float(np.median(drawn.errors(shape, ball))) / relative
        condition = f"{bits} bits, {relative:.2g} % of a value"
        found.append(Outcome(condition, growth, MOST_GROWTH, "depth error over that of the values", "solved it"))
    return found
