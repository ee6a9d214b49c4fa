"""The light rig as one object that the artist sees, moves and scales: a vertex per light."""

from __future__ import annotations

import bpy
import numpy as np

from ..core import rig
from ..core.errors import LightsphereError
from ..core.lights import Lights

MARK = "lightsphere_rig"
NAME = "Light Rig"
INTENSITY, SURFACE = "intensity", "surface"


def add(scene: bpy.types.Scene, lights: Lights) -> bpy.types.Object:
    """Add near lights to a scene as a wire object that no render shows; moving or scaling it moves the lights."""
    data = bpy.data.meshes.new(NAME)
    edges = []
    for surface in np.unique(lights.surface):
        index = np.flatnonzero(lights.surface == surface)
        points = lights.position[index]
        edges.extend(index[rig.edges(points, points.mean(axis=0))].tolist())
    centre = lights.position.mean(axis=0)
    data.from_pydata((lights.position - centre).tolist(), edges, [])
    intensity = data.attributes.new(INTENSITY, "FLOAT_VECTOR", "POINT")
    intensity.data.foreach_set("vector", lights.intensity.astype(np.float32).ravel())
    surfaces = data.attributes.new(SURFACE, "INT", "POINT")
    surfaces.data.foreach_set("value", lights.surface.astype(np.int32))
    item = bpy.data.objects.new(NAME, data)
    item[MARK] = True
    item.location = centre
    item.hide_render = True
    item.display_type = "WIRE"
    scene.collection.objects.link(item)
    return item


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
