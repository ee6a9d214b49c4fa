"""An object of one pixel.

Why: no neighbour to be smooth with, no triangle, no gradient of the mask.
Must: every stage ends: depth as good as in the whole picture, a reflectance, a relit picture; that there is no mesh
is said.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from pipeline.core.reflectance import ReflectanceSettings, fit, tables
from pipeline.core.relight import RelightSettings
from pipeline.core.relight.emitters import point
from pipeline.core.relight.render import prepare, relit
from pipeline.core.shape.mesh import relief
from tests import drawn, synthetic, tolerances
from tests.hard_cases.catalogue import Outcome


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(14))
    capture = drawn.draw(ball, drawn.two_spheres(), drawn.ggx)
    seen = np.zeros(ball.depth.shape, bool)
    seen[6, 7] = True
    single = dataclasses.replace(capture, seen=seen)
    shape = drawn.solved(single)
    error = float(drawn.errors(shape, ball).max())
    try:
        triangles, told = len(relief(shape).faces), "made triangles of it"
    except LightsphereError as refused:
        triangles, told = 0, f"said: {refused}"
    lobe = finish(fit.fit(shape, single, ReflectanceSettings(model="ggx"))).notes["material_rel_rms"]
    table = finish(tables.fit(shape, single, ReflectanceSettings(bases=1))).notes["material_rel_rms"]
    picture = finish(relit(finish(prepare(single, shape, RelightSettings())), [point([0.0, -2.5, 2.5], [1.0] * 3)]))
    dark = float(not (picture[6, 7] > 0).all() or not np.isfinite(picture).all())
    return [
        Outcome("one pixel: shape", error, tolerances.DEPTH_EXACT, "depth, % of the object", "solved it"),
        Outcome("one pixel: mesh", triangles, 0, "triangles", told),
        Outcome("one pixel: lobe", lobe, tolerances.HELD_OUT, "lights held out", "solved it"),
        Outcome("one pixel: table", table, 0.2, "lights held out", "solved it"),
        Outcome("one pixel: relit", dark, 0, "", "made the picture"),
    ]
