"""Float images on disk: OpenEXR files written atomically, read with a clear error.

OpenEXR is imported when it is first needed: inside a Blender executable its library clashes with Blender's own,
and another one takes its place there (:func:`use_library`).
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import LightsphereError

MOST_VALUES_A_BYTE = 2000  # of a picture of one colour, packed as tightly as any of the formats does

Reader = Callable[[Path], dict[str, NDArray[Any]]]
Writer = Callable[[Path, Mapping[str, NDArray[Any]]], None]


def write_channels(path: Path, channels: Mapping[str, NDArray[Any]]) -> None:
    """Write an OpenEXR file atomically: it is whole or it is not there.

    Parameters
    ----------
    path : Path
        The file; its folder exists.
    channels : mapping of str to (H, W) float16 or float32
        Channel name, e.g. ``"R"`` or ``"normal.X"``, to its values, rows top-down.

    Raises
    ------
    LightsphereError
        When the disk is full or the folder cannot be written.
    """
    _write(path, channels)


def read_channels(path: Path) -> dict[str, NDArray[Any]]:
    """Read every channel of an OpenEXR file, multipart files included, as (H, W) arrays.

    Raises
    ------
    LightsphereError
        When the file is missing or damaged; the message names it.
    """
    if not path.is_file():
        raise LightsphereError(f"{path} is missing; render or import the capture again to replace it")
    return _read(path)


def check_size(path: Path, values: int) -> None:
    """Raise LightsphereError when a file is said to hold more values than its bytes can."""
    size = path.stat().st_size
    if values > MOST_VALUES_A_BYTE * (size + 1000):
        raise LightsphereError(f"{path} is said to hold {values} values in {size} bytes; it is damaged, copy it again")


def srgb(linear: NDArray[Any]) -> NDArray[np.float64]:
    """Return linear values from 0 to 1 as sRGB values (IEC 61966-2-1)."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def write_rgb(path: Path, image: NDArray[Any]) -> None:
    """Write an (H, W, 3) image atomically as an OpenEXR file with channels R, G, B of the image's own type."""
    write_channels(path, {name: image[..., i] for i, name in enumerate("RGB")})


def read_rgb(path: Path) -> NDArray[np.float32]:
    """Read an OpenEXR picture as (H, W, 3) float32; a file with one channel is taken as gray."""
    channels = read_channels(path)
    if all(name in channels for name in "RGB"):
        return np.stack([channels[name] for name in "RGB"], axis=-1).astype(np.float32)
    if len(channels) == 1:
        (gray,) = channels.values()
        return np.repeat(gray[..., None], 3, axis=-1).astype(np.float32)
    raise LightsphereError(f"{path} holds the channels {', '.join(channels)}; a picture needs R, G and B")


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def is_intact(path: Path, recorded: str) -> bool:
    """Return whether a file is there with the SHA-256 that was recorded."""
    return path.is_file() and checksum(path) == recorded


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically; raise LightsphereError when the disk is full or the folder is closed."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file atomically; raise LightsphereError when the disk is full or the folder is closed."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        partial.write_bytes(data)
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise LightsphereError(f"{path} cannot be written ({error}); free space or choose another folder") from error


def use_library(read: Reader, write: Writer) -> None:
    """Read and write OpenEXR files by other functions from now on, with the same results and errors."""
    global _read, _write
    _read, _write = read, write


def _write_openexr(path: Path, channels: Mapping[str, NDArray[Any]]) -> None:
    import OpenEXR

    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    planes = {name: np.ascontiguousarray(plane) for name, plane in channels.items()}
    try:
        with OpenEXR.File(header, planes) as file:
            file.write(str(partial))
        partial.replace(path)
    except (OSError, RuntimeError) as error:
        partial.unlink(missing_ok=True)
        raise LightsphereError(f"{path} cannot be written ({error}); free space or choose another folder") from error


_QUIET = threading.Lock()


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Hold back what a library itself prints about a damaged file, on both streams; the error raised says it."""
    with _QUIET, Path(os.devnull).open("w") as nowhere, contextlib.redirect_stdout(nowhere):
        stderr = os.dup(2)
        try:
            os.dup2(nowhere.fileno(), 2)
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)


def _read_openexr(path: Path) -> dict[str, NDArray[Any]]:
    import OpenEXR

    try:
        with quiet(), OpenEXR.File(str(path), header_only=True) as header:
            promised = len(header.parts)
            pixels = sum(_pixels(part) for part in header.parts)
        check_size(path, pixels)
        with quiet(), OpenEXR.File(str(path), separate_channels=True) as file:
            if len(file.parts) < promised:  # of a file cut off the library leaves parts out, with a warning only
                raise RuntimeError("the file ends too early")
            channels = {}
            for part in file.parts:
                channels.update({name: np.array(c.pixels) for name, c in part.channels.items()})
    except Exception as error:  # the library raises its own untyped errors for damaged files
        raise LightsphereError(
            f"{path} is damaged ({error}); delete it and run the stage that made it again"
        ) from error
    return channels


def _pixels(part: Any) -> int:
    """Return how many pixels a part of an OpenEXR file is said to have, all channels counted."""
    low, high = part.header["dataWindow"]
    width, height = (int(b) - int(a) + 1 for a, b in zip(low, high, strict=True))
    return max(width, 0) * max(height, 0) * len(part.header["channels"])


_read: Reader = _read_openexr
_write: Writer = _write_openexr
