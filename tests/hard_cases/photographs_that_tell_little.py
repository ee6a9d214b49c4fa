"""Unknown lights, and photographs that tell little of them.

Why: without highlights, curvature or spread of the lights, the bas-relief ambiguity stays open (Belhumeur et al. 1999).
Must: the run ends; the lights are found, or the deviation it states covers the error, whatever it says in words; too
few photographs, and black ones, are refused.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from pipeline.core.compare.shapes import angles_deg
from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.shape import Shape
from pipeline.core.shape.settings import ShapeSettings
from pipeline.core.shape.uncalibrated.recover import recover
from tests import drawn, oracles, synthetic
from tests.hard_cases.catalogue import Outcome

SLOW = True  # a solve takes ten seconds
COVER = 4.0  # deviations
FINE = 1.0  # degrees, with which anybody would be content


def around(count: int, least: float = 0.5) -> NDArray[np.float64]:
    """Directions about the view, up to some 50 degrees from it."""
    turn = 2.4 * np.arange(count)
    tilt = 1.1 * np.sqrt((np.arange(count) + least) / count)
    return oracles.unit(np.stack([tilt * np.cos(turn), tilt * np.sin(turn), np.ones(count)], axis=-1))


def mirror(
    normal: NDArray[np.float64], to_light: NDArray[np.float64], to_viewer: NDArray[np.float64]
) -> NDArray[np.float64]:
    return 0.8 * oracles.ggx_cosine(normal, to_light, to_viewer, 0.12)


def photographed(shape: Shape, directions: NDArray[np.float64], reflect: drawn.Reflect) -> drawn.Drawn:
    lights = Lights("distant", directions, np.full((len(directions), 3), np.pi), np.full(len(directions), 2))
    return drawn.draw(shape, lights, reflect)


def outcome(condition: str, capture: drawn.Drawn, refused: bool = False) -> Outcome:
    try:
        found = finish(recover(capture, ShapeSettings(method="uncalibrated")))
    except LightsphereError as error:
        return Outcome(condition, 0, 0, "", f"refused: {str(error).partition(': ')[2] or error}")
    error = float(angles_deg(found.lights.position, capture.lights.position).mean())
    stated = float(np.mean(found.deviation))
    doubts = "; ".join(found.doubts)
    told = f"lights {error:.2g} degrees off, stated {stated:.2g}" + (f"; said: {doubts}" if doubts else "")
    if refused:
        return Outcome(condition, np.inf, 0, "", told)
    if error < FINE:
        return Outcome(condition, 0, 0, "", told)
    return Outcome(condition, error / max(stated, 1e-9), COVER, "error over stated", told)


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(28, distance=4.0))
    flat = synthetic.plane(synthetic.camera(28, distance=4.0), oracles.unit(np.array([0.1, 0.2, 1.0])))
    line = oracles.unit(np.stack([np.linspace(-0.9, 0.9, 12), 0.002 * np.arange(12), np.ones(12)], axis=-1))
    narrow = oracles.unit(around(12) * [0.08, 0.08, 1.0])
    usual = photographed(ball, around(12), drawn.ggx)
    return [
        outcome("two photographs", photographed(ball, around(2), drawn.ggx), refused=True),
        outcome("black photographs", dataclasses.replace(usual, pictures=0 * usual.pictures), refused=True),
        outcome("glossy ball, 12 lights about the view", usual),
        outcome("matte ball", photographed(ball, around(12), drawn.lambert)),
        outcome("mirror-like ball", photographed(ball, around(12), mirror)),
        outcome("flat, glossy", photographed(flat, around(12), drawn.ggx)),
        outcome("all lights nearly in one plane", photographed(ball, line, drawn.ggx)),
        outcome("all lights within 5 degrees", photographed(ball, narrow, drawn.ggx)),
    ]
