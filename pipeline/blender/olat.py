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
from ..core.capture import Capture
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
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        path = Path(folder) / "picture.exr"
        if lights is None:
            stack.enter_context(_measuring(scene, camera, transport, seed, world=scene.world))
            stack.enter_context(cycles.cropped(scene, camera, window))
            cycles.render(scene, path)
            yield exr.read_rgb(path)
            return
        lamp = stack.enter_context(_lamp(scene, camera, transport, lights, seed))
        stack.enter_context(cycles.cropped(scene, camera, window))
        lamp.data.use_shadow = shadows
        for index in chosen:
            lamps.shine(lamp, lights, int(index))
            cycles.render(scene, path)
            yield exr.read_rgb(path)


def render_lights(scene: bpy.types.Scene, capture: Capture, lights: Iterable[int], threads: int) -> Iterator[int]:
    """Render the pictures of some lights of a described capture; yield each light when its picture is on disk."""
    settings = capture.notes["settings"]
    transport = cycles.Transport(**capture.notes["transport"])
    written = (settings["seed"], threads, settings["pixel_type"])
    with _lamp(scene, capture.camera, transport, capture.lights, *written) as lamp:
        for light in lights:
            lamps.shine(lamp, capture.lights, light)
            cycles.render(scene, capture.folder / capture.files[light])
            yield light


@contextlib.contextmanager
def _lamp(
    scene: bpy.types.Scene,
    camera: Camera,
    transport: cycles.Transport,
    lights: Lights,
    seed: int,
    threads: int = 0,
    pixel_type: str = "float",
) -> Iterator[bpy.types.Object]:
    """Set a scene up for pictures under one lamp, which is yielded, in place of its own light."""
    with (
        _measuring(scene, camera, transport, seed, threads, pixel_type),
        cycles.own_lights_hidden(scene),
        lamps.lamp(scene, lights.kind) as lamp,
    ):
        yield lamp


@contextlib.contextmanager
def _measuring(
    scene: bpy.types.Scene,
    camera: Camera,
    transport: cycles.Transport,
    seed: int,
    threads: int = 0,
    pixel_type: str = "float",
    world: bpy.types.World | None = None,
) -> Iterator[None]:
    with (
        cycles.measuring(scene, camera, transport, seed, threads, world),
        cycles.openexr(scene, pixel_type=pixel_type),
        cycles.meshes_cached(scene),
    ):
        yield
