"""Pictures under new lights, from an arranged stack."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from ..capture import Capture
from ..errors import LightsphereError
from ..progress import Progress, Work
from ..shape import Shape
from . import RelightSettings
from .compact import CompactCapture
from .emitters import Emitter
from .stack import Expected, Stack, arrange, expect, surrounded


def prepare(capture: Capture, shape: Shape, settings: RelightSettings) -> Work[Stack | Expected]:
    """Return the stack of a capture, ready for new lights; see :mod:`.stack` for what is raised."""
    if settings.interpolation == "model" and isinstance(capture, CompactCapture):
        return (yield from capture.prepared(shape, settings.memory))
    stack = yield from arrange(capture, shape, settings.memory)
    if settings.interpolation == "source":
        if not len(stack.triangles):
            raise LightsphereError(f"{capture.folder} has no inner surface of lights; choose --interpolation model")
        return stack
    weights, kinds = yield from expect(stack)
    return (yield from surrounded(stack, weights, kinds, shape.camera))


def relit(prepared: Stack | Expected, emitters: Sequence[Emitter]) -> Work[NDArray[np.float32]]:
    """Return the picture under some emitters together.

    Parameters
    ----------
    prepared : Stack or Expected
        Of :func:`prepare`.
    emitters : sequence of Emitter
        Near ones stand outside the object, at any distance.

    Returns
    -------
    (H, W, 3) float32
        Linear radiance; 0 beside the object. Linear in the emitters' intensities, and the sum of their pictures.
    """
    stack = prepared.stack if isinstance(prepared, Expected) else prepared
    radiance = np.zeros((len(stack.points), 3))
    for number, emitter in enumerate(emitters, start=1):
        prepared.add(emitter, radiance)
        yield Progress("relight", number, len(emitters), "emitters")
    width, height = stack.resolution
    picture = np.zeros((height, width, 3), np.float32)
    picture[tuple(stack.place)] = radiance
    return picture


def check_outside(shape: Shape, emitters: Sequence[Emitter]) -> None:
    """Raise LightsphereError when a near emitter stands inside the object, as far as one view can tell.

    What is unseen is taken to be as thick as it is wide: behind the surface the object goes on by the depth of the
    balls that its outline holds, each as large as the outline is far from its centre.
    """
    known = np.isfinite(shape.depth)
    origins, directions = (rays[known] for rays in shape.camera.rays())
    depth = shape.depth[known].astype(np.float64)
    width = shape.camera.pixel_size(depth)
    pixels = np.argwhere(known)
    radius = distance_transform_edt(np.pad(known, 1))[1:-1, 1:-1][known]
    for emitter in emitters:
        if emitter.distant:
            continue
        to = emitter.place - origins
        along = (to * directions).sum(axis=1)
        beside = np.linalg.norm(to - along[:, None] * directions, axis=1)
        at = int(np.argmin(beside))
        if beside[at] >= width[at] or along[at] <= depth[at]:
            continue
        half = (along[at] - depth[at]) / 2
        deepest = np.sqrt((radius**2 - ((pixels - pixels[at]) ** 2).sum(axis=1)).max())
        if half < deepest * shape.camera.pixel_size(depth[at] + half):
            place = ", ".join(f"{x:.3g}" for x in emitter.place)
            raise LightsphereError(f"the light at ({place}) is inside the object; move it out")
