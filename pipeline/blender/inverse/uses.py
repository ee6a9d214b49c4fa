"""What recovered reflectances are good for, seen: another view, another light, a thing put in, a thing taken away."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from ...core.inverse import Model
from ...core.progress import Progress, Work
from ..ball import ball
from ..cycles import changed
from ..lamps import lamp
from ..meshes import add_mesh
from . import closures
from .room import Room

SAMPLES, SEED = 24, 3_000_000  # denoised
TURN = 12.0  # of the camera about what it looks at [degrees]
GRID = 24  # rays along each side of the picture
LEVEL = 0.9  # upward part of the normal of what a thing can stand on
BALL, MIRROR = 0.07, 0.9  # radius over the distance from the camera, and reflectance
LARGEST = 0.2  # share of the picture that a thing may cover that is taken away
POWER = 40.0  # of the lamp beside the camera over the squared distance [W/m^2]
DYE = np.array([0.4, 0.7, 1.0])  # of a group that is given another colour
ASIDE = (-0.35, 0.25)  # where it is, to the right and up, over the distance


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
    if not seen:
        return {}
    found = {}
    for number, way in enumerate(WAYS):
        with way(room, seen) as told:
            if told:
                scene.view_layers[0].update()
                found[told] = room.render(SAMPLES, SEED + number, denoised=True)
        yield Progress("what it is good for", number + 1, len(WAYS), "pictures")
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
def _another_view(room: Room, seen: list[Seen]) -> Iterator[str]:
    """Turn the camera about what is in the middle of the picture."""
    scene = room.scene
    pivot = min(seen, key=lambda one: one.off).point
    before = scene.camera.matrix_world.copy()
    about = Matrix.Translation(pivot) @ Matrix.Rotation(np.radians(TURN), 4, "Z") @ Matrix.Translation(-pivot)
    scene.camera.matrix_world = about @ before
    try:
        yield f"The camera, {TURN:g} degrees about."
    finally:
        scene.camera.matrix_world = before


@contextlib.contextmanager
def _another_light(room: Room, seen: list[Seen]) -> Iterator[str]:
    """Put the lamps out and a small one beside the camera."""
    scene = room.scene
    lamps = [item for item in scene.objects if item.type == "LIGHT" and not item.hide_render]
    reach = _reach(scene, seen)
    with lamp(scene, "near") as small, contextlib.ExitStack() as stack:
        small.data.energy, small.data.shadow_soft_size = POWER * reach**2, 0.02 * reach
        small.location = scene.camera.matrix_world @ Vector((ASIDE[0] * reach, ASIDE[1] * reach, 0.0))
        for item in lamps:
            stack.enter_context(changed(item, {"hide_render": True}))
        yield "The lamps out, a small one beside the camera." if lamps else ""


@contextlib.contextmanager
def _ball_put_in(room: Room, seen: list[Seen]) -> Iterator[str]:
    """Stand a mirror ball on the level place nearest to the middle of the picture."""
    scene = room.scene
    level = [one for one in seen if abs(one.normal.z) > LEVEL and one.point.z < scene.camera.matrix_world.translation.z]
    if not level:
        yield ""
        return
    place = min(level, key=lambda one: one.off).point
    radius = BALL * (place - scene.camera.matrix_world.translation).length
    mirror = closures.group_material("Lightsphere", "")
    closures.show(mirror, Model("mirror", np.zeros(3), np.full(3, MIRROR)), "")
    item = add_mesh(scene, "Lightsphere", ball(), mirror)
    item.scale, item.location = (radius,) * 3, place + Vector((0.0, 0.0, radius))
    try:
        yield "A mirror ball put in."
    finally:
        mesh = item.data
        bpy.data.objects.remove(item)
        bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(mirror)


@contextlib.contextmanager
def _thing_taken_away(room: Room, seen: list[Seen]) -> Iterator[str]:
    """Take the largest thing away of those that are no walls."""
    counts = {item: sum(one.item == item for one in seen) for item in {one.item for one in seen}}
    things = [item for item, count in counts.items() if count < LARGEST * GRID**2 and min(item.dimensions) > 0]
    if not things:
        yield ""
        return
    taken = max(things, key=lambda item: (counts[item], item.name))
    with changed(taken, {"hide_render": True}):
        yield f"{taken.name} taken away."


@contextlib.contextmanager
def _another_colour(room: Room, seen: list[Seen]) -> Iterator[str]:
    """Give the matt group that is seen most another colour."""
    counts = [
        sum(any(one.item == item for item, _ in group.slots) for one in seen) if model.level == "diffuse" else 0
        for group, model in zip(room.groups, room.models, strict=True)
    ]
    if not any(counts):
        yield ""
        return
    number = int(np.argmax(counts))
    colour = dataclasses.replace(room.models[number], diffuse=room.models[number].diffuse[::-1] * DYE)
    with room.trying(number, colour):
        yield f"{room.groups[number].name} in another colour."


Way = Callable[[Room, list[Seen]], contextlib.AbstractContextManager[str]]
WAYS: tuple[Way, ...] = (_another_view, _another_light, _ball_put_in, _thing_taken_away, _another_colour)
