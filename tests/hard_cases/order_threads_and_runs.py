"""The same pictures in another order, on another number of processor cores, and once more.

Why: sums in another order round differently, and parallel sums differ from run to run; alternations magnify that.
Must: a second run and another number of threads give the same bytes; another order gives the same result.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.reflectance import ReflectanceSettings, fit, tables
from pipeline.core.relight import RelightSettings
from pipeline.core.relight.emitters import point
from pipeline.core.relight.render import prepare, relit
from pipeline.core.rig import hemisphere
from pipeline.core.shape.photometric.recover import recover
from pipeline.core.shape.settings import ShapeSettings
from tests import drawn, synthetic
from tests.hard_cases.catalogue import Outcome

SLOW = True
BALL = synthetic.ball(synthetic.camera(14))
Solve = Callable[[drawn.Drawn], NDArray[Any]]


def photometric(method: str) -> Solve:
    return lambda capture: finish(recover(capture, ShapeSettings(method=method))).shape.normal


def relighted(capture: drawn.Drawn) -> NDArray[Any]:
    prepared = finish(prepare(capture, BALL, RelightSettings()))
    return finish(relit(prepared, [point([0.3, -1.2, 1.6], [12.0] * 3)]))


SOLVERS: dict[str, tuple[str, Solve, float]] = {  # which capture, what is solved, how much another order may change it
    "double sphere": ("near", lambda capture: drawn.solved(capture).depth, 1e-4),
    "lambertian": ("distant", photometric("lambertian"), 1e-4),
    "acls": ("distant", photometric("acls"), 1e-2),
    "tables": ("near", lambda capture: finish(tables.fit(BALL, capture, ReflectanceSettings(bases=2))).weights, np.inf),
    "lobe": ("near", lambda capture: finish(fit.fit(BALL, capture, ReflectanceSettings())).albedo, np.inf),
    "relight": ("near", relighted, 1e-4),
}


def captures(digits: type = np.float32) -> dict[str, drawn.Drawn]:
    """What is solved: a glossy ball under near and under distant lights."""
    distant = Lights("distant", hemisphere(60)[:40], np.full((40, 3), np.pi), np.full(40, 2))
    return {
        "near": drawn.draw(BALL, drawn.two_spheres(), drawn.ggx, digits),
        "distant": drawn.draw(synthetic.ball(synthetic.camera(20, "orthographic")), distant, drawn.ggx, digits),
    }


def run() -> list[Outcome]:
    made = captures()
    found = []
    before = numba.get_num_threads()
    for name, (kind, solve, most) in SOLVERS.items():
        capture = made[kind]
        usual = solve(capture)
        different = int(usual.tobytes() != solve(capture).tobytes())
        try:
            numba.set_num_threads(1)
            different += int(usual.tobytes() != solve(capture).tobytes())
        finally:
            numba.set_num_threads(before)
        found.append(Outcome(f"{name}: again, and with 1 thread", different, 0, "", "the same bytes"))
        if not np.isfinite(most):  # every so many-th light is held out: another order is another question
            continue
        order = np.random.default_rng(4).permutation(len(capture))
        mixed = dataclasses.replace(capture, lights=capture.lights.select(order), pictures=capture.pictures[order])
        apart = float(np.nanmax(np.abs(solve(mixed) - usual)) / np.nanmax(np.abs(usual)))
        found.append(
            Outcome(f"{name}: lights in another order", apart, most, "of the largest value", "the same result")
        )
    return found
