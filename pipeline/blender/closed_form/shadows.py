"""Which points something hides from a light, as Cycles sees it: shadow rays by Embree.

On smooth shading Cycles lifts the start of a shadow ray from the flat triangle towards the round surface that its
normals promise (an object's *Shadow Terminator Geometry Offset*), or the facets would show where shadows begin. The
lift is half the height of the parabola through the corners and their normals, kept within the corners' tangent planes,
as in Cycles' kernel/light/sample.h.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.camera import Camera
from ...core.direct_light import Rays
from ..geometry import corners, meshes
from .closures import Inexact

OFFSET = 1e-5  # of the largest coordinate: how far from its surface a shadow ray starts
NOTHING = -1  # what the binding answers for a ray that hits nothing
SAME = 1e-4  # of the distance: the first hit is the one that Cycles found


@dataclass(frozen=True)
class Triangles:
    """What a scene renders, for rays.

    Parameters
    ----------
    vertices, normals : (T, 3, 3) float64
        Corners in the world [m], and the unit normals there.
    cutoff : (T,) float64
        Below which cosine between light and triangle the start of a shadow ray is lifted; 0 for flat shading.
    tracer : embreex.rtcore_scene.EmbreeScene
    offset : float
        How far from its triangle a shadow ray starts [m].
    """

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    cutoff: NDArray[np.float64]
    tracer: Any
    offset: float

    def hidden(self, rays: Rays) -> NDArray[np.bool_]:
        """Return which rays (N,) something stops."""
        if not len(rays.start):
            return np.zeros(0, bool)
        return np.asarray(self.tracer.run(rays.start, rays.direction, dists=rays.reach, query="OCCLUDED") != NOTHING)

    def lifts(
        self, camera: Camera, position: NDArray[np.float64], to_camera: NDArray[np.float64], true: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return lift (P, 3) and cutoff (P,) of the points that a camera sees; see :class:`Surface`."""
        starts, reach = _primary(camera, position, to_camera)
        hits = self.tracer.run(starts.astype(np.float32), -to_camera.astype(np.float32), query="INTERSECT", output=1)
        which = hits["primID"]
        same = (which != NOTHING) & (abs(hits["tfar"] - reach) < SAME * reach)
        which = np.where(same, which, 0)
        weights = np.stack([1 - hits["u"] - hits["v"], hits["u"], hits["v"]], axis=-1).astype(np.float64)
        lift = _lift(self.vertices[which], self.normals[which], weights, true)
        return lift, np.where(same, self.cutoff[which], 0.0)


def triangles(scene: bpy.types.Scene) -> Triangles:
    """Build the ray tracer's scene; raise Inexact when the ray tracer is not installed."""
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError as error:
        raise Inexact("want of the package embreex") from error
    vertices, normals, cutoff = _shaded(scene)
    tracer = EmbreeScene()
    TriangleMesh(tracer, vertices.astype(np.float32))
    return Triangles(vertices, normals, cutoff, tracer, OFFSET * float(np.abs(vertices).max()))


def _primary(
    camera: Camera, position: NDArray[np.float64], to_camera: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the points' rays from the camera start, and how long they are."""
    back = camera.to_world[:3, 2]
    if camera.model == "pinhole":
        reach = np.linalg.norm(position - camera.to_world[:3, 3], axis=-1)
    else:
        reach = (camera.to_world[:3, 3] - position) @ back
    return position + reach[:, None] * to_camera, reach


def _shaded(scene: bpy.types.Scene) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return a scene's triangles (T, 3, 3), the unit normals of their corners (T, 3, 3), and the cutoff (T,)."""
    vertices, normals, cutoffs = [], [], []
    for item, mesh, matrix in meshes(scene, backdrop=True):
        count = len(mesh.loop_triangles)
        loops, smooth = np.empty(3 * count, np.int32), np.empty(count, bool)
        mesh.loop_triangles.foreach_get("loops", loops)
        mesh.loop_triangles.foreach_get("use_smooth", smooth)
        of_corner = np.empty(3 * len(mesh.loops), np.float32)
        mesh.corner_normals.foreach_get("vector", of_corner)
        turned = of_corner.reshape(-1, 3)[loops] @ np.linalg.inv(matrix[:3, :3])
        turned /= np.maximum(np.linalg.norm(turned, axis=-1, keepdims=True), 1e-30)
        vertices.append(corners(mesh, matrix))
        normals.append(turned.reshape(-1, 3, 3))
        cutoffs.append(np.where(smooth, item.shadow_terminator_geometry_offset, 0.0))
    return np.concatenate(vertices), np.concatenate(normals), np.concatenate(cutoffs)


def _lift(
    v: NDArray[np.float64], n: NDArray[np.float64], weights: NDArray[np.float64], true: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how far points are below the round surface of triangles (P, 3, 3) with normals (P, 3, 3)."""

    def dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((a * b).sum(axis=-1))

    first, second = weights[:, 0], weights[:, 1]
    point, normal = (np.einsum("pk,pki->pi", weights, one) for one in (v, n))
    a = dot(n[:, 2] - n[:, 0], v[:, 0] - v[:, 2])
    b = dot(n[:, 2] - n[:, 1], v[:, 1] - v[:, 2])
    c = dot(n[:, 1] - n[:, 0], v[:, 1] - v[:, 0])
    parabola = (a * first * (first - 1) + (a + b + c) * first * second + b * second * (second - 1)) / 2
    outside = dot(normal, true) > 0
    planes = []
    for corner in range(3):
        away = [dot(v[:, other] - v[:, corner], n[:, corner]) for other in range(3) if other != corner]
        above = np.maximum(np.maximum(*away), 0) + dot(v[:, corner] - point, n[:, corner])
        below = np.maximum(-np.minimum(*away), 0) + dot(point - v[:, corner], n[:, corner])
        planes.append(np.maximum(np.where(outside, above, below), 0))
    envelope = np.minimum.reduce(planes)
    height = np.where(outside, np.maximum(envelope, parabola), np.minimum(-envelope, parabola))
    return np.asarray(height[:, None] * normal)
