"""Pictures of a scene under one light at a time, by Cycles."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.camera import Camera
from ..core.lights import Lights
from . import cycles, exr, lamps


def pictures(
    scene: bpy.types.Scene,
    camera: Camera,
    transport: cycles.Transport,
    lights: Lights | None,
    chosen: Iterable[int],
    seed: int = 0,
    shadows: bool = True,
    window: tuple[slice, slice] | None = None,
) -> Iterator[NDArray[np.float32]]:
    """Render a scene under one light after another, or once under its own light; yield each (H, W, 3).

    ``window`` are the rows and columns that are rendered; the others are left out of the pictures.
    """
    world = scene.world
    with (
        tempfile.TemporaryDirectory() as folder,
        cycles.measuring(scene, camera, transport, seed),
        cycles.cropped(scene, camera, window),
        cycles.openexr(scene),
        cycles.meshes_cached(scene),
        contextlib.ExitStack() as stack,
    ):
        path = Path(folder) / "probe.exr"
        if lights is None:
            stack.enter_context(cycles.changed(scene, {"world": world}))
            cycles.render(scene, path)
            yield exr.read_rgb(path)
            return
        stack.enter_context(cycles.own_lights_hidden(scene))
        lamp = stack.enter_context(lamps.lamp(scene, lights.kind))
        lamp.data.use_shadow = shadows
        for index in chosen:
            lamps.shine(lamp, lights, int(index))
            cycles.render(scene, path)
            yield exr.read_rgb(path)
