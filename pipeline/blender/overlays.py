"""What is known of every pixel, shown on the recovered mesh: confidence, expected error, depth and normals."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.shape import Shape
from ..core.shape.mesh import Mesh
from .meshes import UV_LAYER
from .pixels import filled

#: Layers of one number, and whether little of it is good.
NUMBERS = {"confidence": False, "expected_error": True, "depth": False}
NORMAL = "normal"
MARK = "lightsphere_layers"  # property of meshes that have some: height and width of the pictures
COLOURS = "Layer"  # the colour attribute that shows one of them
#: Dark blue to yellow, even to the eye and to colour-blind ones: viridis (Smith and van der Walt 2015), linear.
RAMP = np.array(
    [
        (0.058, 0.000, 0.089),
        (0.042, 0.084, 0.258),
        (0.015, 0.282, 0.262),
        (0.107, 0.584, 0.122),
        (0.983, 0.799, 0.019),
    ]
)
USUAL = (2.0, 98.0)  # percentiles at the ends of the ramp


def add(item: bpy.types.Object, mesh: Mesh, shape: Shape) -> None:
    """Keep a shape's layers with its mesh, as attributes of the vertices."""
    unknown = np.isnan(shape.depth)
    layers = {"confidence": shape.confidence, "depth": shape.depth, **shape.layers}
    for name in NUMBERS:
        if name in layers:
            attribute = item.data.attributes.new(name, "FLOAT", "POINT")
            attribute.data.foreach_set("value", _at(mesh.uv, np.where(unknown, np.nan, layers[name])))
    normals = item.data.attributes.new(NORMAL, "FLOAT_VECTOR", "POINT")
    normals.data.foreach_set("vector", _at(mesh.uv, np.where(unknown[..., None], np.nan, shape.normal)).ravel())
    item[MARK] = shape.depth.shape


def pixel_of(item: bpy.types.Object, polygon: int) -> tuple[int, int]:
    """Return row and column of the pixel at the middle of a recovered mesh's polygon."""
    height, width = item[MARK]
    loops = item.data.polygons[polygon].loop_indices
    u, v = np.mean([item.data.uv_layers[UV_LAYER].uv[loop].vector for loop in loops], axis=0)
    return min(int((1 - v) * height), height - 1), min(int(u * width), width - 1)


def show(item: bpy.types.Object, layer: str) -> None:
    """Let a recovered mesh's colour attribute show a layer, grey where it does not know it.

    Numbers run along the ramp between their usual ends, the better the yellower; confidence from 0 to 1. Normals are
    in camera space, from -1..1 to 0..1.
    """
    data = item.data
    count = len(data.vertices)
    rgb = np.full((count, 3), 0.2)
    if layer == NORMAL and NORMAL in data.attributes:
        values = np.empty(3 * count, np.float32)
        data.attributes[NORMAL].data.foreach_get("vector", values)
        rgb = 0.5 * values.reshape(-1, 3) + 0.5
    elif layer in NUMBERS and layer in data.attributes:
        values = np.empty(count, np.float32)
        data.attributes[layer].data.foreach_get("value", values)
        rgb = ramp(values, layer)
    colours = data.color_attributes.get(COLOURS) or data.color_attributes.new(COLOURS, "FLOAT_COLOR", "POINT")
    colours.data.foreach_set("color", np.column_stack([rgb, np.ones(count)]).astype(np.float32).ravel())
    data.color_attributes.active_color = colours
    data.update()


def ramp(values: NDArray[np.float32], layer: str) -> NDArray[np.float64]:
    """Return the linear colours (V, 3) of a layer's values (V,)."""
    low, high = (0.0, 1.0) if layer == "confidence" else np.percentile(values, USUAL)
    share = np.clip((values - low) / max(high - low, 1e-12), 0.0, 1.0)
    if NUMBERS[layer]:
        share = 1.0 - share
    stops = np.linspace(0.0, 1.0, len(RAMP))
    return np.stack([np.interp(share, stops, RAMP[:, channel]) for channel in range(3)], axis=1)


def _at(uv: NDArray[np.float64], values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the values (V,) or (V, C) of the known pixels nearest to those that texture coordinates (V, 2) lie in."""
    values = filled(values)
    height, width = values.shape[:2]
    row = np.clip((1 - uv[:, 1]) * height, 0, height - 1).astype(np.int64)
    column = np.clip(uv[:, 0] * width, 0, width - 1).astype(np.int64)
    return np.asarray(values[row, column], np.float32)
