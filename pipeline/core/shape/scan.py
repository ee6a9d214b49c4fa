"""A user's own mesh as a shape: the first surface that every pixel's ray meets, and where on its textures that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..capture import Capture
from ..errors import LightsphereError
from . import Shape

FULL = 0.3  # cosine of view and surface from which on a pixel is believed fully; a steeper one shows a smear


@dataclass(frozen=True)
class Scan:
    """Triangles of a mesh in the world, with what their corners carry.

    Parameters
    ----------
    corners : (T, 3, 3) float64
        Positions [m].
    normals : (T, 3, 3) float64
        Unit shading normals.
    uv : (T, 3, 2) float64
        Texture coordinates, v upwards.
    part : (T,) int64
        Number of the texture space that a triangle belongs to.
    """

    corners: NDArray[np.float64]
    normals: NDArray[np.float64]
    uv: NDArray[np.float64]
    part: NDArray[np.int64]

    def select(self, part: int) -> Scan:
        """Return the triangles of one texture space."""
        chosen = self.part == part
        return Scan(self.corners[chosen], self.normals[chosen], self.uv[chosen], self.part[chosen])

    def surface_normals(self) -> NDArray[np.float64]:
        """Return the triangles' own unit normals (T, 3), zero where a triangle has no area."""
        edges = self.corners[:, 1:] - self.corners[:, :1]
        normals = np.cross(edges[:, 0], edges[:, 1])
        return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30))


def blend(values: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners' values (K, 3, C) weighted by barycentric coordinates (K, 3), (K, C)."""
    return np.asarray(np.einsum("kc,kci->ki", weights, values))


def seen(capture: Capture, scan: Scan, face: NDArray[np.int64]) -> Shape:
    """Return the shape that a capture's camera sees of a mesh.

    Parameters
    ----------
    capture : Capture
    scan : Scan
    face : (H, W) int64
        The first triangle that each pixel's ray meets; -1 for none.

    Returns
    -------
    Shape
        Of the mask's pixels that meet the mesh. Normals are the mesh's shading normals on the side that is seen.
        Confidence is the cosine of view and surface over 0.3, 1 at most. Layers ``uv.U`` and ``uv.V`` hold the texture
        coordinates, ``part`` the number of the texture space.

    Raises
    ------
    LightsphereError
        When no pixel of the object meets the mesh: it is elsewhere, or in another unit.
    """
    mask = capture.mask()
    hit = mask & (face >= 0)
    if not hit.any():
        low, high = scan.corners.min(axis=(0, 1)), scan.corners.max(axis=(0, 1))
        raise LightsphereError(
            f"no pixel of the object meets the mesh, which is {_metres(high - low)} m large about "
            f"{_metres((low + high) / 2)} m; check its unit (--mesh-unit) and that it is registered to the cameras"
        )
    origins, directions = (part[hit] for part in capture.camera.rays())
    chosen = face[hit]
    plane = scan.surface_normals()[chosen]
    depth = ((scan.corners[chosen, 0] - origins) * plane).sum(-1) / (directions * plane).sum(-1)
    weights = barycentric(scan.corners[chosen], origins + depth[:, None] * directions)
    normal = blend(scan.normals[chosen], weights)
    normal *= -np.sign((plane * directions).sum(-1, keepdims=True))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    uv = blend(scan.uv[chosen], weights)

    def picture(values: NDArray[np.float64], outside: float = np.nan) -> NDArray[np.float32]:
        whole = np.full(hit.shape + values.shape[1:], outside, np.float32)
        whole[hit] = values
        return whole

    facing = np.abs((plane * directions).sum(-1))
    return Shape(
        camera=capture.camera,
        depth=picture(depth),
        normal=picture(capture.camera.normals_to_camera(normal)),
        confidence=picture(np.clip(facing / FULL, 1e-3, 1.0), outside=0.0),
        layers={"uv.U": picture(uv[:, 0]), "uv.V": picture(uv[:, 1]), "part": picture(scan.part[chosen].astype(float))},
        notes={"silhouette_overlap_pct": 100.0 * float(hit.sum()) / float((mask | (face >= 0)).sum())},
    )


def barycentric(corners: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the barycentric coordinates (K, 3) of points (K, 3) on the planes of triangles (K, 3, 3)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(first, second)
    area = np.maximum((across**2).sum(-1), 1e-300)
    inside = points - corners[:, 0]
    b = (np.cross(inside, second) * across).sum(-1) / area
    c = (np.cross(first, inside) * across).sum(-1) / area
    return np.stack([1.0 - b - c, b, c], axis=-1)


def _metres(vector: NDArray[np.float64]) -> str:
    return " x ".join(f"{value:.3g}" for value in vector)
