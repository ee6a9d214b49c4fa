"""One material where three are allowed, and the free scale between bases and weights.

Why: identical bases make the weights' equations singular; scaling a basis by s and its weight by 1/s changes nothing.
Must: one basis is taken, or the error is that of one; the material is the same for any such scale.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline.core.material.quadrature import directions
from pipeline.core.material.surface import surface
from pipeline.core.progress import finish
from pipeline.core.reflectance import ReflectanceSettings, tables
from tests import drawn, synthetic
from tests.hard_cases.catalogue import Outcome

SLOW = True
SCALES = (1e-6, 1e6)


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(16))
    capture = drawn.draw(ball, drawn.two_spheres(), drawn.ggx)
    one, three = (finish(tables.fit(ball, capture, ReflectanceSettings(bases=k))) for k in (1, 3))
    worse = three.notes["material_rel_rms"] / one.notes["material_rel_rms"] - 1
    told = f"took {three.notes['bases']} of 3"
    found = [Outcome("one material, three bases allowed", max(worse, 0.0), 0.1, "error over that of one", told)]
    usual = finish(surface(one, 3))
    pairs = directions()
    before = usual.mixture.evaluate(pairs.wi, pairs.wo) * np.nanmax(usual.weights)
    for scale in SCALES:
        scaled = dataclasses.replace(one, table=one.table * scale, weights=one.weights / np.float32(scale))
        other = finish(surface(scaled, 3))
        after = other.mixture.evaluate(pairs.wi, pairs.wo) * np.nanmax(other.weights)
        apart = float(np.abs(after - before).max() / before.max())
        found.append(Outcome(f"basis x {scale:g}, weight / {scale:g}", apart, 1e-4, "f cos", "the same material"))
    return found
