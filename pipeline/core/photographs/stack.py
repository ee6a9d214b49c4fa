"""Photographs in one file of arrays: .npz with images, lights, mask and normals, or .npy with images alone."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import light_file
from ..arrays import read_npz
from ..errors import BROKEN_NPZ, LightsphereError
from ..lights import Lights
from .diligent import unit_or_nan
from .folder import directions
from .photographs import FLOAT_BITS, Photographs, Picture, Shot, unknown
from .settings import ImportSettings

NAMED = 6  # arrays that a message names
# What arrays may be called.
IMAGES = ("images", "imgs", "observations")
LIGHTS = ("lights", "light_directions", "directions")
INTENSITIES = ("intensities", "light_intensities")
MASK = ("mask",)
NORMALS = ("normal_gt", "normals", "normal")


def read(path: Path, settings: ImportSettings) -> Photographs:
    """Describe a stack.

    Images are (L, H, W), (L, H, W, 3), or with the lights last; lights (L, 3) or (3, L), directions with x right,
    y up, z to the viewer; integers are in units of their type's largest, floats are taken as they are.

    Raises
    ------
    LightsphereError
        When arrays are missing or do not fit together, naming them.
    """
    arrays = _arrays(path)
    images = _one_of(arrays, IMAGES)
    if images is None:
        names = ", ".join(list(arrays)[:NAMED]) + (", ..." if len(arrays) > NAMED else "")
        raise LightsphereError(f"{path} holds {names}; it needs the images under the name images")
    lights, assumed = _lights(path, arrays, settings)
    if images.ndim not in (3, 4) or images.dtype.kind not in "uif":
        raise LightsphereError(
            f"{path}: images are {_size(images)} {images.dtype}; they need to be L x H x W (x 3) numbers"
        )
    if lights is not None and len(images) != len(lights) and images.shape[-1] == len(lights):
        images = np.moveaxis(images, -1, 0)
    if lights is not None and len(images) != len(lights):
        raise LightsphereError(f"{path} holds images of {_size(images)}, but {len(lights)} lights; one image per light")
    if images.ndim == 4 and images.shape[-1] not in (1, 3):
        raise LightsphereError(f"{path}: images have {images.shape[-1]} colours; give one or three")
    bits = FLOAT_BITS if images.dtype.kind == "f" else 8 * images.dtype.itemsize - (images.dtype.kind == "i")
    scale = 1.0 if images.dtype.kind == "f" else float(np.iinfo(images.dtype).max)
    shots = tuple((Shot(f"image {i}", partial(_picture, images[i], scale, bits)),) for i in range(len(images)))
    mask = _one_of(arrays, MASK)
    normal = _one_of(arrays, NORMALS)
    return Photographs(
        "stack",
        shots,
        lights or unknown(len(images)),
        mask=None if mask is None else Shot("mask", partial(_picture, np.squeeze(mask).astype(np.float32), 1.0, bits)),
        normal=None if normal is None else unit_or_nan(np.asarray(normal, np.float64)),
        assumed=assumed,
    )


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    try:
        if path.suffix.lower() == ".npy":
            return {IMAGES[0]: np.load(path, mmap_mode="r")}
        return read_npz(path)
    except LightsphereError as error:
        raise LightsphereError(f"{path}: {error}") from error
    except BROKEN_NPZ as error:
        raise LightsphereError(f"{path} cannot be read ({error}); save it again by numpy, without objects") from error


def _lights(
    path: Path, arrays: dict[str, NDArray[Any]], settings: ImportSettings
) -> tuple[Lights | None, tuple[str, ...]]:
    if settings.lights:
        return directions(light_file.entries(Path(settings.lights)), Path(settings.lights))
    listed = _one_of(arrays, LIGHTS)
    if listed is None:
        return None, ()
    if listed.ndim != 2 or 3 not in listed.shape:
        raise LightsphereError(f"{path}: lights are {_size(listed)}; they need to be L x 3")
    rows = listed if listed.shape[1] == 3 else listed.T
    stated = _one_of(arrays, INTENSITIES)
    if stated is not None and len(stated) != len(rows):
        raise LightsphereError(f"{path} holds {len(rows)} lights, but {len(stated)} intensities; make them equal")
    strengths: Iterable[Any] = [None] * len(rows) if stated is None else _colours(stated)
    entries = [{"position": p, "intensity": i, "file": ""} for p, i in zip(rows, strengths, strict=True)]
    return directions(entries, path)


def _colours(stated: NDArray[Any]) -> NDArray[np.float64]:
    values = np.asarray(stated, np.float64).reshape(len(stated), -1)
    return values if values.shape[1] == 3 else np.repeat(values[:, :1], 3, axis=1)


def _picture(image: NDArray[Any], scale: float, bits: int) -> Picture:
    pixels = np.asarray(image, np.float32) / np.float32(scale)
    colours = pixels[..., None] if pixels.ndim == 2 else pixels
    return Picture(np.ascontiguousarray(np.broadcast_to(colours, (*colours.shape[:2], 3))), bits)


def _one_of(arrays: dict[str, NDArray[Any]], names: tuple[str, ...]) -> NDArray[Any] | None:
    return next((arrays[name] for name in names if name in arrays), None)


def _size(array: NDArray[Any]) -> str:
    return "x".join(map(str, array.shape))
