"""The light rig as one object that the artist sees, moves and scales: a vertex per light."""

from __future__ import annotations

import dataclasses

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core import rig
from ..core.capture_settings import CaptureSettings
from ..core.errors import LightsphereError
from ..core.lights import Lights

MARK = "lightsphere_rig"
LAYOUT, OFFSET = "lightsphere_layout", "lightsphere_offset"  # of spheres: which, and their lights' mean from the centre
NAME = "Light Rig"
INTENSITY, SURFACE = "intensity", "surface"


def add(scene: bpy.types.Scene, lights: Lights, settings: CaptureSettings) -> bpy.types.Object:
    """Add near lights to a scene as a wire object that no render shows; moving or scaling it moves the lights.

    Parameters
    ----------
    scene : bpy.types.Scene
    lights : Lights
    settings : CaptureSettings
        Of which they were made; a layout of spheres can follow other settings later (:func:`follow`).
    """
    data = bpy.data.meshes.new(NAME)
    centre = lights.position.mean(axis=0)
    _fill(data, lights, centre)
    item = bpy.data.objects.new(NAME, data)
    item[MARK] = True
    if settings.rig in rig.SPHERES:
        item[LAYOUT] = settings.rig
        item[OFFSET] = rig.double_sphere(settings, np.zeros(3)).position.mean(axis=0).tolist()
    item.location = centre
    item.hide_render = True
    item.display_type = "WIRE"
    scene.collection.objects.link(item)
    return item


def follow(item: bpy.types.Object, settings: CaptureSettings) -> None:
    """Give a rig object of spheres the radii, counts and power of other settings; it stays where it was moved to.

    Raises
    ------
    LightsphereError
        When the surfaces are not nested.
    """
    if LAYOUT not in item:
        return
    settings = dataclasses.replace(settings, rig=item[LAYOUT])
    lights = rig.double_sphere(settings, -np.array(item[OFFSET]))
    item.data.clear_geometry()
    _fill(item.data, lights, np.zeros(3))
    item.data.update()


def _fill(data: bpy.types.Mesh, lights: Lights, centre: NDArray[np.float64]) -> None:
    """Make a vertex of every light, about a centre, and edges that show the surfaces."""
    edges = []
    for surface in np.unique(lights.surface):
        index = np.flatnonzero(lights.surface == surface)
        points = lights.position[index]
        edges.extend(index[rig.edges(points, points.mean(axis=0))].tolist())
    data.from_pydata((lights.position - centre).tolist(), edges, [])
    intensity = data.attributes.new(INTENSITY, "FLOAT_VECTOR", "POINT")
    intensity.data.foreach_set("vector", lights.intensity.astype(np.float32).ravel())
    surfaces = data.attributes.new(SURFACE, "INT", "POINT")
    surfaces.data.foreach_set("value", lights.surface.astype(np.int32))


def find(scene: bpy.types.Scene) -> bpy.types.Object:
    """Return the scene's rig object; raise LightsphereError when there is none."""
    for item in scene.objects:
        if item.get(MARK):
            return item
    raise LightsphereError(f"the scene {scene.name!r} has no light rig; add one or choose another --rig")


def lights_of(item: bpy.types.Object) -> Lights:
    """Return the lights of a rig object where it stands now, world space; their intensity does not scale."""
    data = item.data
    points, intensity = (np.empty(3 * len(data.vertices), np.float32) for _ in range(2))
    surface = np.empty(len(data.vertices), np.int32)
    data.vertices.foreach_get("co", points)
    try:
        data.attributes[INTENSITY].data.foreach_get("vector", intensity)
        data.attributes[SURFACE].data.foreach_get("value", surface)
    except KeyError as error:
        raise LightsphereError(f"the rig {item.name!r} has lost its lights' intensities; add the rig anew") from error
    matrix = np.array(item.matrix_world, np.float64)
    position = points.reshape(-1, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    lights = Lights("near", position, intensity.reshape(-1, 3).astype(np.float64), surface.astype(np.int64))
    lights.check()
    rig.check_apart(lights)
    return lights
