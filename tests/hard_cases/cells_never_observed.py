"""Basis BRDFs whose tables have cells that no pixel and light ever reached.

Why: a least squares problem without rank there; whatever comes out is an invention.
Must: the cells are finite, not negative, not rising from the highlight, and marked as never seen.
"""

from __future__ import annotations

import numpy as np

from pipeline.core.progress import finish
from pipeline.core.reflectance import ReflectanceSettings, tables
from tests import drawn, synthetic
from tests.hard_cases.catalogue import Outcome


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(16))
    capture = drawn.draw(ball, drawn.two_spheres(), drawn.ggx)
    ahead = np.flatnonzero(capture.lights.position[:, 2] > 0.9 * np.linalg.norm(capture.lights.position, axis=1))
    few = capture.select(ahead)
    few = drawn.Drawn(**{**vars(few), "pictures": capture.pictures[ahead]})
    found = finish(tables.fit(ball, few, ReflectanceSettings(bases=1)))
    unseen = found.seen == 0
    wrong = float((~np.isfinite(found.table) | (found.table < 0)).sum())
    rising = float(np.maximum(np.diff(found.table, axis=0), 0).max() / found.table.max())
    share = 1 - float(unseen.mean())
    condition = f"{len(ahead)} lights in a cone of 26 degrees"
    return [
        Outcome(condition, wrong, 0, "cells", f"filled all, {100 * unseen.mean():.0f} % marked as never seen"),
        Outcome(condition, rising, 1e-9, "rise from the highlight", "falls everywhere"),
        Outcome(condition, share, 0.9, "share seen", "says what is known"),
    ]
