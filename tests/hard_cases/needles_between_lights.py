"""Lights so unevenly spread that the triangles between them are needles.

Why: barycentric weights in a needle are quotients of areas that vanish; negative ones make dark rings.
Must: relit pictures are finite, not negative, and no brighter than the brightest neighbour by more than a tenth.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline.core.progress import finish
from pipeline.core.relight import RelightSettings
from pipeline.core.relight.emitters import point
from pipeline.core.relight.render import prepare, relit
from tests import drawn, oracles, synthetic
from tests.hard_cases.catalogue import Outcome


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(14))
    lights = drawn.two_spheres()
    squeezed = lights.position.copy()
    inner = lights.on("inner")
    squeezed[inner] = 2 * oracles.unit(lights.position[inner] * [1.0, 1e-4, 1.0] + [0, 1e-6, 0])
    squeezed[inner[:20]] = lights.position[inner[:20]]
    capture = drawn.draw(ball, dataclasses.replace(lights, position=squeezed), drawn.lambert)
    found = []
    for interpolation in ("model", "source"):
        prepared = finish(prepare(capture, ball, RelightSettings(interpolation=interpolation)))
        worst, dark = 0.0, 0.0
        for turn in np.linspace(0, 2 * np.pi, 9)[:-1]:
            place = [2 * np.cos(turn), 0.01 * np.sin(3 * turn), 2 * np.sin(turn)]  # as far as its neighbours
            picture = finish(relit(prepared, [point(place, [12.0] * 3)]))
            dark = min(dark, float(np.nan_to_num(picture, nan=-np.inf).min()))
            worst = max(worst, float(picture.max() / capture.pictures.max()))
        told = "finite, none negative" if dark >= 0 else f"a value of {dark:.2g}"
        bright = max(worst - 1, 0.0) if dark >= 0 else np.inf
        found.append(Outcome(f"needles, {interpolation}", bright, 0.1, "brighter than all neighbours", told))
    return found
