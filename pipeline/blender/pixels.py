"""Blender's images from arrays and back: the one place where rows are flipped."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray


def packed_image(name: str, values: NDArray[Any]) -> bpy.types.Image:
    """Make a float image that is stored inside the .blend.

    Parameters
    ----------
    name : str
    values : (H, W, 3) or (H, W) float
        Linear, rows top-down, finite.

    Returns
    -------
    bpy.types.Image
        Without a colour space (Non-Color): a shader reads the very numbers.
    """
    height, width = values.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True, is_data=True)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = values if values.ndim == 3 else values[..., None]
    image.pixels.foreach_set(rgba[::-1].ravel())
    image.pack()
    return image


def array(image: bpy.types.Image) -> NDArray[np.float32]:
    """Return an image's colours as (H, W, 3) float32, rows top-down."""
    width, height = image.size
    flat = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(flat)
    return flat.reshape(height, width, image.channels)[::-1, :, :3].copy()
