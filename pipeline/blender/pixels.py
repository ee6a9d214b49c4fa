"""Blender's images from arrays and back: the one place where rows are flipped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from ..core import images
from ..core.errors import LightsphereError
from .output import caught_output


def packed_image(name: str, values: NDArray[Any]) -> bpy.types.Image:
    """Make a float image that is stored inside the .blend.

    Parameters
    ----------
    name : str
    values : (H, W, 1 to 4) or (H, W) float
        Linear, rows top-down, finite. One channel is grey; a second and third that are missing are 0; a fourth is kept
        in alpha, beside the others and not multiplied into them.

    Returns
    -------
    bpy.types.Image
        Without a colour space (Non-Color): a shader reads the very numbers.
    """
    height, width = values.shape[:2]
    values = values.reshape(height, width, -1)
    channels = values.shape[2]
    image = bpy.data.images.new(name, width, height, alpha=channels == 4, float_buffer=True, is_data=True)
    image.alpha_mode = "CHANNEL_PACKED"
    rgba = np.zeros((height, width, 4), np.float32)
    rgba[..., 3] = 1.0
    rgba[..., : max(channels, 3 * (channels == 1))] = values
    image.pixels.foreach_set(rgba[::-1].ravel())
    image.pack()
    return image


def byte_image(name: str, values: NDArray[Any], colour: bool) -> bpy.types.Image:
    """Make an image of 8 bits that is stored inside the .blend, as other programs read it.

    Parameters
    ----------
    name : str
    values : (H, W, 3) or (H, W) float
        Linear, rows top-down, 0 to 1.
    colour : bool
        Whether the values are encoded as sRGB; others are stored as they are.
    """
    height, width = values.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=False, is_data=not colour)
    image.file_format = "PNG"
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = values.reshape(height, width, -1)
    if colour:
        rgba[..., :3] = images.srgb(rgba[..., :3])
    image.pixels.foreach_set(rgba[::-1].ravel())
    image.pack()
    return image


def screen_image(name: str, values: NDArray[np.float64]) -> bpy.types.Image:
    """Make or renew an image that shows what a screen does, values from 0 to 1 (H, W, 3), rows top-down."""
    height, width = values.shape[:2]
    image = bpy.data.images.get(name) or bpy.data.images.new(name, width, height)
    if tuple(image.size) != (width, height):
        image.scale(width, height)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = values
    image.pixels.foreach_set(rgba[::-1].ravel())
    image.update()
    return image


def unpack(folder: Path) -> None:
    """Write this file's packed float images into a folder, as OpenEXR of full precision, and read them from there."""
    for image in [image for image in bpy.data.images if image.packed_file and image.is_float]:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{image.name}.exr"
        image.file_format = "OPEN_EXR"
        image.filepath_raw = str(path.resolve())
        try:
            with caught_output():
                image.save()
        except RuntimeError as error:
            raise LightsphereError(
                f"{path} cannot be written ({error}); free space or choose another folder"
            ) from error
        image.unpack(method="REMOVE")


def filled(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Give unknown texels the nearest known one's value: the texture filter reaches across the mesh's border.

    Parameters
    ----------
    values : (H, W) or (H, W, C) float32
        NaN where unknown; known somewhere.
    """
    known = np.isfinite(values if values.ndim == 2 else values[..., 0])
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(values[tuple(nearest)])


def array(image: bpy.types.Image) -> NDArray[np.float32]:
    """Return an image's colours and alpha as (H, W, C) float32, rows top-down."""
    width, height = image.size
    flat = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(flat)
    return flat.reshape(height, width, image.channels)[::-1].copy()
