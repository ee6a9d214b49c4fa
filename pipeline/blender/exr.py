"""OpenEXR files in Blender's own process, by the OpenImageIO that Blender bundles.

The OpenEXR package that the solvers use clashes with the library inside a Blender executable.
"""

from __future__ import annotations

import contextlib
import os
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core import images
from ..core.errors import LightsphereError
from ..core.images import check_size

MAGIC = b"\x76\x2f\x31\x01"
HEADER_SIZE = 4096
MULTIPART = 0x1000
ZIP_ROWS = 16  # rows that ZIP compresses together
NO_DATE = "2000:01:01 00:00:00"


def replace_library() -> None:
    """Let the core read and write pictures by this module where this process is a Blender executable."""
    if bpy.app.binary_path:
        images.use_library(read, write)


def read(path: Path) -> dict[str, NDArray[np.float32]]:
    """Read every channel of every part as (H, W) arrays, rows top-down."""
    oiio = openimageio()
    file = oiio.ImageInput.open(str(path))
    if file is None:
        raise LightsphereError(f"{path} cannot be read ({oiio.geterror()}); render it again")
    channels: dict[str, NDArray[np.float32]] = {}
    part = 0
    while file.seek_subimage(part, 0):
        check_size(path, file.spec().image_pixels() * file.spec().nchannels)
        pixels = file.read_image(part, 0, 0, file.spec().nchannels, "float")
        if pixels is None:
            raise LightsphereError(f"{path} is damaged ({file.geterror()}); delete it and run the stage again")
        channels.update({name: pixels[..., i] for i, name in enumerate(file.spec().channelnames)})
        part += 1
    file.close()
    return channels


def read_rgb(path: Path) -> NDArray[np.float32]:
    """Read a picture that Cycles wrote, (H, W, 3)."""
    channels = read(path)
    return np.stack([channels[letter] for letter in "RGB"], axis=-1)


def write(path: Path, channels: Mapping[str, NDArray[Any]], pixel_type: str = "float") -> None:
    """Write (H, W) arrays as channels of ``"float"`` or ``"half"`` atomically; equal arrays make equal bytes.

    Raises
    ------
    LightsphereError
        When the disk is full or the folder is closed.
    """
    oiio = openimageio()
    pixels = np.ascontiguousarray(np.stack(list(channels.values()), axis=-1), np.float32)
    height, width, count = pixels.shape
    spec = oiio.ImageSpec(width, height, count, pixel_type)
    spec.channelnames = list(channels)
    spec.attribute("compression", "zip")
    spec.attribute("DateTime", NO_DATE)
    partial = partial_name(path)
    file = oiio.ImageOutput.create("out.exr")
    if not (file.open(str(partial), spec) and file.write_image(pixels) and file.close()):
        partial.unlink(missing_ok=True)
        raise LightsphereError(
            f"{path} cannot be written ({file.geterror()}); free space or choose another folder, then run again"
        )
    partial.replace(path)


@contextlib.contextmanager
def one_thread_each() -> Iterator[None]:
    """Let every file be written by the thread that asks for it, for a while: threads of their own only wait."""
    oiio = openimageio()
    before = {name: oiio.get_int_attribute(name) for name in ("threads", "exr_threads")}
    oiio.attribute("threads", 1)
    oiio.attribute("exr_threads", -1)
    try:
        yield
    finally:
        for name, value in before.items():
            oiio.attribute(name, value)


def write_png(path: Path, values: NDArray[Any], bits: int = 16) -> None:
    """Write (H, W) or (H, W, 3) values from 0 to 1 as a PNG of 16 or 8 bits, as they are, atomically.

    Raises
    ------
    LightsphereError
        When the file cannot be written.
    """
    oiio = openimageio()
    kind = np.uint8 if bits == 8 else np.uint16
    whole = np.round((2**bits - 1) * np.clip(values, 0.0, 1.0)).astype(kind)
    whole = np.ascontiguousarray(whole.reshape(*whole.shape[:2], -1))
    spec = oiio.ImageSpec(whole.shape[1], whole.shape[0], whole.shape[2], f"uint{bits}")
    partial = partial_name(path)
    file = oiio.ImageOutput.create("out.png")
    if not (file.open(str(partial), spec) and file.write_image(whole) and file.close()):
        partial.unlink(missing_ok=True)
        raise LightsphereError(f"{path} cannot be written ({file.geterror()}); free space or choose another folder")
    partial.replace(path)


def partial_name(path: Path) -> Path:
    """Return the name under which a file is written before it is whole."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")


def finish(path: Path) -> None:
    """Make a file that Blender wrote depend on its pixels alone, and make sure that it is whole.

    Blender writes into the header how long the render took, and says nothing when the disk is full. The digits of
    every ``*_time`` attribute become zeros; the attribute keeps its length, since what follows is addressed by file
    offsets. A multipart file is only read. Source: "OpenEXR File Layout".

    Raises
    ------
    OSError, struct.error, LookupError, ValueError
        When the file or a part of it is missing.
    """
    with path.open("r+b") as file:
        header = file.read(HEADER_SIZE)
        if header[:4] != MAGIC:
            raise OSError("the file is empty")
        if struct.unpack_from("<I", header, 4)[0] & MULTIPART:
            _check_parts(path)
            return
        attributes, end = _attributes(header)
        for name, (start, size) in attributes.items():
            if name.endswith(b"_time"):
                value = header[start : start + size]
                file.seek(start)
                file.write(bytes(ord("0") if chr(byte).isdigit() else byte for byte in value))
        _, first, _, last = struct.unpack_from("<4i", header, attributes[b"dataWindow"][0])
        blocks = -(-(last - first + 1) // ZIP_ROWS)
        file.seek(end + 8 * (blocks - 1))
        (offset,) = struct.unpack("<Q", file.read(8))
        file.seek(offset + 4)
        (size,) = struct.unpack("<i", file.read(4))
        if offset == 0 or offset + 8 + size != path.stat().st_size:
            raise OSError("the end of the file is missing")


def _check_parts(path: Path) -> None:
    try:
        read(path)
    except LightsphereError as error:
        raise OSError("the end of the file is missing") from error


def _attributes(header: bytes) -> tuple[dict[bytes, tuple[int, int]], int]:
    """Return where each attribute's value starts and its size, and where the header ends."""
    found = {}
    offset = 8
    while header[offset]:
        name_end = header.index(b"\0", offset)
        type_end = header.index(b"\0", name_end + 1)
        (size,) = struct.unpack_from("<i", header, type_end + 1)
        found[header[offset:name_end]] = (type_end + 5, size)
        offset = type_end + 5 + size
    return found, offset + 1


def openimageio() -> Any:
    """Return Blender's OpenImageIO module; raise LightsphereError where this Blender has none."""
    bpy.utils.expose_bundled_modules()
    try:
        import OpenImageIO
    except ImportError as error:  # a distribution's own build of Blender
        raise LightsphereError(
            "this Blender comes without OpenImageIO for Python; use a build of blender.org or install that package "
            "(Debian: python3-openimageio)"
        ) from error
    return OpenImageIO
