"""Arrays of numbers from MATLAB files of version 5 to 7.2, read without trust in them.

scipy's reader ends the process on damaged files. This one takes real arrays alone, whose sizes must agree with the
bytes that are there, and passes over variables of other kinds. Source: MathWorks, "MAT-File Format", 2019.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import LightsphereError

HEADER = 128  # bytes: words, an offset, the version, and "IM" or "MI", which says how bytes are ordered
MATRIX, COMPRESSED = 14, 15
TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
FIRST_NUMBER, LAST_NUMBER = 6, 15  # classes of arrays of numbers: double to uint64
COMPLEX = 0x0800
MOST_BYTES = 2**30  # of one variable
MOST_AXES = 32


def read(path: Path) -> dict[str, NDArray[np.generic]]:
    """Read the variables of a MATLAB file that are real arrays of numbers.

    Raises
    ------
    LightsphereError
        When the file is missing, of another version, or damaged; the message names it.
    """
    try:
        data = path.read_bytes()
        if data[124:128] not in (b"\x00\x01IM", b"\x01\x00MI"):
            raise ValueError("it is not of version 5")
        order = "<" if data[126:128] == b"IM" else ">"
        found = {}
        for kind, content in _elements(memoryview(data)[HEADER:], order):
            variable = _variable(kind, content, order)
            if variable is not None:
                found[variable[0]] = variable[1]
        return found
    except (OSError, ValueError, KeyError, struct.error, zlib.error) as error:
        raise LightsphereError(f"{path} cannot be read ({error}); copy it again, or save it with -v7") from error


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield type and content of the elements that follow each other in some bytes."""
    while len(data):
        kind, size = struct.unpack_from(f"{order}II", data)
        if kind >> 16:  # a small one, with its content in the tag
            kind, size, start, end = kind & 0xFFFF, kind >> 16, 4, 8
        else:
            start, end = 8, 8 + size + (-size % 8 if kind != COMPRESSED else 0)
        if size > len(data) - start or (start == 4 and size > 4):
            raise ValueError("it ends too early")
        yield kind, data[start : start + size]
        data = data[end:]


def _variable(kind: int, content: memoryview, order: str) -> tuple[str, NDArray[np.generic]] | None:
    """Return name and array of an element, None where it is no real array of numbers."""
    if kind == COMPRESSED:
        unpacking = zlib.decompressobj()
        unpacked = unpacking.decompress(content, MOST_BYTES)
        if unpacking.unconsumed_tail or not unpacking.eof:
            raise ValueError("a variable is too large or ends too early")
        kind, content = next(_elements(memoryview(unpacked), order), (0, content[:0]))
    if kind != MATRIX:
        return None
    parts = _elements(content, order)
    flags = struct.unpack_from(f"{order}I", next(parts, (0, content[:0]))[1])[0]
    if flags & COMPLEX or not FIRST_NUMBER <= flags & 0xFF <= LAST_NUMBER:
        return None
    shape, name, values = _numbers(parts, order), next(parts, (0, content[:0]))[1], _numbers(parts, order)
    sizes = shape.tolist()
    if len(sizes) > MOST_AXES or min(sizes, default=-1) < 0 or math.prod(sizes) != len(values):
        raise ValueError("an array's size is not that of its numbers")
    return bytes(name).decode("ascii", "replace"), values.reshape(sizes, order="F")


def _numbers(parts: Iterator[tuple[int, memoryview]], order: str) -> NDArray[np.generic]:
    for kind, content in parts:
        return np.frombuffer(content, np.dtype(order + TYPES[kind]))
    raise ValueError("an array ends too early")
