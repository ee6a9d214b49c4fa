"""What matters for relighting: how many lights the capture has, and how a new one is found between them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..capture import Capture
from ..compare.pictures import relative_rmse
from ..errors import LightsphereError
from ..progress import Work
from ..relight import RelightSettings
from ..relight.emitters import point
from ..relight.render import prepare, relit
from ..shape import Shape
from . import FRACTIONS, SOURCE_FRACTIONS, Variant, evenly, fewer, thinned

PICTURES = 12  # lights that are held out and relit
DIM = 0.05  # of the brightest picture's mean: what is below tells nothing, such as a light under the ground


def variants(shape: Shape, capture: Capture) -> list[Variant]:
    """Return what is tried: fewer lights, interpolated by the model or by the source's rule.

    Every picture that is judged is the capture's own under a light that was taken out. Its neighbours are farther from
    it than those of a light that falls between the capture's, so that the errors are those of a slightly sparser one.

    Raises
    ------
    LightsphereError
        When the capture is not of lights on two surfaces.
    """
    if not (len(capture.lights.on("inner")) and len(capture.lights.on("outer"))):
        raise LightsphereError(f"{capture.folder} has no lights on two surfaces, which relighting needs")
    unseen = _telling(capture)
    rest = capture.select(np.setdiff1d(np.arange(len(capture)), unseen))
    counts = [len(rest.lights.on(surface)) for surface in ("inner", "outer")]
    found = []
    for interpolation, fractions in (("model", FRACTIONS), ("source", SOURCE_FRACTIONS)):
        for fraction in fractions:
            inner, outer = (fewer(fraction, n) for n in counts)
            part = thinned(rest, inner, outer)
            label = f"{inner}/{outer}" + (" source" if interpolation == "source" else "")
            described = {"lights": len(part), "interpolation": interpolation}
            settings = RelightSettings(interpolation=interpolation)

            def work(part: Capture = part, settings: RelightSettings = settings) -> Work[list[NDArray[np.float32]]]:
                prepared = yield from prepare(part, shape, settings)
                pictures = []
                for light in unseen:
                    place, strength = capture.lights.position[light], capture.lights.intensity[light]
                    pictures.append((yield from relit(prepared, [point(list(place), list(strength))])))
                return pictures

            def judged(pictures: Any) -> dict[str, float]:
                mask = capture.mask()
                errors = [relative_rmse(a, capture.image(int(b)), mask) for a, b in zip(pictures, unseen, strict=True)]
                return {"relight_rel_rmse": float(np.mean(errors))}

            found.append(Variant(label, described, 50.0 + len(part), work, judged))
    return found


def _telling(capture: Capture) -> NDArray[np.int64]:
    """Return some lights, evenly spread over their numbers, on the camera's side, that light the object."""
    places, mask = capture.lights.position, capture.mask()
    front = np.flatnonzero((places - places.mean(axis=0)) @ capture.camera.to_world[:3, 2] > 0)
    some = front[evenly(len(front), 3 * PICTURES)]
    bright = np.array([capture.image(int(light))[mask].mean() for light in some])
    lit = some[bright > DIM * bright.max()]
    return np.asarray(lit[evenly(len(lit), PICTURES)])
