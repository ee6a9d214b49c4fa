"""The lights of a Blender scene, and the environment it stands in, as emitters that a capture is relit by.

Taken from Cycles: a point or spot of W watts shines with I = W / (4 pi) [W/sr], an area of A m^2 with
L = W / (pi A) to its front, a sun's strength is its irradiance; colour, temperature and exposure multiply. Not
modelled: nodes of lights, spread of areas, portals, light linking, the radius of spots, and the soft falloff of a ball,
(radius / distance)^2.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.errors import LightsphereError
from ..core.relight import emitters as shapes
from ..core.relight.emitters import Emitter

GRID = 8  # elements along each side of a rectangle, or as many over a disk, ball or sun


def of_scene(scene: bpy.types.Scene) -> list[Emitter]:
    """Return the emitters of every light that the scene renders.

    Raises
    ------
    LightsphereError
        When there is none, or one of them shines through nodes.
    """
    scene.view_layers[0].update()
    found = []
    for item in scene.objects:
        if item.type == "LIGHT" and not item.hide_render:
            found += _of_light(item)
    if not found:
        raise LightsphereError(f"the scene {scene.name!r} has no light that renders; add one and save it")
    return found


def _of_light(item: bpy.types.Object) -> list[Emitter]:
    light = item.data
    if light.node_tree and any(node.type not in ("EMISSION", "OUTPUT_LIGHT") for node in light.node_tree.nodes):
        raise LightsphereError(f"the light {item.name!r} shines through nodes; remove them, or leave it out of renders")
    power = light.energy * 2.0**light.exposure * np.array(light.color)
    if light.use_temperature:
        power = power * np.array(light.temperature_color)
    if not (power > 0).any():
        return []
    matrix = np.array(item.matrix_world, np.float64)
    place = matrix[:3, 3]
    stretch = np.linalg.norm(matrix[:3, :3], axis=0)
    axes = matrix[:3, :3] / stretch
    forward = axes * np.array([1.0, -1.0, -1.0])  # lights shine along their -z
    if light.type == "SUN":
        return _sun(axes, power, light.angle)
    if light.type == "AREA":
        return _area(item, matrix, forward[:, 2], power)
    intensity = power / (4 * np.pi)
    if light.type == "SPOT":
        relative = (float(stretch[0] / stretch[2]), float(stretch[1] / stretch[2]))
        profile = shapes.SpotProfile(light.spot_size, light.spot_blend, relative)
        return [shapes.spot(place, forward, intensity, profile)]
    if light.shadow_soft_size > 0:
        return shapes.ball(place, light.shadow_soft_size, intensity, GRID**2)
    return [shapes.point(place, intensity)]


def _sun(axes: NDArray[np.float64], irradiance: NDArray[np.float64], angle: float) -> list[Emitter]:
    """Return the directions of a sun's disk of some angle [rad], of equal shares of the irradiance below the sun."""
    offsets = 2 * np.sin(angle / 2) * shapes.disk(GRID**2) if angle > 0 else np.zeros((1, 2))
    heights = np.sqrt(1 - (offsets**2).sum(axis=1))
    share = irradiance / len(offsets)
    return [shapes.distant(axes @ [x, y, z], share / z) for (x, y), z in zip(offsets, heights, strict=True)]


def _area(
    item: bpy.types.Object, matrix: NDArray[np.float64], normal: NDArray[np.float64], power: NDArray[np.float64]
) -> list[Emitter]:
    light = item.data
    size = np.array([light.size, light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size])
    is_round = light.shape in ("DISK", "ELLIPSE")
    local = (shapes.disk(GRID**2) if is_round else shapes.rectangle(GRID)) * size
    points = local @ matrix[:3, :2].T + matrix[:3, 3]
    whole = np.linalg.norm(np.cross(matrix[:3, 0], matrix[:3, 1])) * size.prod() * (np.pi / 4 if is_round else 1.0)
    radiance = power / np.pi / (whole if light.normalize else 1.0)
    areas = np.full(len(points), whole / len(points))
    return shapes.area(points, np.tile(normal, (len(points), 1)), areas, radiance)
