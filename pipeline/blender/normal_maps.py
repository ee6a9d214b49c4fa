"""Normals of every pixel as a tangent-space normal map that Cycles turns back into them.

A Normal Map node makes ``N = normalize(x T + y sign cross(n, T) + z n)`` of a texel's (x, y, z), with tangent T and
normal n interpolated between a triangle's corners and not normalised (MikkTSpace, Mikkelsen 2008). The map holds the
direction (x, y, z) that solves this for the wanted N.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.reflectance.bake import rasterise
from ..core.shape import Shape
from .meshes import UV_LAYER
from .pixels import filled

FLATTEST = 0.02  # z of a map's direction: the mesh's own normal is never turned further than 89 degrees


def normal_map(item: bpy.types.Object, shape: Shape, faces: int) -> NDArray[np.float32]:
    """Return the tangent-space normal map of a relief object, (H, W, 3), encoded 0 to 1, rows top-down.

    Parameters
    ----------
    item : bpy.types.Object
        With texture coordinates and normals of its own (:func:`.meshes.add_mesh`).
    shape : Shape
        Its normals are those that are to be seen; of the resolution of the map.
    faces : int
        How many triangles, from the first on, are the front; a back has the same texture coordinates.

    Returns
    -------
    (H, W, 3) float32
        Texels off the mesh, or without a normal, have the nearest one's.
    """
    data = item.data
    data.calc_tangents(uvmap=UV_LAYER)
    corners = 3 * faces
    tangent, normal, uv = (np.empty((len(data.loops), n), np.float32) for n in (3, 3, 2))
    sign = np.empty(len(data.loops), np.float32)
    data.loops.foreach_get("tangent", tangent.ravel())
    data.loops.foreach_get("normal", normal.ravel())
    data.loops.foreach_get("bitangent_sign", sign)
    data.uv_layers[UV_LAYER].uv.foreach_get("vector", uv.ravel())
    data.free_tangents()
    height, width = shape.depth.shape
    face, weights = rasterise(uv[:corners].reshape(-1, 3, 2).astype(np.float64), (width, height))
    wanted = shape.camera.normals_to_world(shape.normal)
    known = (face >= 0) & np.isfinite(wanted).all(axis=-1)
    t, n = (_between(v[:corners], face[known], weights[known]) for v in (tangent, normal))
    b = sign[:corners].reshape(-1, 3)[face[known], :1] * np.cross(n, t)
    frame = np.stack([t, b, n], axis=-1)
    usable = np.abs(np.linalg.det(frame)) > 1e-6
    direction = np.zeros((len(frame), 3))
    direction[usable] = np.linalg.solve(frame[usable], wanted[known][usable][..., None])[..., 0]
    direction[~usable, 2] = 1.0
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    direction[:, 2] = np.maximum(direction[:, 2], FLATTEST)
    encoded = np.full((height, width, 3), np.nan, np.float32)
    encoded[known] = direction / 2 + 0.5
    return filled(encoded)


def _between(
    corners: NDArray[np.float32], face: NDArray[np.int64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return vectors of corners (3 F, 3) interpolated at places of triangles."""
    return np.asarray((corners.reshape(-1, 3, 3)[face].astype(np.float64) * weights[..., None]).sum(axis=1))
