"""What matters for shape: how many lights, by which method, with how many bases."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from ..capture import Capture
from ..compare.shapes import shape_errors
from ..errors import LightsphereError
from ..progress import Work, finish
from ..reflectance import ReflectanceSettings, fit, tables
from ..shape import Shape
from ..shape.double_sphere import recover as by_double_sphere
from ..shape.photometric.recover import recover as by_photometric_stereo
from ..shape.settings import ShapeSettings
from ..shape.uncalibrated.recover import recover as by_unknown_lights
from . import Variant
from .excerpt import SINGLE, blocks, excerpt
from .forecast import foretold, tried
from .goal import Goal, Promise
from .normals import reference
from .thinning import FRACTIONS, SOURCE_FRACTIONS, evenly, fewer, thinned, thinned_to

PHOTOGRAPHS = (6, 8, 12, 24)
BASES = (1, 2, 3)
JUDGED, JUDGED_BASES = 1200, 2  # pixels under distant lights by whose reflectance normals are judged, and its bases
PHASES = {"read": 0.1, "shape": 0.9}
Judge = Callable[[Shape], dict[str, float]]


def variants(capture: Capture) -> list[Variant]:
    """Return what is tried on a capture: by double covering, photometric stereo, or with lights unknown."""
    settings = ShapeSettings()
    if len(capture.lights.on("inner")) and len(capture.lights.on("outer")):
        source = dataclasses.replace(settings, objective="source")
        return double_sphere(capture, FRACTIONS, settings) + double_sphere(capture, SOURCE_FRACTIONS, source)
    if capture.lights.kind == "unknown":
        return _unknown(capture)
    judge = partial(_judged, capture=capture)
    return [
        variant
        for method in ("lambertian", "acls")
        for variant in photometric(capture, dataclasses.replace(settings, method=method), judge)
    ]


def promised(capture: Capture, settings: ShapeSettings, goal: Goal) -> Work[tuple[Promise, Judge]]:
    """Choose how many pictures are used, and how many bases, for a goal; the rest stays as it is set.

    Returns
    -------
    Promise
    callable
        Gives the errors of the shape that the chosen settings recover as they were promised, without truth.

    Raises
    ------
    LightsphereError
        For the method uncalibrated, whose cost and error a part of the pixels does not tell.
    """
    mask = capture.mask()
    if settings.method == "uncalibrated":
        raise LightsphereError(
            "--budget, --target and --dry-run do not serve the method uncalibrated, which sees the object as a whole; "
            "--pictures 8 makes it quicker, and lightsphere tradeoff shows what that costs"
        )
    if settings.method == "double-sphere":
        work = foretold(lambda part: double_sphere(part, FRACTIONS, settings), capture, mask, goal)
        return (yield from work), lambda shape: blind_errors(shape, capture)
    large, opening = yield from excerpt(capture, mask, SINGLE)
    best = yield from reference(large)
    choices = partial(photometric, settings=settings, judge=best.errors)
    return (yield from tried(choices, large, opening, int(mask.sum()), goal)), best.errors


def double_sphere(capture: Capture, fractions: Sequence[float], settings: ShapeSettings) -> list[Variant]:
    """Return solves with these fractions of both surfaces' lights, at least 8 a surface."""
    found = []
    for fraction in fractions:
        inner, outer = (fewer(fraction, len(capture.lights.on(surface))) for surface in ("inner", "outer"))
        own = settings.objective != ShapeSettings().objective
        label = f"{inner}/{outer}" + (f" {settings.objective}" if own else "")
        part = thinned(capture, inner, outer)
        described = {"pictures": len(part), "method": "double-sphere", "objective": settings.objective}

        def solve(part: Capture = part) -> Work[Shape]:
            return by_double_sphere(part, settings)

        found.append(Variant(label, described, len(part), solve, lambda shape: _judged(shape, capture), PHASES))
    return found


def photometric(capture: Capture, settings: ShapeSettings, judge: Judge) -> list[Variant]:
    """Return solves by photometric stereo with fewer lights, and, with all of them, with fewer bases."""
    found = []
    for count in sorted({fewer(fraction, len(capture)) for fraction in FRACTIONS}):
        part = thinned_to(capture, count)
        if settings.method == "lambertian":
            found.append(_photometric(part, settings, f"{count} lambertian", {}, count, judge))
            continue
        for bases in BASES if count == len(capture) else BASES[-1:]:
            label, weight = f"{count} acls {bases}", 20.0 * count * bases
            found.append(_photometric(part, settings, label, {"bases": bases}, weight, judge))
    return found


def _photometric(
    part: Capture, settings: ShapeSettings, label: str, own: dict[str, Any], weight: float, judge: Judge
) -> Variant:
    def solve() -> Work[Shape]:
        return (yield from by_photometric_stereo(part, dataclasses.replace(settings, **own))).shape

    return Variant(label, {"pictures": len(part), "method": settings.method, **own}, weight, solve, judge)


def _unknown(capture: Capture) -> list[Variant]:
    found = []
    for count in sorted({min(count, len(capture)) for count in PHOTOGRAPHS}):
        part = capture.select(evenly(len(capture), count))

        def solve(part: Capture = part) -> Work[Any]:
            return by_unknown_lights(part, ShapeSettings(method="uncalibrated"))

        def judged(whole: Any, part: Capture = part) -> dict[str, float]:
            return _judged(whole.shape, dataclasses.replace(part, lights=whole.lights))

        described = {"pictures": count, "method": "uncalibrated"}
        found.append(Variant(f"{count} photographs", described, count, solve, judged))
    return found


def _judged(shape: Shape, capture: Capture) -> dict[str, float]:
    """Return errors against truth, or without it."""
    truth = capture.truth()
    return blind_errors(shape, capture) if truth is None else shape_errors(shape, truth, capture.mask())


def blind_errors(shape: Shape, capture: Capture) -> dict[str, float]:
    """Return what can be told of a shape's errors without truth, and how much of the object it recovers.

    Depths state the error to be expected of them: its median. Else the error is that of pictures under lights that
    the fit of a reflectance on the shape never saw.
    """
    known = shape.confidence > 0
    recovered = {"recovered_pct": 100 * float(known.sum()) / max(int(capture.mask().sum()), 1)}
    if not known.any():
        return {"depth_expected_pct": float("nan"), **recovered}
    expected = shape.layers.get("expected_error")
    if expected is not None:
        extent = float(np.ptp(shape.points()[known], axis=0).max())
        return {"depth_expected_pct": 100 * float(np.median(expected[known])) / extent, **recovered}
    notes: dict[str, Any]
    if capture.lights.kind == "near":
        notes = finish(fit.fit(shape, capture, ReflectanceSettings())).notes
    else:
        sample = shape.within(blocks(known, JUDGED, SINGLE.block))
        notes = finish(tables.fit(sample, capture, ReflectanceSettings(bases=JUDGED_BASES))).notes
    return {"material_rel_rms": notes["material_rel_rms"], **recovered}
