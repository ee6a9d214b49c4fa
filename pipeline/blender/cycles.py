"""Cycles set up for measurement, and set back whatever happens."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ..core.camera import Camera
from ..core.errors import LightsphereError
from . import devices, exr, interrupts
from .camera import pixel_aspect
from .output import caught_output


@dataclass(frozen=True)
class Transport:
    """Which light paths Cycles follows, and with how many samples a pixel.

    Parameters
    ----------
    bounces : int
        Bounces after the first hit; 0 is direct light, which needs one sample and has no noise.
    diffuse, glossy, transmission : bool
        Kinds of bounce that count.
    caustics : bool
        Whether light may reach a diffuse bounce by a glossy surface or glass.
    samples : int
        A pixel.
    depth_of_field, motion_blur : bool
        Whether the camera has the lens and the exposure time that the scene gives it.
    """

    bounces: int = 0
    diffuse: bool = True
    glossy: bool = True
    transmission: bool = True
    caustics: bool = True
    samples: int = 1
    depth_of_field: bool = False
    motion_blur: bool = False


DIRECT = Transport()

RENDER: dict[str, Any] = {
    "engine": "CYCLES",
    "resolution_percentage": 100,
    "use_border": False,
    "use_freestyle": False,
    "use_compositing": False,
    "use_sequencer": False,
    "use_persistent_data": True,
    "use_file_extension": False,
    "use_overwrite": True,
    "use_placeholder": False,
    "use_multiview": False,
    "use_simplify": False,
    "film_transparent": False,
    "dither_intensity": 0.0,
    "metadata_input": "SCENE",
    "use_stamp": False,
}
STAMPS = (
    *("camera", "date", "filename", "frame", "frame_range", "hostname", "labels", "lens", "marker", "memory", "note"),
    *("render_time", "scene", "sequencer_strip", "time"),
)
CYCLES: dict[str, Any] = {
    "pixel_filter_type": "BLACKMAN_HARRIS",
    "filter_width": 0.01,
    "light_sampling_threshold": 0.0,
    "min_light_bounces": 0,
    "min_transparent_bounces": 0,
    "transparent_max_bounces": 32,
    "blur_glossy": 0.0,
    "sample_clamp_direct": 0.0,
    "sample_clamp_indirect": 0.0,
    "use_adaptive_sampling": False,
    "use_denoising": False,
    "use_guiding": False,
    "use_animated_seed": False,
    "use_sample_subset": False,
    "use_layer_samples": "IGNORE",
    "use_fast_gi": False,
    "use_camera_cull": False,
    "use_distance_cull": False,
    "film_exposure": 1.0,
    "time_limit": 0.0,
}


@contextlib.contextmanager
def changed(owner: Any, values: dict[str, Any]) -> Iterator[None]:
    """Give a bpy struct other values for a while.

    What is the same already is not set: Cycles would take it for changed, and a sky costs seconds to make anew.
    """
    with contextlib.ExitStack() as stack:
        for name, value in values.items():
            stack.callback(_set, owner, name, getattr(owner, name))
            _set(owner, name, value)
        yield


def _set(owner: Any, name: str, value: Any) -> None:
    if getattr(owner, name) != value:
        setattr(owner, name, value)


@contextlib.contextmanager
def measuring(
    scene: bpy.types.Scene,
    camera: Camera,
    transport: Transport,
    seed: int = 0,
    threads: int = 0,
    world: bpy.types.World | None = None,
) -> Iterator[None]:
    """Set a scene up for linear, unfiltered, unclamped pictures of a camera's size and the given light paths.

    No world shines but one that is given.

    Blackman-Harris of the smallest width samples pixel centres, to the rounding of float32, so that direct light at
    one sample has no noise. The box ignores its width: Cycles spreads it over the whole pixel, and places the first
    sample half a step of its table of 1024, 0.0005 px, beside the centre.
    """
    light = {
        "samples": transport.samples,
        "seed": seed,
        "max_bounces": transport.bounces,
        "diffuse_bounces": transport.bounces if transport.diffuse else 0,
        "glossy_bounces": transport.bounces if transport.glossy else 0,
        "transmission_bounces": transport.bounces if transport.transmission else 0,
        "volume_bounces": transport.bounces,
        "caustics_reflective": transport.caustics,
        "caustics_refractive": transport.caustics,
    }
    render = RENDER | {f"use_stamp_{name}": False for name in STAMPS}
    width, height = camera.resolution
    render |= {"use_motion_blur": transport.motion_blur and scene.render.use_motion_blur}
    render |= {"resolution_x": width, "resolution_y": height, "filepath": scene.render.filepath}
    render |= dict(zip(("pixel_aspect_x", "pixel_aspect_y"), pixel_aspect(camera), strict=True))
    render |= {"threads_mode": "FIXED", "threads": threads} if threads else {}
    lens = scene.camera.data.dof
    with contextlib.ExitStack() as stack:
        stack.enter_context(changed(scene, {"world": world}))
        stack.enter_context(changed(scene.render, render))
        stack.enter_context(changed(scene.cycles, CYCLES | devices.cycles_values() | light))
        stack.enter_context(changed(lens, {"use_dof": transport.depth_of_field and lens.use_dof}))
        for layer in scene.view_layers[1:]:
            stack.enter_context(changed(layer, {"use": False}))
        stack.enter_context(changed(scene.view_layers[0], {"use": True, "material_override": None}))
        yield


def forget(scene: bpy.types.Scene) -> None:
    """Let Cycles build a scene anew that it keeps between renders: it may take a new image for one that was removed."""
    with changed(scene.render, {"use_persistent_data": False}):
        pass  # setting it frees what is kept


@contextlib.contextmanager
def cropped(scene: bpy.types.Scene, camera: Camera, window: tuple[slice, slice] | None) -> Iterator[None]:
    """Render only some rows and columns of a camera's pictures for a while, or all of them."""
    if window is None:
        yield
        return
    width, height = camera.resolution
    rows, columns = window
    inside = 0.25  # of a pixel: Blender rounds down to whole ones, and its floats are short
    border = {"border_min_x": (columns.start + inside) / width, "border_max_x": (columns.stop + inside) / width}
    border |= {"border_min_y": (height - rows.stop + inside) / height}
    border |= {"border_max_y": (height - rows.start + inside) / height}
    with changed(scene.render, border | {"use_border": True, "use_crop_to_border": True}):
        yield


