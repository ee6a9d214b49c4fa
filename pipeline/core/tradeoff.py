"""Error against time of the shape stage: the same capture solved with fewer lights and other settings."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .capture import Capture
from .compare.shapes import shape_errors
from .errors import LightsphereError
from .progress import Progress, Work
from .shape import Shape
from .shape.double_sphere import recover
from .shape.settings import ShapeSettings


@dataclass(frozen=True)
class Variant:
    """What is tried: so many of the capture's lights on either surface, solved with some settings."""

    inner: int
    outer: int
    settings: ShapeSettings

    @property
    def label(self) -> str:
        """The lights, and the objective where it is not the default one, e.g. ``"80/20 source"``."""
        special = self.settings.objective != ShapeSettings().objective
        return f"{self.inner}/{self.outer}" + (f" {self.settings.objective}" if special else "")


@dataclass(frozen=True)
class Trial:
    """What a variant cost and gave.

    Parameters
    ----------
    label : str
    lights : int
        Both surfaces together; the capture's time is proportional to it.
    seconds : float
        Of the solve, reading the pictures included.
    errors : dict of str to float
        Against truth, named as in :func:`.compare.shapes.shape_errors`; without truth ``material_rel_rms``.
    """

    label: str
    lights: int
    seconds: float
    errors: dict[str, float]


def light_counts(capture: Capture, fractions: Sequence[float], settings: ShapeSettings) -> list[Variant]:
    """Return variants with these fractions of the capture's lights, at least 8 a surface."""
    counts = [len(capture.lights.on(surface)) for surface in ("inner", "outer")]
    wanted = [[max(round(fraction * n), min(8, n)) for n in counts] for fraction in fractions]
    return [Variant(inner, outer, settings) for inner, outer in wanted]


def try_variants(capture: Capture, variants: Sequence[Variant]) -> Work[list[tuple[Trial, Shape]]]:
    """Solve a capture in several ways and measure each.

    The kernels are compiled and the processor's caches filled by a small solve first, which is not counted.

    Parameters
    ----------
    capture : Capture
        With truth, or the error is that of pictures under lights that the fit of a reflectance never saw.
    variants : sequence of Variant

    Returns
    -------
    list of (Trial, Shape)
        In the order of the variants.
    """
    total = float(sum(v.inner + v.outer for v in variants))
    for _ in recover(thinned(capture, 40, 20), variants[0].settings):
        yield Progress("warm up", 0.0, total, "lights")
    found = []
    done = 0.0
    for variant in variants:
        part = thinned(capture, variant.inner, variant.outer)
        start = time.perf_counter()
        shape = yield from _scaled(recover(part, variant.settings), done, len(part), total)
        seconds = time.perf_counter() - start
        done += len(part)
        errors = yield from _errors(shape, capture)
        found.append((Trial(variant.label, len(part), seconds, errors), shape))
    return found


def thinned(capture: Capture, inner: int, outer: int) -> Capture:
    """Return the capture with so many lights of each surface, as evenly spread as they allow."""
    kept = []
    for surface, count in (("inner", inner), ("outer", outer)):
        own = capture.lights.on(surface)
        if count > len(own):
            raise LightsphereError(f"{capture.folder} has {len(own)} {surface} lights; choose at most as many")
        kept.append(own[_spread(capture.lights.position[own], count)])
    return capture.select(np.sort(np.concatenate(kept)))


def dominated(trials: Sequence[Trial], error: str) -> list[str]:
    """Name for every trial one that is no slower, no worse and no less complete, and better in one; ``""`` if none.

    Trials named ``""`` are the Pareto front over seconds, error and ``recovered_pct``: a solve that leaves the
    difficult pixels out is not the better for it.
    """

    def costs(trial: Trial) -> tuple[float, float, float]:
        wrong = trial.errors[error]  # not a number where nothing was recovered
        return trial.seconds, np.inf if np.isnan(wrong) else wrong, -trial.errors.get("recovered_pct", 100.0)

    names = []
    for trial in trials:
        own = costs(trial)
        better = [
            other
            for other in trials
            if costs(other) != own and all(a <= b for a, b in zip(costs(other), own, strict=True))
        ]
        names.append(min(better, key=lambda other: costs(other)[1]).label if better else "")
    return names


def _spread(positions: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Choose points one after the other, each the farthest from those before it (Gonzalez 1985)."""
    directions = positions - positions.mean(axis=0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    chosen = [0]
    nearest = directions @ directions[0]
    while len(chosen) < count:
        nearest[chosen] = np.inf
        chosen.append(int(np.argmin(nearest)))
        nearest = np.maximum(nearest, directions @ directions[chosen[-1]])
    return np.array(chosen)


def _scaled(work: Work[Shape], before: float, share: float, total: float) -> Work[Shape]:
    """Pass a solve's progress on as its share of the whole; a solve reads first, then sweeps."""
    reached = 0.0
    try:
        while True:
            step = next(work)
            reached = max(reached, step.done / max(step.total, 1e-30) * (0.1 if step.stage == "read" else 1.0))
            yield Progress("try", before + share * min(reached, 1.0), total, "lights")
    except StopIteration as end:
        shape: Shape = end.value
        return shape


def _errors(shape: Shape, capture: Capture) -> Work[dict[str, float]]:
    truth = capture.truth()
    if truth is not None:
        return shape_errors(shape, truth, capture.mask())
    from .reflectance import ReflectanceSettings
    from .reflectance.fit import fit

    fitted: Any = yield from fit(shape, capture, ReflectanceSettings())
    return {"material_rel_rms": fitted.notes["material_rel_rms"]}


def as_row(trial: Trial, better: str) -> dict[str, Any]:
    """Return a trial as one flat row of a table."""
    return {
        **{k: v for k, v in dataclasses.asdict(trial).items() if k != "errors"},
        **trial.errors,
        "beaten_by": better,
    }
