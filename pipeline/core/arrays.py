"""Arrays from ``.npz`` files, read without trust in them: no objects, no sizes that the file cannot hold."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from .errors import BROKEN_NPZ, LightsphereError

PACKED = 1100  # times as large as its packed bytes a file can be, by the method that zip files use
MOST_HEADER = 10_000  # letters of an array's description


def read_npz(path: Path) -> dict[str, NDArray[Any]]:
    """Read all arrays of a file that :func:`numpy.savez` wrote.

    Raises
    ------
    LightsphereError
        When the file is missing, damaged, no such file, or holds objects; the message does not name it.
    """
    if not zipfile.is_zipfile(path):  # numpy would take it for a single array or a pickle
        raise LightsphereError("the file is damaged or no .npz; write it again")
    try:
        with zipfile.ZipFile(path) as file:
            for member in file.infolist():
                _check(file, member)
        with np.load(path, allow_pickle=False) as data:
            return {name: data[name] for name in data}
    except BROKEN_NPZ as error:
        raise LightsphereError(f"the file is damaged ({error}); write it again, without objects") from error


def _check(file: zipfile.ZipFile, member: zipfile.ZipInfo) -> None:
    """Raise ValueError when an array is said to be larger than its bytes."""
    if member.file_size > PACKED * (member.compress_size + 1000):
        raise ValueError(f"{member.filename} is said to be larger than it can be")
    with file.open(member) as stream:
        version = npy.read_magic(stream)
        readers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
        shape, _, kind = readers[version](stream, max_header_size=MOST_HEADER)
    if math.prod(shape) * kind.itemsize > member.file_size:
        raise ValueError(f"{member.filename} is said to be larger than it is")
