"""What recovered reflectances are good for, seen: another view, another light, a thing put in, a thing taken away."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from ...core.progress import Progress, Work
from ..cycles import changed
from .room import Room

SAMPLES, SEED = 24, 3_000_000  # denoised
TURN = 12.0  # of the camera about what it looks at [degrees]
GRID = 24  # rays along each side of the picture
LEVEL = 0.9  # upward part of the normal of what a thing can stand on
BALL = 0.07  # radius over the distance from the camera
LARGEST = 0.2  # share of the picture that a thing may cover that is taken away
ASIDE = (-0.35, 0.25)  # of the lamp beside the camera, to its right and up, over the distance


@dataclass(frozen=True)
class Seen:
    """What a ray through the picture meets."""

    item: bpy.types.Object
    point: Vector
    normal: Vector
    off: float  # from the picture's middle, over half its sides


def pictures(room: Room) -> Work[dict[str, NDArray[np.float64]]]:
    """Render the room as it was found in other ways than the photograph shows it, (H, W, 3) by what is done.

    The scene is left as it was. What cannot be done in it is left out: a ball needs a level place.
    """
    scene = room.scene
    scene.view_layers[0].update()
    seen = list(_seen(scene))
    ways: list[Callable[[bpy.types.Scene, list[Seen]], contextlib.AbstractContextManager[str]]]
    ways = [_another_view, _another_light, _ball_put_in, _thing_taken_away]
    found = {}
    for number, way in enumerate(ways):
        with way(scene, seen) as told:
            if told:
                scene.view_layers[0].update()
                found[told] = room.render(SAMPLES, SEED + number, denoised=True)
        yield Progress("what it is good for", number + 1, len(ways), "pictures")
    return found


def _seen(scene: bpy.types.Scene) -> Iterator[Seen]:
    """Yield what a grid of rays meets."""
    camera = scene.camera
    corners = camera.data.view_frame(scene=scene)
    right, low, left = corners[0], corners[1], corners[2]
    graph = scene.view_layers[0].depsgraph
    for a in (np.arange(GRID) + 0.5) / GRID:
        for b in (np.arange(GRID) + 0.5) / GRID:
            on_frame = left + (low - left) * a + (right - low) * b
            start = camera.matrix_world.translation
            if camera.data.type == "ORTHO":
                start = camera.matrix_world @ Vector((on_frame.x, on_frame.y, 0.0))
            towards = (camera.matrix_world @ on_frame - start).normalized()
            met, point, normal, _, item, _ = scene.ray_cast(graph, start, towards)
            if met and item is not None:
                yield Seen(item.original, point, normal, float(np.hypot(2 * a - 1, 2 * b - 1)))


def _reach(scene: bpy.types.Scene, seen: list[Seen]) -> float:
    """Return the distance from the camera to what is in the middle [m]."""
    middle = min(seen, key=lambda one: one.off)
    return float((middle.point - scene.camera.matrix_world.translation).length)


@contextlib.contextmanager
def _another_view(scene: bpy.types.Scene, seen: list[Seen]) -> Iterator[str]:
    """Turn the camera about what is in the middle of the picture."""
    if not seen:
        yield ""
        return
    pivot = min(seen, key=lambda one: one.off).point
    before = scene.camera.matrix_world.copy()
    about = Matrix.Translation(pivot) @ Matrix.Rotation(np.radians(TURN), 4, "Z") @ Matrix.Translation(-pivot)
    scene.camera.matrix_world = about @ before
    try:
        yield f"The camera, {TURN:g} degrees about."
    finally:
        scene.camera.matrix_world = before


@contextlib.contextmanager
def _another_light(scene: bpy.types.Scene, seen: list[Seen]) -> Iterator[str]:
    """Put the lamps out and a small one beside the camera."""
    lamps = [item for item in scene.objects if item.type == "LIGHT" and not item.hide_render]
    if not seen or not lamps:
        yield ""
        return
    reach = _reach(scene, seen)
    data = bpy.data.lights.new("Lightsphere", "POINT")
    data.energy, data.shadow_soft_size = 40.0 * reach**2, 0.02 * reach
    lamp = bpy.data.objects.new("Lightsphere", data)
    lamp.location = scene.camera.matrix_world @ Vector((ASIDE[0] * reach, ASIDE[1] * reach, 0.0))
    scene.collection.objects.link(lamp)
    try:
        with contextlib.ExitStack() as stack:
            for item in lamps:
                stack.enter_context(changed(item, {"hide_render": True}))
            yield "The lamps out, a small one beside the camera."
    finally:
        bpy.data.objects.remove(lamp)
        bpy.data.lights.remove(data)


@contextlib.contextmanager
def _ball_put_in(scene: bpy.types.Scene, seen: list[Seen]) -> Iterator[str]:
    """Stand a mirror ball on the level place nearest to the middle of the picture."""
    level = [one for one in seen if abs(one.normal.z) > LEVEL and one.point.z < scene.camera.matrix_world.translation.z]
    if not level:
        yield ""
        return
    place = min(level, key=lambda one: one.off).point
    radius = BALL * (place - scene.camera.matrix_world.translation).length
    mesh = bpy.data.meshes.new("Lightsphere")
    made = bpy.data.materials.new("Lightsphere")
    if bpy.app.version < (5, 0):
        made.use_nodes = True
    closure = made.node_tree.nodes["Principled BSDF"].inputs
    closure["Metallic"].default_value, closure["Roughness"].default_value = 1.0, 0.03
    _round(mesh, radius)
    mesh.materials.append(made)
    ball = bpy.data.objects.new("Lightsphere", mesh)
    ball.location = place + Vector((0.0, 0.0, radius))
    scene.collection.objects.link(ball)
    try:
        yield "A mirror ball put in."
    finally:
        bpy.data.objects.remove(ball)
        bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(made)


@contextlib.contextmanager
def _thing_taken_away(scene: bpy.types.Scene, seen: list[Seen]) -> Iterator[str]:
    """Take the largest thing away of those that are no walls."""
    counts = {item: sum(one.item == item for one in seen) for item in {one.item for one in seen}}
    things = [item for item, count in counts.items() if count < LARGEST * GRID**2 and min(item.dimensions) > 0]
    if not things:
        yield ""
        return
    taken = max(things, key=lambda item: (counts[item], item.name))
    with changed(taken, {"hide_render": True}):
        yield f"{taken.name} taken away."


def _round(mesh: bpy.types.Mesh, radius: float) -> None:
    """Make a mesh a smooth ball."""
    import bmesh  # only after bpy

    made = bmesh.new()
    bmesh.ops.create_uvsphere(made, u_segments=64, v_segments=32, radius=radius)
    made.to_mesh(mesh)
    made.free()
    mesh.shade_smooth()
