"""Shape: depth, normals and confidence of every pixel, and the mesh through them.

On disk a folder with ``shape.json`` (method, settings, capture, figures), ``shape.exr`` with the channels
``depth.V``, ``normal.X/Y/Z`` (camera space), ``confidence.V`` and ``mesh.ply``.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from .. import images
from ..camera import Camera
from ..errors import BROKEN_JSON, LightsphereError
from . import level

FILE = "shape.json"


@dataclass(frozen=True)
class Shape:
    """Depth, normals and confidence per pixel.

    Parameters
    ----------
    camera : Camera
        The camera of the capture.
    depth : (H, W) float32
        Distance along the pixel's ray [m]; NaN where not recovered.
    normal : (H, W, 3) float32
        Unit normal in camera space; NaN where not recovered.
    confidence : (H, W) float32
        0 (not recovered) to 1.
    layers : dict of str to (H, W) float32
        Whatever else the method knows per pixel, written as ``NAME.V``, e.g. ``residual``, ``lit_pairs``.
    notes : dict
        Method, settings, capture folder, seconds, errors.
    """

    camera: Camera
    depth: NDArray[np.float32]
    normal: NDArray[np.float32]
    confidence: NDArray[np.float32]
    layers: dict[str, NDArray[np.float32]] = field(default_factory=dict)
    notes: dict[str, Any] = field(default_factory=dict)

    def points(self) -> NDArray[np.float64]:
        """Return the surface points in the world, (H, W, 3) [m]; NaN where not recovered."""
        origins, directions = self.camera.rays()
        return np.asarray(origins + self.depth[..., None].astype(np.float64) * directions)

    def middle(self) -> NDArray[np.float64]:
        """Return the mean of the surface points in the world, (3,) [m]."""
        return np.asarray(np.nanmean(self.points().reshape(-1, 3), axis=0))

    def levelled(self, depth: NDArray[Any]) -> Shape:
        """Return the shape with the scale (pinhole) or shift (orthographic) that is nearest to known depths (H, W).

        It stays where no pixel has both. Normals alone leave this open (``notes["level"]`` is ``"open"``).
        """
        moved = level.depth_at(self.camera, self.depth, level.change(self.camera, self.depth, depth))
        return dataclasses.replace(self, depth=moved.astype(np.float32))

    def within(self, pixels: NDArray[np.bool_]) -> Shape:
        """Return the shape as if nothing were recovered beside some pixels (H, W)."""
        return dataclasses.replace(
            self,
            depth=np.where(pixels, self.depth, np.float32(np.nan)),
            normal=np.where(pixels[..., None], self.normal, np.float32(np.nan)),
            confidence=np.where(pixels, self.confidence, np.float32(0.0)),
        )

    def normals_at(self, uv: NDArray[Any]) -> NDArray[np.float64]:
        """Return unit normals in the world (N, 3) of the known pixels nearest to texture coordinates (N, 2)."""
        known = np.isfinite(self.normal).all(axis=-1)
        row, column = distance_transform_edt(~known, return_distances=False, return_indices=True)
        height, width = known.shape
        i = np.clip((1 - uv[:, 1]) * height, 0, height - 1).astype(np.int64)
        j = np.clip(uv[:, 0] * width, 0, width - 1).astype(np.int64)
        normals = self.camera.normals_to_world(self.normal[row[i, j], column[i, j]])
        return np.asarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True))

    def save(self, folder: Path) -> None:
        """Write the shape's files into a folder, each atomically."""
        folder.mkdir(parents=True, exist_ok=True)
        channels = {"depth.V": self.depth, "confidence.V": self.confidence}
        channels.update({f"normal.{axis}": self.normal[..., i] for i, axis in enumerate("XYZ")})
        channels.update({f"{name}.V": layer for name, layer in self.layers.items()})
        images.write_channels(folder / "shape.exr", {k: np.asarray(v, np.float32) for k, v in channels.items()})
        value = {"camera": self.camera.as_json(), "notes": self.notes}
        images.write_text(folder / FILE, json.dumps(value, indent=1))

    @classmethod
    def open(cls, folder: Path) -> Shape:
        """Open a shape folder; raise LightsphereError when it is none or is damaged."""
        path = folder / FILE
        if not path.is_file():
            raise LightsphereError(f"{folder} is not a shape (it has no {FILE}); make one with lightsphere shape")
        try:
            value = json.loads(path.read_text(encoding="utf-8"))
            channels = images.read_channels(folder / "shape.exr")
            known = ("depth.V", "confidence.V", "normal.X", "normal.Y", "normal.Z")
            return cls(
                camera=Camera.from_json(value["camera"]),
                depth=channels["depth.V"],
                normal=np.stack([channels[f"normal.{axis}"] for axis in "XYZ"], axis=-1),
                confidence=channels["confidence.V"],
                layers={name[:-2]: c for name, c in channels.items() if name not in known},
                notes=dict(value["notes"]),
            )
        except BROKEN_JSON as error:
            raise LightsphereError(f"{folder} is damaged ({error!r}); run lightsphere shape again") from error
