"""Folders laid out as those of DiLiGenT: 16-bit pictures, calibrated distant lights, mask, scanned normals.

Shi, Wu, Mo, Duan, Yeung, Tan, "A benchmark dataset and evaluation for non-Lambertian and uncalibrated photometric
stereo", CVPR 2016. Directions and normals: x right, y up, z to the viewer.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import LightsphereError
from . import matlab
from .folder import described, directions
from .photographs import Photographs, Reader
from .settings import ImportSettings
from .shots import shot
from .tables import table

NAMES, DIRECTIONS, INTENSITIES, NORMALS = (
    "filenames.txt",
    "light_directions.txt",
    "light_intensities.txt",
    "Normal_gt.mat",
)


def read(folder: Path, settings: ImportSettings, reader: Reader) -> Photographs:
    """Describe a DiLiGenT folder; raise LightsphereError when its lists do not have the same length."""
    try:
        names = (folder / NAMES).read_text(encoding="utf-8").split()
    except (OSError, UnicodeDecodeError) as error:
        raise LightsphereError(f"{folder / NAMES} cannot be read ({error}); copy it again") from error
    direction = table(folder / DIRECTIONS, 3)
    irradiance = table(folder / INTENSITIES, 3)
    if not len(names) == len(direction) == len(irradiance):
        raise LightsphereError(
            f"{folder} names {len(names)} pictures, {len(direction)} directions and {len(irradiance)} intensities; "
            f"make {NAMES}, {DIRECTIONS} and {INTENSITIES} equally long"
        )
    missing = [name for name in names if not (folder / name).is_file()]
    if missing:
        raise LightsphereError(
            f"{folder / missing[0]} is missing ({len(missing)} of {len(names)} are); copy them again"
        )
    entries = [
        {"position": place, "intensity": e, "file": n} for place, e, n in zip(direction, irradiance, names, strict=True)
    ]
    lights, _ = directions(entries, folder / DIRECTIONS)
    shots = tuple((shot(folder / name, reader),) for name in names)
    normal = normals(folder / NORMALS) if (folder / NORMALS).is_file() else None
    return described(folder, settings, reader, Photographs("diligent", shots, lights, normal=normal))


def normals(path: Path) -> NDArray[np.float32]:
    """Read ``Normal_gt`` (H, W, 3) from a MATLAB file; NaN where its length is not 1."""
    normal = np.asarray(matlab.read(path).get("Normal_gt", 0), np.float64)
    if normal.ndim != 3 or normal.shape[2] != 3:
        raise LightsphereError(f"{path} holds no Normal_gt of H x W x 3 numbers; copy it again or remove it")
    return unit_or_nan(normal)


def unit_or_nan(normal: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return normals of length 1, and NaN for those far from it."""
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    good = np.abs(length - 1) < 0.1
    return np.where(good, normal / np.where(good, length, 1), np.nan).astype(np.float32)
