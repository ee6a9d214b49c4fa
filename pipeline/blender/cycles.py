"""Cycles set up for measurement, and set back whatever happens."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import Any

import bpy

# Noise-free direct light at pixel centres: one sample, box filter of vanishing width.
# Bounced light needs many samples, over which the box would average the whole pixel.
FILTER_WIDTH = 0.01
DIRECT = {"samples": 1, "pixel_filter_type": "BOX", "max_bounces": 0}
FULL = {"pixel_filter_type": "BLACKMAN_HARRIS", "max_bounces": 12}
ALWAYS: dict[str, Any] = {
    "device": "CPU",
    "filter_width": FILTER_WIDTH,
    "diffuse_bounces": 12,
    "glossy_bounces": 12,
    "transmission_bounces": 12,
    "transparent_max_bounces": 32,
    "caustics_reflective": True,
    "caustics_refractive": True,
    "blur_glossy": 0.0,
    "light_sampling_threshold": 0.0,
    "sample_clamp_direct": 0.0,
    "sample_clamp_indirect": 0.0,
    "use_adaptive_sampling": False,
    "use_denoising": False,
    "use_animated_seed": False,
    "use_fast_gi": False,
    "film_exposure": 1.0,
    "time_limit": 0.0,
}
RENDER: dict[str, Any] = {
    "engine": "CYCLES",
    "resolution_percentage": 100,
    "pixel_aspect_x": 1.0,
    "pixel_aspect_y": 1.0,
    "use_border": False,
    "use_motion_blur": False,
    "use_compositing": False,
    "use_sequencer": False,
    "use_persistent_data": True,
    "use_file_extension": False,
    "use_overwrite": True,
    "use_stamp": False,
    "use_multiview": False,
    "film_transparent": False,
    "use_simplify": False,
    "dither_intensity": 0.0,
}
STAMPS = (
    *("camera", "date", "filename", "frame", "frame_range", "hostname", "labels", "lens", "marker", "memory", "note"),
    *("render_time", "scene", "sequencer_strip", "time"),
)


@contextlib.contextmanager
def changed(owner: Any, values: dict[str, Any]) -> Iterator[None]:
    """Give a bpy struct other values for a while, restoring them in reverse order."""
    before = {name: getattr(owner, name) for name in values}
    try:
        for name, value in values.items():
            setattr(owner, name, value)
        yield
    finally:
        for name, value in reversed(before.items()):
            setattr(owner, name, value)


@contextlib.contextmanager
def measuring(scene: bpy.types.Scene, resolution: int, effects: str, samples: int, seed: int) -> Iterator[None]:
    """Set a scene up for linear, unfiltered, unclamped square pictures of ``"direct"`` or ``"full"`` light."""
    render = {**RENDER, **{f"use_stamp_{name}": False for name in STAMPS}}
    render |= {"resolution_x": resolution, "resolution_y": resolution, "filepath": scene.render.filepath}
    light = DIRECT if effects == "direct" else {**FULL, "samples": samples}
    image = scene.render.image_settings
    with contextlib.ExitStack() as stack:
        stack.enter_context(changed(scene, {"world": None}))
        stack.enter_context(changed(scene.render, render))
        stack.enter_context(changed(scene.cycles, {**ALWAYS, **light, "seed": seed}))
        stack.enter_context(_image_settings(image))
        stack.enter_context(changed(scene.camera.data.dof, {"use_dof": False}))
        yield


@contextlib.contextmanager
def _image_settings(image: Any) -> Iterator[None]:
    names = ["file_format", "color_mode", "color_depth", "exr_codec", "color_management"]
    if hasattr(image, "media_type"):
        names.insert(0, "media_type")
    before = {name: getattr(image, name) for name in names}
    try:
        image_format(image, "OPEN_EXR", "RGB", "32")
        yield
    finally:
        for name, value in before.items():
            setattr(image, name, value)


def image_format(image: Any, file_format: str, mode: str, depth: str) -> None:
    """Choose OpenEXR with one layer or many; Blender 5 wants the kind of medium first, which resets the depth."""
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE" if file_format.endswith("MULTILAYER") else "IMAGE"
    image.file_format = file_format
    image.color_mode = mode
    image.color_depth = depth
    image.exr_codec = "ZIP"
    image.color_management = "FOLLOW_SCENE"


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Keep Blender's own lines off the standard output, which Python cannot catch."""
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        with open(os.devnull, "wb") as sink:
            os.dup2(sink.fileno(), 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def render(scene: bpy.types.Scene, path: str) -> None:
    """Render the scene to a file."""
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True, scene=scene.name)
