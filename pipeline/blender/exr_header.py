"""Make OpenEXR files of equal pixels equal in every byte: Blender writes render times into their headers."""

from __future__ import annotations

import struct
from pathlib import Path

MAGIC = b"\x76\x2f\x31\x01"
TIME = b"_time"


def remove_times(path: Path) -> None:
    """Overwrite the digits of every ``*_time`` attribute in the header of a single-part OpenEXR file by zeros.

    The attribute keeps its length, since everything after the header is addressed by file offsets.
    Source: "OpenEXR File Layout", section header.
    """
    with path.open("r+b") as file:
        header = file.read(4096)
        if header[:4] != MAGIC:
            raise ValueError(f"{path} is not an OpenEXR file")
        offset = 8
        while header[offset]:
            name_end = header.index(b"\0", offset)
            type_end = header.index(b"\0", name_end + 1)
            (size,) = struct.unpack_from("<i", header, type_end + 1)
            start = type_end + 5
            if header[offset:name_end].endswith(TIME):
                value = header[start : start + size]
                file.seek(start)
                file.write(bytes(b"0"[0] if 48 <= byte <= 57 else byte for byte in value))
            offset = start + size
