"""Light that an object throws upon itself, as Cycles renders it from what was found, taken out of its photographs.

Methods that look at each pixel by itself know direct light alone: in a hollow they see too much light and too flat a
surface. What they find is still near enough to foresee the light from bounce to bounce; without that they find better,
and so on (Nayar, Ikeuchi and Kanade 1991, for matt surfaces in closed form). Not modelled: light from what is not on
the mask, and from the object's back.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, TypeVar

import bpy
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from ..core import images
from ..core.capture import Capture, with_lights
from ..core.lights import Lights
from ..core.material.surface import surface
from ..core.progress import Progress, Work, retold
from ..core.reflectance.bivariate import Bivariate
from ..core.shape import Shape
from . import asset, cycles, views
from .ball import dress
from .materials import surface_material

Pictures = NDArray[np.float32]

LOBES = 2  # glossy ones of the material: bounced light shows no sharp highlights
BOUNCES = 4
SAMPLES = 1 << 20  # a picture, over all pixels
FEWEST, MOST = 4, 256  # a pixel
AROUND = 3  # pixels
SEED = 5


class Solved(Protocol):
    """What a method found."""

    @property
    def shape(self) -> Shape: ...
    @property
    def reflectance(self) -> Bivariate | None: ...
    @property
    def lights(self) -> Lights: ...


Found = TypeVar("Found", bound=Solved)


def bounced(shape: Shape, reflectance: Bivariate, lights: Lights) -> Work[Pictures]:
    """Return the light that comes to the camera from a recovered object by more than one bounce, (L, H, W, 3)."""
    made = yield from surface(reflectance, LOBES)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    item, normals = asset.add_relief(scene, shape, "Recovered")
    dress(item, surface_material("Recovered", made, normals))
    samples = int(np.clip(SAMPLES // shape.depth.size, FEWEST, MOST))
    total = 2 * len(lights)
    sides = []
    for number, transport in enumerate((cycles.Transport(bounces=BOUNCES, samples=samples), cycles.DIRECT)):
        work = views.under_lights(scene, shape.camera, lights, transport, SEED)
        before = number * len(lights)
        sides.append(
            (yield from retold(work, lambda step, b=before: Progress("bounces", b + step.done, total, "pictures")))
        )
    # it changes slowly over a surface; single pixels that were fitted badly, and noise, do not
    return median_filter(np.maximum(sides[0] - sides[1], 0.0), (1, AROUND, AROUND, 1))


def without(capture: Capture, extra: Pictures, folder: Path) -> Capture:
    """Write a capture in a folder of its own whose pictures lack some light (L, H, W, 3)."""
    made = with_lights(capture, capture.lights, folder)
    files = tuple(f"light_{light:04d}.exr" for light in range(len(capture)))
    for light, name in enumerate(files):
        images.write_rgb(folder / name, np.maximum(capture.image(light) - extra[light], 0.0))
    sums = tuple(images.checksum(folder / name) for name in files)
    made = dataclasses.replace(made, files=files, checksums=sums)
    made.save()
    return made


def taken_out(
    capture: Capture, solve: Callable[[Capture, Found | None], Work[Found]], rounds: int, folder: Path
) -> Work[tuple[Found, Capture]]:
    """Solve, foresee the light from bounce to bounce, take it out of the photographs, and solve again.

    Parameters
    ----------
    capture : Capture
    solve : callable
        Of a capture and of what was found before, which has shape, reflectance and lights.
    rounds : int
        How often it is solved again.
    folder : Path
        Where the photographs without that light go.

    Returns
    -------
    Found, Capture
        What was found last, and in which photographs.
    """
    found, given = (yield from solve(capture, None)), capture
    for _ in range(rounds):
        assert found.reflectance is not None
        extra = yield from bounced(found.shape, found.reflectance, found.lights)
        given = without(capture, extra, folder)
        found = yield from solve(given, found)
    return found, given
