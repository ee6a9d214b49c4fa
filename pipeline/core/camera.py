"""Pinhole and orthographic cameras: a ray for every pixel."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import BROKEN_JSON, LightsphereError

MODELS = ("pinhole", "orthographic")


@dataclass(frozen=True)
class Camera:
    """A camera without lens distortion.

    Parameters
    ----------
    model : str
        ``"pinhole"`` or ``"orthographic"``.
    to_world : (4, 4) float64
        Camera space (x right, y up, z to the viewer) to world, rigid [m].
    resolution : (int, int)
        Width and height [px].
    focal : (float, float)
        Pinhole: focal lengths fx, fy [px]. Orthographic: pixels per metre in x and y.
    centre : (float, float)
        Where the optical axis meets the picture, from its top left corner [px].
    """

    model: str
    to_world: NDArray[np.float64]
    resolution: tuple[int, int]
    focal: tuple[float, float]
    centre: tuple[float, float]

    def rays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return origins and unit directions of the rays through the pixel centres, world space.

        Returns
        -------
        origins, directions : (H, W, 3) float64
            [m] and unit; ``origins + depth * directions`` is the surface point.
        """
        width, height = self.resolution
        place = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)
        return self.rays_at(place)

    def rays_at(self, place: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return origins and unit directions (..., 3) of the rays through places (..., 2) of the picture.

        A place is column and row [px] from the top left corner; pixel centres are at halves.
        """
        x = (place[..., 0] - self.centre[0]) / self.focal[0]
        y = (self.centre[1] - place[..., 1]) / self.focal[1]
        rotation, position = self.to_world[:3, :3], self.to_world[:3, 3]
        if self.model == "pinhole":
            local = np.stack([x, y, -np.ones_like(x)], axis=-1)
            local /= np.linalg.norm(local, axis=-1, keepdims=True)
            directions = local @ rotation.T
            origins = np.broadcast_to(position, directions.shape).copy()
        else:
            local = np.stack([x, y, np.zeros_like(x)], axis=-1)
            origins = local @ rotation.T + position
            directions = np.broadcast_to(-rotation[:, 2], origins.shape).copy()
        return origins, directions

    def project(self, points: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where points (..., 3) of the world are seen, (..., 2) [px], and how far along their rays (...) [m].

        The inverse of :meth:`rays_at`. What lies behind a pinhole camera has a negative distance.
        """
        local = (np.asarray(points, np.float64) - self.to_world[:3, 3]) @ self.to_world[:3, :3]
        distance = -local[..., 2]
        if self.model == "pinhole":
            local = local / np.where(distance == 0, np.nan, distance)[..., None]
        column = self.centre[0] + self.focal[0] * local[..., 0]
        row = self.centre[1] - self.focal[1] * local[..., 1]
        if self.model == "pinhole":
            distance = distance * np.linalg.norm(local, axis=-1)
        return np.stack([column, row], axis=-1), np.asarray(distance)

    def pixel_size(self, depth: NDArray[Any]) -> NDArray[np.float64]:
        """Return the width across the view that a pixel covers at depths of any shape [m]."""
        depth = np.asarray(depth, np.float64)
        return np.asarray((depth if self.model == "pinhole" else np.ones_like(depth)) / self.focal[0])

    def normals_to_world(self, normals: NDArray[Any]) -> NDArray[np.float64]:
        """Rotate camera-space normals (..., 3) to world space; NaN stays NaN."""
        with np.errstate(invalid="ignore"):
            return np.asarray(normals, np.float64) @ self.to_world[:3, :3].T

    def normals_to_camera(self, world_normals: NDArray[Any]) -> NDArray[np.float64]:
        """Rotate world-space normals (..., 3) to camera space; NaN stays NaN."""
        with np.errstate(invalid="ignore"):
            return np.asarray(world_normals, np.float64) @ self.to_world[:3, :3]

    def orbited(self, centre: NDArray[Any], degrees: float) -> Camera:
        """Return the camera turned about the vertical line (world z) through a point, to the right for degrees > 0."""
        angle = np.radians(degrees)
        turn = np.eye(4)
        turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        there, back = np.eye(4), np.eye(4)
        there[:3, 3], back[:3, 3] = -np.asarray(centre), centre
        return dataclasses.replace(self, to_world=back @ turn @ there @ self.to_world)

    def resized(self, width: int) -> Camera:
        """Return the camera with the same view in pictures of another width [px]."""
        factor = width / self.resolution[0]
        return dataclasses.replace(
            self,
            resolution=(width, round(self.resolution[1] * factor)),
            focal=(self.focal[0] * factor, self.focal[1] * factor),
            centre=(self.centre[0] * factor, self.centre[1] * factor),
        )

    def binned(self, side: int) -> Camera:
        """Return the camera of pictures whose pixels are square blocks of this one's, what fills no block left out."""
        return dataclasses.replace(
            self,
            resolution=(self.resolution[0] // side, self.resolution[1] // side),
            focal=(self.focal[0] / side, self.focal[1] / side),
            centre=(self.centre[0] / side, self.centre[1] / side),
        )

    def as_json(self) -> dict[str, Any]:
        """Return the camera as plain JSON values."""
        return {
            "model": self.model,
            "to_world": self.to_world.tolist(),
            "resolution": list(self.resolution),
            "focal": list(self.focal),
            "centre": list(self.centre),
        }

    @classmethod
    def from_json(cls, value: dict[str, Any]) -> Camera:
        """Make a camera from :meth:`as_json`'s values; raise LightsphereError when they are not a camera."""
        try:
            to_world = np.array(value["to_world"], np.float64)
            width, height = (int(n) for n in value["resolution"])
            fx, fy = (float(n) for n in value["focal"])
            cx, cy = (float(n) for n in value["centre"])
            model = str(value["model"])
        except BROKEN_JSON as error:
            raise LightsphereError(f"the camera is not readable ({error}); write the capture again") from error
        if model not in MODELS or to_world.shape != (4, 4) or not np.isfinite(to_world).all():
            raise LightsphereError("the camera's model or matrix is wrong; write the capture again")
        if min(width, height) < 1 or not np.isfinite([fx, fy, cx, cy]).all() or min(fx, fy) <= 0:
            raise LightsphereError("the camera's resolution, focal length or centre is wrong; write the capture again")
        return cls(model, to_world, (width, height), (fx, fy), (cx, cy))
