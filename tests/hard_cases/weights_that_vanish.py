"""Pixels that show none of the bases, and a basis that no pixel shows.

Why: a black pixel's weights are 0 / 0 of a basis' share, and the scale of a basis that nothing shows is free.
Must: everything is finite, black pixels stay black, and the other pixels' material is what it is without those.
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


def run() -> list[Outcome]:
    ball = synthetic.ball(synthetic.camera(16))
    capture = drawn.draw(ball, drawn.two_spheres(), drawn.ggx)
    assert capture.pictures is not None
    black = np.zeros(capture.mask().shape, bool)
    black[:, ::2] = capture.mask()[:, ::2]
    painted = dataclasses.replace(capture, pictures=np.where(black[..., None], np.float32(0), capture.pictures))
    settings = ReflectanceSettings(bases=1)
    whole = finish(tables.fit(ball.within(capture.mask() & ~black), capture, settings))
    half = finish(tables.fit(ball, painted, settings))
    shown = np.isfinite(half.weights).all(axis=(2, 3))
    brightest = float(np.nanmax(half.weights))
    left = float(half.weights[black & shown].max() / brightest) if (black & shown).any() else 0.0
    found = [Outcome("every second column black", left, 1e-3, "weight of black pixels", "stay black")]
    pairs = directions()
    usual, other = (finish(surface(one, 3)) for one in (whole, half))
    values = [one.mixture.evaluate(pairs.wi, pairs.wo)[:, 0] * np.nanmax(one.weights) for one in (usual, other)]
    apart = float(np.sqrt(((values[0] - values[1]) ** 2).mean() / (values[0] ** 2).mean()))
    found.append(Outcome("every second column black", apart, 0.1, "f cos of the rest", "the same material"))
    second = np.concatenate([whole.table, whole.table], axis=2)
    weights = np.concatenate([whole.weights, 0 * whole.weights], axis=2)
    shown = np.isfinite(weights).all(axis=(2, 3))
    unused = finish(surface(dataclasses.replace(whole, table=second, weights=weights), 3))
    broken = sum(int((~np.isfinite(part)).sum()) for part in (unused.mixture.curves, unused.weights[shown]))
    found.append(Outcome("a basis that no pixel shows", broken, 0, "", "finite, its weight 0"))
    return found
