"""Photographs of balls drawn in closed form, as arrays, as files for an injected reader, and as PNG files."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.core.errors import LightsphereError
from pipeline.core.photographs.photographs import Picture
from pipeline.core.rig import hemisphere
from tests import oracles

SIZE, X, Y, RADIUS = 96, 50.3, 44.6, 38.2
MIRROR: dict[str, Any] = {"size": 180, "x": 93.3, "y": 88.7, "radius": 79.6}
VIEW = np.array([0.0, 0.0, 1.0])


def directions(count: int = 12) -> NDArray[np.float64]:
    """Return unit directions to lights within 60 degrees of the view."""
    spread = hemisphere(count) * [1.0, 1.0, 1.0] + [0.0, 0.0, 0.6]
    return oracles.unit(spread)


def normals(
    size: int = SIZE, x: float = X, y: float = Y, radius: float = RADIUS, inner: int = 1
) -> NDArray[np.float64]:
    """Return a ball's normals (H, W, 3), NaN outside, at inner x inner places of each pixel (H, W, inner^2, 3)."""
    place = (np.arange(size * inner) + 0.5) / inner
    u, v = np.meshgrid((place - x) / radius, (y - place) / radius)
    with np.errstate(invalid="ignore"):
        n = np.stack([u, v, np.sqrt(1 - u**2 - v**2)], axis=-1)
    n[u**2 + v**2 >= 1] = np.nan
    if inner == 1:
        return n
    split = n.reshape(size, inner, size, inner, 3).transpose(0, 2, 1, 3, 4)
    return split.reshape(size, size, inner**2, 3)


def lambert(lights: NDArray[np.float64], albedo: float = 0.8) -> NDArray[np.float64]:
    """Return pictures (L, H, W) of a white-ish Lambertian ball of which a light from the front makes ``albedo``."""
    normal = normals()
    shade = np.maximum(np.einsum("hwi,li->lhw", np.nan_to_num(normal), lights), 0)
    return albedo * np.where(np.isfinite(normal[..., 0]), shade, 0)


def mirror(lights: NDArray[np.float64], width: float = 4.0) -> NDArray[np.float64]:
    """Return pictures (L, H, W) of a mirror ball before lamps of a radius [degrees], a window and a dark room."""
    normal = normals(**MIRROR, inner=5)
    reflected = 2 * normal[..., 2:] * normal - VIEW

    def lamp(direction: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
        with np.errstate(invalid="ignore"):
            return np.mean(reflected @ oracles.unit(direction) > np.cos(np.radians(radius)), axis=-1)

    window = lamp(np.array([-0.9, 0.2, 0.05]), 12.0)
    room = np.where(np.isfinite(normal[..., 0]).any(axis=-1), 0.05, 0.02)
    glare = [0.4 * lamp(direction * [-1, 1, 1], width / 2) for direction in lights]  # a weaker second reflection
    return np.array([room + window + 3 * lamp(d, width) + g for d, g in zip(lights, glare, strict=True)])


def colours(pictures: NDArray[Any]) -> NDArray[np.float32]:
    return np.repeat(np.asarray(pictures, np.float32)[..., None], 3, axis=-1)


def angles(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.float64]:
    """Return the angles between unit vectors [degrees]."""
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), oracles.dot(a, b)))


def least_squares(pictures: NDArray[Any], lights: NDArray[Any], mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the unit normals (P, 3) of plain Lambertian photometric stereo."""
    return oracles.unit(np.linalg.lstsq(lights, pictures[:, mask], rcond=None)[0].T)


class Drawer:
    """Files whose pictures are given, with the function that reads them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.pictures: dict[Path, Picture] = {}

    def put(self, name: str, pixels: NDArray[Any], bits: int = 16, seconds: float | None = None) -> Path:
        """Put a picture (H, W) or (H, W, 3) of values up to 1 there, rounded to so many bits."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if bits < 32:
            pixels = np.round(np.clip(pixels, 0, 1) * (2**bits - 1)) / (2**bits - 1)
        image = np.asarray(pixels, np.float32) if pixels.ndim == 3 else colours(pixels)
        path.write_bytes(image.tobytes())
        self.pictures[path] = Picture(image, bits, seconds)
        return path

    def series(self, pictures: NDArray[Any], name: str = "img_{}.png", bits: int = 16) -> None:
        for i, picture in enumerate(pictures):
            self.put(name.format(i), picture, bits)

    def text(self, name: str, text: str) -> Path:
        path = self.folder / name
        path.write_text(text)
        return path

    def read(self, path: Path) -> Picture:
        if path not in self.pictures:
            raise LightsphereError(f"{path} is damaged")
        return self.pictures[path]


def listed(lights: NDArray[np.float64], names: list[str] | None = None) -> str:
    """Return a list of lights as text."""
    rows = [" ".join(f"{x:.9f}" for x in light) for light in lights]
    return "\n".join(rows if names is None else [f"{n} {r}" for n, r in zip(names, rows, strict=True)]) + "\n"


def png(path: Path, values: NDArray[Any]) -> None:
    """Write integers (H, W), (H, W, 3) or (H, W, 4) of 8 or 16 bits as a PNG file (ISO/IEC 15948)."""
    height, width = values.shape[:2]
    kind = {1: 0, 3: 2, 4: 6}[values[0, 0].size]
    rows = values.reshape(height, -1).astype(values.dtype.newbyteorder(">"))
    data = zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows))
    header = struct.pack(">IIBBBBB", width, height, 8 * values.dtype.itemsize, kind, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", data), (b"IEND", b""))
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + b"".join(struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in chunks)
    )
