"""Pictures joined to a film by the encoder that Blender brings along."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..core.errors import LightsphereError
from .output import caught_output

SMALLEST = 256  # pixels; smaller pictures are enlarged


def encode(folder: Path, prefix: str, count: int, path: Path, rate: int) -> None:
    """Encode the pictures ``PREFIX0000.png`` and on as H.264 in an .mp4, in an empty scene of this Blender.

    Raises
    ------
    LightsphereError
        When this Blender cannot encode films; the pictures are kept.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    first = folder / f"{prefix}0000.png"
    picture = bpy.data.images.load(str(first.resolve()))
    factor = max(1, -(-SMALLEST // max(picture.size)))
    render = scene.render
    render.resolution_x, render.resolution_y = (2 * (factor * side // 2) for side in picture.size)
    render.resolution_percentage, render.fps, render.use_sequencer = 100, rate, True
    editor = scene.sequence_editor_create()
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    strip = strips.new_image("film", str(first.resolve()), 1, 1, fit_method="FIT")  # to the resolution set above
    for number in range(1, count):
        strip.elements.append(f"{prefix}{number:04d}.png")
    strip.frame_final_duration = count
    scene.frame_start, scene.frame_end = 1, count
    scene.view_settings.view_transform = "Standard"
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "VIDEO"
    render.image_settings.file_format = "FFMPEG"
    render.ffmpeg.format, render.ffmpeg.codec = "MPEG4", "H264"
    render.ffmpeg.constant_rate_factor, render.ffmpeg.gopsize = "HIGH", rate
    partial = path.with_name(f".{path.name}.part.mp4")
    render.use_file_extension, render.filepath = False, str(partial.resolve())
    try:
        with caught_output():
            bpy.ops.render.render(animation=True)
        partial.replace(path)
    except (RuntimeError, OSError) as error:
        partial.unlink(missing_ok=True)
        reason = " ".join(str(error).split())
        raise LightsphereError(f"{path} cannot be encoded ({reason}); the pictures {prefix}*.png are there") from error
