"""The rig's lights drawn in the viewport: red where a capture would refuse them, the current frame's light larger."""

from __future__ import annotations

import time

import bpy

from ..pipeline.blender import geometry, rig
from ..pipeline.core.errors import LightsphereError
from . import results, windows

INTERVAL = 0.2  # [s] between two looks at whether something has moved
STILL = 0.3  # [s] without a move after which all triangles are looked at
USUAL, CURRENT, WRONG = (1.0, 0.85, 0.4, 0.9), (1.0, 1.0, 1.0, 1.0), (1.0, 0.15, 0.1, 1.0)
SMALL, LARGE = 5.0, 11.0  # [px]

_faults: dict[str, tuple[str, frozenset[int]]] = {}  # of each rig by its name: what is wrong, with which lights
_handlers: list[object] = []
_moved_at: float | None = 0.0  # when something last moved; None once that was looked at


def told(item: bpy.types.Object) -> str:
    """Return why a capture by a rig object would be refused where it stands, empty where nothing is wrong."""
    return _faults.get(item.name, ("", frozenset()))[0]


def examine(scene: bpy.types.Scene) -> None:
    """Find out which lights of the scene's rigs stand where none can."""
    _faults.clear()
    for item in results.rigs(scene):
        try:
            triangles = geometry.object_triangles(scene)
            positions = rig.lights_of(item).position
            wrong = geometry.inside_or_on(positions, triangles)
        except LightsphereError as error:
            _faults[item.name] = (str(error), frozenset(range(len(item.data.vertices))))
            continue
        if len(wrong):
            words = f"{len(wrong)} of {len(positions)} lights are inside the object"
            _faults[item.name] = (words, frozenset(int(i) for i in wrong))


def tick() -> float:
    """Look at the rigs once what has moved stands still; called by Blender's timer."""
    global _moved_at
    scene = bpy.context.scene  # none while a file is opened
    if _moved_at is None or time.monotonic() < _moved_at + STILL:
        return INTERVAL
    if scene is not None and results.rigs(scene):
        examine(scene)
        for _, area in windows.areas("VIEW_3D"):
            area.tag_redraw()
    _moved_at = None
    return INTERVAL


def draw() -> None:
    """Draw the lights of the scene's rigs; called by Blender for every viewport."""
    scene = bpy.context.scene
    for item in results.rigs(scene):
        if not item.visible_get():
            continue
        places = [item.matrix_world @ vertex.co for vertex in item.data.vertices]
        wrong = _faults.get(item.name, ("", frozenset()))[1]
        current = scene.frame_current - scene.frame_start
        _dots([place for number, place in enumerate(places) if number not in wrong], USUAL, SMALL)
        _dots([place for number, place in enumerate(places) if number in wrong], WRONG, LARGE)
        _dots(places[current : current + 1] if current >= 0 else [], CURRENT, LARGE)


def _dots(places: list[object], colour: tuple[float, ...], size: float) -> None:
    import gpu
    from gpu_extras.batch import batch_for_shader

    if not places:
        return
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    gpu.state.point_size_set(size)
    gpu.state.depth_test_set("LESS_EQUAL")
    shader.uniform_float("color", colour)
    batch_for_shader(shader, "POINTS", {"pos": places}).draw(shader)
    gpu.state.depth_test_set("NONE")


@bpy.app.handlers.persistent
def _moved(*_: object) -> None:
    global _moved_at
    _moved_at = time.monotonic()


def register() -> None:
    """Draw from now on, and look after everything that moves."""
    bpy.app.handlers.depsgraph_update_post.append(_moved)
    bpy.app.handlers.load_post.append(_moved)
    bpy.app.timers.register(tick, first_interval=INTERVAL, persistent=True)
    _handlers.append(bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", "POST_VIEW"))


def unregister() -> None:
    """Take all of it back."""
    bpy.types.SpaceView3D.draw_handler_remove(_handlers.pop(), "WINDOW")
    if bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)
    bpy.app.handlers.load_post.remove(_moved)
    bpy.app.handlers.depsgraph_update_post.remove(_moved)
    _faults.clear()