@contextlib.contextmanager
def openexr(scene: bpy.types.Scene, layers: bool = False, pixel_type: str = "float") -> Iterator[None]:
    """Let renders be written as OpenEXR for a while: RGB of ``"float"`` or ``"half"``, or all passes as layers.

    Blender 5 wants the kind of medium first, and choosing it resets the depth.
    """
    image = scene.render.image_settings
    values = {
        "file_format": "OPEN_EXR_MULTILAYER" if layers else "OPEN_EXR",
        "color_mode": "RGBA" if layers else "RGB",
        "color_depth": "16" if pixel_type == "half" else "32",
        "exr_codec": "ZIP",
        "color_management": "FOLLOW_SCENE",
    }
    if hasattr(image, "media_type"):
        values = {"media_type": "MULTI_LAYER_IMAGE" if layers else "IMAGE", **values}
    before = {name: getattr(image, name) for name in values}
    try:
        for name, value in values.items():
            setattr(image, name, value)
        yield
    finally:
        for name, value in before.items():
            setattr(image, name, value)


@contextlib.contextmanager
def own_lights_hidden(scene: bpy.types.Scene) -> Iterator[None]:
    """Hide the scene's own lights from renders for a while."""
    with contextlib.ExitStack() as stack:
        for item in scene.objects:
            if item.type == "LIGHT":
                stack.enter_context(changed(item, {"hide_render": True}))
        yield


@contextlib.contextmanager
def meshes_cached(scene: bpy.types.Scene) -> Iterator[None]:
    """Give every mesh a second user for a while, tiny, far away and out of every ray's sight.

    Cycles bakes a mesh with one user into the scene's ray tree, which any change of a light then builds anew:
    25 ms a picture for 65,000 triangles. A mesh with two users keeps a tree of its own. A mesh under modifiers is
    left alone: its copy would not share the result.
    """
    copies = []
    for item in list(scene.objects):
        if item.type != "MESH" or item.hide_render or item.modifiers or item.data.users > 1:
            continue
        copy = bpy.data.objects.new(item.name, item.data)
        copy.location = (1e4, 1e4, 1e4)
        copy.scale = (1e-6, 1e-6, 1e-6)
        for ray in ("camera", "diffuse", "glossy", "transmission", "shadow"):
            setattr(copy, f"visible_{ray}", False)
        scene.collection.objects.link(copy)
        copies.append(copy)
    try:
        yield
    finally:
        for copy in copies:
            bpy.data.objects.remove(copy)


def render(scene: bpy.types.Scene, path: Path) -> None:
    """Render the scene to a file that is whole or not there.

    Raises
    ------
    LightsphereError
        When the file cannot be written.
    """
    partial = exr.partial_name(path)
    scene.render.filepath = str(partial)
    with interrupts.deferred(), caught_output() as output:
        try:
            bpy.ops.render.render(write_still=True, scene=scene.name)
            exr.finish(partial)
            partial.replace(path)
        except (RuntimeError, OSError, struct.error, LookupError, ValueError) as error:
            partial.unlink(missing_ok=True)
            output.seek(0)
            lines = [line for line in output.read().decode(errors="replace").splitlines() if "ERROR" in line.upper()]
            reason = " ".join(str(lines[-1] if lines else error).split())
            raise LightsphereError(
                f"{path} cannot be written ({reason}); free space, then run again to continue"
            ) from error
