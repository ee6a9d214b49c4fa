"""What matters for relighting: how many lights the capture has, and how a new one is found between them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..capture import Capture
from ..compare.pictures import relative_rmse
from ..errors import LightsphereError
from ..progress import Work, finish
from ..relight import RelightSettings
from ..relight.emitters import Emitter, point
from ..relight.render import prepare, relit
from ..relight.stack import Expected, Stack
from ..shape import Shape
from . import Variant
from .thinning import FRACTIONS, SOURCE_FRACTIONS, evenly, fewer, thinned

PICTURES = 12  # lights that are held out and relit
DIM = 0.05  # of the brightest picture's mean: what is below tells nothing, such as a light under the ground


def variants(shape: Shape, capture: Capture, settings: RelightSettings, made: int = PICTURES) -> list[Variant]:
    """Return what is tried: fewer lights, interpolated by the model or by the source's rule.

    Every picture that is judged is the capture's own under a light that was taken out. Its neighbours are farther from
    it than those of a light that falls between the capture's, so that the errors are those of a slightly sparser one.

    Parameters
    ----------
    shape, capture : Shape, Capture
    settings : RelightSettings
        What is not varied.
    made : int
        How many pictures are relit, and timed.

    Raises
    ------
    LightsphereError
        When the capture is not of lights on two surfaces.
    """
    rest, unseen = held_out(capture)
    counts = [len(rest.lights.on(surface)) for surface in ("inner", "outer")]
    found = []
    for interpolation, fractions in (("model", FRACTIONS), ("source", SOURCE_FRACTIONS)):
        for fraction in fractions:
            inner, outer = (fewer(fraction, n) for n in counts)
            part = thinned(rest, inner, outer)
            label = f"{inner}/{outer}" + (" source" if interpolation == "source" else "")
            described = {"pictures": len(part), "interpolation": interpolation}
            chosen = dataclasses.replace(settings, pictures=len(part), interpolation=interpolation)

            def work(part: Capture = part, chosen: RelightSettings = chosen) -> Work[Stack | Expected]:
                prepared = yield from prepare(part, shape, chosen)
                for number in range(made):
                    yield from relit(prepared, [_emitter(capture, int(unseen[number % len(unseen)]))])
                return prepared

            def judged(prepared: Any) -> dict[str, float]:
                return held_out_errors(prepared, capture, unseen)

            found.append(Variant(label, described, 50.0 + len(part), work, judged))
    return found


def held_out(capture: Capture) -> tuple[Capture, NDArray[np.int64]]:
    """Return the capture without some of its lights, and their numbers: what pictures are judged by.

    Raises
    ------
    LightsphereError
        When the capture is not of lights on two surfaces.
    """
    if not (len(capture.lights.on("inner")) and len(capture.lights.on("outer"))):
        raise LightsphereError(f"{capture.folder} has no lights on two surfaces, which trials of relighting need")
    unseen = _telling(capture)
    return capture.select(np.setdiff1d(np.arange(len(capture)), unseen)), unseen


def held_out_errors(prepared: Stack | Expected, capture: Capture, unseen: NDArray[np.int64]) -> dict[str, float]:
    """Return the mean error of pictures under lights of the capture that were held out."""
    mask = capture.mask()
    found = []
    for light in map(int, unseen):
        picture = finish(relit(prepared, [_emitter(capture, light)]))
        found.append(relative_rmse(picture, capture.image(light), mask))
    return {"relight_rel_rmse": float(np.mean(found))}


def _emitter(capture: Capture, light: int) -> Emitter:
    return point(list(capture.lights.position[light]), list(capture.lights.intensity[light]))


def _telling(capture: Capture) -> NDArray[np.int64]:
    """Return some lights, evenly spread over their numbers, on the camera's side, that light the object."""
    places, mask = capture.lights.position, capture.mask()
    front = np.flatnonzero((places - places.mean(axis=0)) @ capture.camera.to_world[:3, 2] > 0)
    some = front[evenly(len(front), 3 * PICTURES)]
    bright = np.array([capture.image(int(light))[mask].mean() for light in some])
    lit = some[bright > DIM * bright.max()]
    return np.asarray(lit[evenly(len(lit), PICTURES)])
