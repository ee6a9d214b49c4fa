"""Two lights in the same place, and two so close that they are nearly one.

Why: triangles of no area between lights, differences of nothing, singular interpolation.
Must: the same place is refused with what to do; a hair's breadth apart, depth and relit pictures are those of one.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from pipeline.core.relight import RelightSettings
from pipeline.core.relight.emitters import point
from pipeline.core.relight.render import prepare, relit
from tests import drawn, synthetic, tolerances
from tests.hard_cases.catalogue import Outcome

APART = 1e-5  # metres


def doubled(apart: float) -> drawn.Drawn:
    """A capture whose lights are there twice, so far apart."""
    lights = drawn.two_spheres()
    twice = lights.select(np.repeat(np.arange(len(lights)), 2))
    position = twice.position.copy()
    position[1::2] += apart * np.random.default_rng(0).standard_normal((len(lights), 3))
    return drawn.draw(synthetic.ball(synthetic.camera(14)), dataclasses.replace(twice, position=position), drawn.ggx)


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(14))
    single = drawn.draw(ball, drawn.two_spheres(), drawn.ggx)
    try:
        drawn.solved(doubled(0.0))
        found = [Outcome("all lights double", np.inf, 0, "", "took them")]
    except LightsphereError as refused:
        found = [Outcome("all lights double", 0, 0, "", f"refused them: {refused}")]
    close = doubled(APART)
    error = float(drawn.errors(drawn.solved(close), ball).max())
    condition = f"all lights double, {APART:g} m apart"
    found.append(Outcome(condition, error, tolerances.DEPTH_EXACT, "depth, % of the object", "solved it"))
    for interpolation in ("model", "source"):
        settings = RelightSettings(interpolation=interpolation)
        two, one = (
            finish(relit(finish(prepare(capture, ball, settings)), [point([0.3, -1.2, 1.6], [12.0] * 3)]))
            for capture in (close, single)
        )
        apart = float(np.abs(two - one).max() / one.max())
        found.append(Outcome(f"{condition}: relit by {interpolation}", apart, 0.05, "picture", "solved it"))
    return found
