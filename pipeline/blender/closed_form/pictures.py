"""Pictures under one light after another from the first hits."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import direct_light as direct
from ...core.camera import Camera
from ...core.lights import Lights
from ..geometry import RENDERED
from .closures import Inexact
from .first_hits import surface
from .shadows import Triangles, triangles


@dataclass(frozen=True)
class ClosedForm:
    """What is needed to make pictures of direct light.

    Parameters
    ----------
    hit : (H, W) bool
        Which pixels show a surface.
    pixels : (P,) int64
        Their places in the flat picture.
    surface : direct.Surface
        What they show.
    triangles : Triangles
        What casts shadows on it.
    """

    hit: NDArray[np.bool_]
    pixels: NDArray[np.int64]
    surface: direct.Surface
    triangles: Triangles

    def picture(self, lights: Lights, index: int) -> NDArray[np.float32]:
        """Return the picture (H, W, 3) under one light."""
        made = np.zeros((self.hit.size, 3), np.float32)
        made[self.pixels] = direct.radiance(self.surface, lights, index, self.triangles.offset, self.triangles.hidden)
        return made.reshape(*self.hit.shape, 3)


def prepare(scene: bpy.types.Scene, camera: Camera, seed: int = 0) -> ClosedForm:
    """Read what a scene shows, once for all lights; ``seed`` is that of the pictures that Cycles would render.

    Raises
    ------
    Inexact
        When pictures would not be those that Cycles renders, with the reason.
    """
    for item in scene.objects:
        if item.type in RENDERED and not item.hide_render:
            _check(item)
    found = triangles(scene)
    hit, shown = surface(scene, camera, found, seed)
    return ClosedForm(hit, np.flatnonzero(hit), shown, found)


def _check(item: bpy.types.Object) -> None:
    if item.shadow_terminator_shading_offset:
        raise Inexact(f"the object {item.name}, whose shadow terminator has a shading offset")
    if not (item.visible_camera and item.visible_shadow) or item.is_holdout or item.is_shadow_catcher:
        raise Inexact(f"the object {item.name}, which some rays do not see")
