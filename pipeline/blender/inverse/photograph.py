"""A picture of a built-in room to try inverse with."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from ...core import images
from ...core.progress import Progress, Work
from .. import cycles, exr
from ..camera import camera_of
from ..scene import load
from .room import MOST_BOUNCES

PASSES, SAMPLES, SEED = 16, 64, 1_000_000  # seeds that no search uses
OWN = {"filter_width": 1.5, "min_light_bounces": 4}  # Blender's own pixel filter


def photographed(name: str, path: Path, seed: int = SEED, passes: int = PASSES) -> Work[None]:
    """Render a built-in room or a .blend as it is, with all its light, as linear EXR; yield progress per pass."""
    loaded = load(name)
    camera = camera_of(loaded, loaded.render.resolution_x, loaded.render.resolution_y)
    transport = cycles.Transport(MOST_BOUNCES, samples=SAMPLES)
    pictures = []
    for number in range(passes):
        with (
            cycles.measuring(loaded, camera, transport, seed + number, world=loaded.world),
            cycles.changed(loaded.cycles, OWN),
            cycles.openexr(loaded),
            tempfile.TemporaryDirectory() as folder,
        ):
            cycles.render(loaded, Path(folder) / "pass.exr")
            pictures.append(exr.read_rgb(Path(folder) / "pass.exr"))
        yield Progress("photograph", number + 1, passes, "passes")
    images.write_rgb(path, np.mean(pictures, axis=0, dtype=np.float64).astype(np.float32))
