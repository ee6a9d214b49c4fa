"""What matters for shape: how many lights, by which method, with how many bases."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..capture import Capture
from ..compare.shapes import shape_errors
from ..progress import Work, finish
from ..reflectance import ReflectanceSettings
from ..reflectance.fit import fit
from ..shape import Shape
from ..shape.double_sphere import recover as by_double_sphere
from ..shape.photometric.recover import recover as by_photometric_stereo
from ..shape.settings import ShapeSettings
from ..shape.uncalibrated.recover import recover as by_unknown_lights
from . import FRACTIONS, SOURCE_FRACTIONS, Variant, evenly, fewer, spread, thinned

PHOTOGRAPHS = (6, 8, 12, 24)
BASES = (1, 2, 3)
PHASES = {"read": 0.1, "shape": 0.9}


def variants(capture: Capture) -> list[Variant]:
    """Return what is tried on a capture: by double covering, photometric stereo, or with lights unknown."""
    settings = ShapeSettings()
    if len(capture.lights.on("inner")) and len(capture.lights.on("outer")):
        source = dataclasses.replace(settings, objective="source")
        return double_sphere(capture, FRACTIONS, settings) + double_sphere(capture, SOURCE_FRACTIONS, source)
    if capture.lights.kind == "unknown":
        return _unknown(capture)
    return _photometric(capture)


def double_sphere(capture: Capture, fractions: Sequence[float], settings: ShapeSettings) -> list[Variant]:
    """Return solves with these fractions of both surfaces' lights, at least 8 a surface."""
    found = []
    for fraction in fractions:
        inner, outer = (fewer(fraction, len(capture.lights.on(surface))) for surface in ("inner", "outer"))
        own = settings.objective != ShapeSettings().objective
        label = f"{inner}/{outer}" + (f" {settings.objective}" if own else "")
        part = thinned(capture, inner, outer)
        described = {"lights": len(part), "method": "double-sphere", "objective": settings.objective}

        def solve(part: Capture = part) -> Work[Shape]:
            return by_double_sphere(part, settings)

        found.append(Variant(label, described, len(part), solve, lambda shape: _judged(shape, capture), PHASES))
    return found


def _photometric(capture: Capture) -> list[Variant]:
    found = []
    for count in sorted({fewer(fraction, len(capture)) for fraction in FRACTIONS}):
        part = capture.select(np.sort(spread(capture.lights.position, count)))
        for method, bases in (("lambertian", 0), *(("acls", k) for k in BASES)):
            if method == "acls" and bases < BASES[-1] and count < len(capture):
                continue
            chosen = ShapeSettings(method=method, bases=bases or 1)

            def solve(part: Capture = part, chosen: ShapeSettings = chosen) -> Work[Shape]:
                return (yield from by_photometric_stereo(part, chosen)).shape

            label = f"{count} {method}" + (f" {bases}" if bases else "")
            described = {"lights": count, "method": method, "bases": bases}
            weight = count * (1.0 if method == "lambertian" else 20.0 * bases)
            found.append(Variant(label, described, weight, solve, lambda shape: _judged(shape, capture)))
    return found


def _unknown(capture: Capture) -> list[Variant]:
    found = []
    for count in sorted({min(count, len(capture)) for count in PHOTOGRAPHS}):
        part = capture.select(evenly(len(capture), count))

        def solve(part: Capture = part) -> Work[Any]:
            return by_unknown_lights(part, ShapeSettings(method="uncalibrated"))

        def judged(whole: Any, part: Capture = part) -> dict[str, float]:
            return _judged(whole.shape, dataclasses.replace(part, lights=whole.lights))

        described = {"lights": count, "method": "uncalibrated"}
        found.append(Variant(f"{count} photographs", described, count, solve, judged))
    return found


def _judged(shape: Shape, capture: Capture) -> dict[str, float]:
    """Return errors against truth, or those of pictures under lights that the fit of a reflectance never saw."""
    truth = capture.truth()
    if truth is not None:
        return shape_errors(shape, truth, capture.mask())
    fitted = finish(fit(shape, capture, ReflectanceSettings()))
    return {"material_rel_rms": fitted.notes["material_rel_rms"]}
