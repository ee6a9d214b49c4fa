"""The lights of a Blender scene, and the environment it stands in, as emitters that a capture is relit by.

Taken from Cycles: a point or spot of W watts shines with I = W / (4 pi) [W/sr], an area of A m^2 with
L = W / (pi A) to its front, a sun's strength is its irradiance; colour, temperature and exposure multiply. What nodes
make of a light, IES profiles among it, is measured: :mod:`.lamp_nodes`. Not modelled: portals, light linking, and the
soft falloff of a ball, (radius / distance)^2.
"""

from __future__ import annotations

import dataclasses

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.errors import LightsphereError
from ..core.relight import emitters as shapes
from ..core.relight.emitters import Emitter
from ..core.relight.profiles import SpotProfile, SpreadProfile, TableProfile
from ..core.rig import sphere
from . import lamp_nodes

GRID = 8  # elements along each side of a rectangle, or as many over a disk, ball or sun


def of_scene(scene: bpy.types.Scene, measure: bool = True) -> list[Emitter]:
    """Return the emitters of every light that the scene renders.

    Parameters
    ----------
    scene : bpy.types.Scene
    measure : bool
        Render what nodes make of a light; else such lights are refused.

    Raises
    ------
    LightsphereError
        When there is no light, or one shines through nodes and is not to be measured.
    """
    scene.view_layers[0].update()
    found = []
    for item in scene.objects:
        if item.type != "LIGHT" or item.hide_render:
            continue
        if not lamp_nodes.shape_its_light(item.data):
            found += _of_light(item)
        elif measure:
            found += _of_nodes(item)
        else:
            raise LightsphereError(f"the light {item.name!r} shines through nodes, which are not followed live")
    if not found:
        raise LightsphereError(f"the scene {scene.name!r} has no light that renders; add one and save it")
    return found


def _of_light(item: bpy.types.Object) -> list[Emitter]:
    light = item.data
    power = light.energy * 2.0**light.exposure * np.array(light.color)
    if light.use_temperature:
        power = power * np.array(light.temperature_color)
    if not (power > 0).any():
        return []
    place, forward, stretch = _placed(item)
    if light.type == "SUN":
        return _sun(forward, power, light.angle)
    if light.type == "AREA":
        points, whole = _surface(item)
        radiance = power / np.pi / (whole if light.normalize else 1.0)
        areas = np.full(len(points), whole / len(points))
        found = shapes.area(points, np.tile(forward[:, 2], (len(points), 1)), areas, radiance)
        if light.spread < np.pi:
            spread = SpreadProfile(light.spread)
            found = [dataclasses.replace(one, to_world=forward, profile=spread) for one in found]
        return found
    intensity = power / (4 * np.pi)
    if light.shadow_soft_size > 0:
        found = shapes.ball(place, light.shadow_soft_size, intensity, GRID**2)
    else:
        found = [shapes.point(place, intensity)]
    if light.type == "SPOT":
        cone = SpotProfile(light.spot_size, light.spot_blend, (stretch[0] / stretch[2], stretch[1] / stretch[2]))
        found = [dataclasses.replace(one, to_world=forward, profile=cone) for one in found]
    return found


def _of_nodes(item: bpy.types.Object) -> list[Emitter]:
    """Return the emitters of a light that shines through nodes, as Cycles renders it from afar.

    A ball or area is as large as it is, and shines from all of it alike; a picture on an area is not told apart.
    """
    light = item.data
    place, forward, _ = _placed(item)
    if light.type == "SUN":
        irradiance = lamp_nodes.irradiance(item)
        return _sun(forward, irradiance, light.angle) if irradiance.any() else []
    table = TableProfile(lamp_nodes.intensity(item))
    if not table.values.any():
        return []
    if light.type == "AREA":
        points, _ = _surface(item)
    else:
        points = place + light.shadow_soft_size * (sphere(GRID**2) if light.shadow_soft_size > 0 else np.zeros((1, 3)))
    share = np.full(3, 1.0 / len(points))
    return [Emitter(point, share, to_world=forward, profile=table) for point in points]


def _placed(item: bpy.types.Object) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return place (3,), axes in the world whose z the light shines along (3, 3), and scale along them (3,)."""
    matrix = np.array(item.matrix_world, np.float64)
    stretch = np.linalg.norm(matrix[:3, :3], axis=0)
    return matrix[:3, 3], matrix[:3, :3] / stretch * lamp_nodes.FORWARD, stretch


def _sun(forward: NDArray[np.float64], irradiance: NDArray[np.float64], angle: float) -> list[Emitter]:
    """Return the directions of a sun's disk of some angle [rad], of equal shares of the irradiance below the sun."""
    offsets = 2 * np.sin(angle / 2) * shapes.disk(GRID**2) if angle > 0 else np.zeros((1, 2))
    heights = np.sqrt(1 - (offsets**2).sum(axis=1))
    share = irradiance / len(offsets)
    return [shapes.distant(forward @ [x, y, -z], share / z) for (x, y), z in zip(offsets, heights, strict=True)]


def _surface(item: bpy.types.Object) -> tuple[NDArray[np.float64], float]:
    """Return points spread evenly over an area light, (N, 3) [m], and its area [m^2]."""
    light, matrix = item.data, np.array(item.matrix_world, np.float64)
    size = np.array([light.size, light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size])
    is_round = light.shape in ("DISK", "ELLIPSE")
    local = (shapes.disk(GRID**2) if is_round else shapes.rectangle(GRID)) * size
    whole = np.linalg.norm(np.cross(matrix[:3, 0], matrix[:3, 1])) * size.prod() * (np.pi / 4 if is_round else 1.0)
    return local @ matrix[:3, :2].T + matrix[:3, 3], float(whole)
