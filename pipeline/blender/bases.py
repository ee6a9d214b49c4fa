"""The bases of a recovered material in a scene: where an asset shows most of each, and balls that show each alone."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

from ..core.camera import Camera
from ..core.errors import LightsphereError
from . import truth
from .asset import MARK
from .ball import ball
from .geometry import BACKDROP
from .meshes import add_mesh
from .mixtures import basis_material, group_of, weight_maps

OF = "lightsphere_basis_of"  # property of a ball: the object whose basis it shows
RADIUS = 0.1  # of a ball, in the asset's largest extent
APART = 2.5  # radii between the centres of two balls


def shown(scene: bpy.types.Scene, camera: Camera) -> dict[str, NDArray[np.bool_]]:
    """Return where a camera shows most of each basis of the scene's assets, (H, W) by names; nothing for one basis.

    The weight maps say it: what an artist changed at the sliders counts for nothing.
    """
    found: dict[str, NDArray[np.bool_]] = {}
    mixed = {
        material: maps
        for item in scene.objects
        if MARK in item
        for material, maps in _materials(item).items()
        if len(maps) > 1
    }
    if not mixed:
        return found
    hits, numbers = truth.first_hits(scene, camera), truth.numbered(scene)
    for material, maps in mixed.items():
        seen = hits.material == numbers[material]
        most = np.stack([_looked_up(weights.mean(axis=-1), hits.uv[seen]) for weights in maps]).argmax(axis=0)
        prefix = f"{material.name} " if len(mixed) > 1 else ""
        for k in range(len(maps)):
            found[f"{prefix}basis {k + 1}"] = seen.copy()
            found[f"{prefix}basis {k + 1}"][seen] = most == k
    return found


def _materials(item: bpy.types.Object) -> dict[bpy.types.Material, list[NDArray[np.float32]]]:
    """Return the materials of an object that have bases, with their weight maps."""
    groups = {slot.material: group_of(slot.material) for slot in item.material_slots if slot.material}
    return {material: weight_maps(group) for material, group in groups.items() if group}


def _looked_up(values: NDArray[np.float32], uv: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the texels of a map (H, W), rows top-down, at coordinates (N, 2)."""
    rows, columns = values.shape
    row = np.clip(((1 - uv[:, 1]) * rows).astype(np.int64), 0, rows - 1)
    column = np.clip((uv[:, 0] * columns).astype(np.int64), 0, columns - 1)
    return np.asarray(values[row, column])


def add_balls(scene: bpy.types.Scene, item: bpy.types.Object) -> list[bpy.types.Object]:
    """Add a ball of every basis of an asset's materials in a column to its right, as the scene's camera sees it.

    Balls that stood there before are replaced; what captures the scene takes them for surroundings.

    Raises
    ------
    LightsphereError
        When no material of the object has bases.
    """
    wanted = [(material, k + 1) for material, maps in _materials(item).items() for k in range(len(maps))]
    if not wanted:
        raise LightsphereError(
            f"the material of {item.name!r} has one lobe for every place and no bases; recover the reflectance by "
            "bivariate, and make it anew"
        )
    for before in [other for other in scene.objects if other.get(OF) == item.name]:
        bpy.data.objects.remove(before)
    corners = np.array([item.matrix_world @ Vector(corner) for corner in item.bound_box])
    radius = RADIUS * float(np.ptp(corners, axis=0).max())
    turned = scene.camera.matrix_world.to_3x3().normalized() if scene.camera else np.eye(3)
    right, up = np.array(turned)[:, 0], np.array(turned)[:, 1]
    middle = corners.mean(axis=0)
    beside = middle + right * (((corners - middle) @ right).max() + 1.5 * radius)
    mesh, made = ball(), []
    for number, (material, k) in enumerate(wanted):
        name = f"{material.name} basis {k}"
        one = add_mesh(scene, name, mesh, basis_material(name, material, k))
        one.location = beside + up * radius * APART * ((len(wanted) - 1) / 2 - number)
        one.scale = [radius] * 3
        one[OF], one[BACKDROP] = item.name, True
        made.append(one)
    return made
