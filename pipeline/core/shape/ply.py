"""Meshes as binary PLY files: position, normal, texture coordinates, triangles (Turk 1994)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .. import images
from ..errors import LightsphereError
from .mesh import Mesh

_VERTEX = np.dtype([(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz", "s", "t")])
_FACE = np.dtype([("count", "u1"), ("index", "<i4", 3)])
_END = b"end_header\n"
MOST_DIGITS = 12  # of a number of vertices or faces


def write_ply(path: Path, mesh: Mesh) -> None:
    """Write a mesh atomically as a binary PLY file in single precision; raise LightsphereError where it cannot."""
    vertices = np.empty(len(mesh.vertices), _VERTEX)
    columns = np.concatenate([mesh.vertices, mesh.normals, mesh.uv], axis=1)
    for i, name in enumerate(_VERTEX.names or ()):
        vertices[name] = columns[:, i]
    faces = np.empty(len(mesh.faces), _FACE)
    faces["count"], faces["index"] = 3, mesh.faces
    images.write_bytes(path, _header(len(vertices), len(faces)) + vertices.tobytes() + faces.tobytes())


def read_ply(path: Path) -> Mesh:
    """Read a mesh that :func:`write_ply` wrote; raise LightsphereError for any other file."""
    if not path.is_file():
        raise LightsphereError(f"{path} is missing; run lightsphere shape again to write it")
    data = path.read_bytes()
    head = data[: data.find(_END) + len(_END)]
    words = [line.split() for line in head.split(b"\n") if line.startswith(b"element")]
    counts = [int(word[2]) for word in words if len(word) == 3 and word[2].isdigit() and len(word[2]) < MOST_DIGITS]
    if len(counts) != 2 or head != _header(*counts) or len(data) != len(head) + _sizes(*counts):
        raise LightsphereError(f"{path} is not a mesh of lightsphere or is cut off; run lightsphere shape again")
    vertices = np.frombuffer(data, _VERTEX, counts[0], len(head))
    faces = np.frombuffer(data, _FACE, counts[1], len(head) + vertices.nbytes)
    columns = np.stack([vertices[name] for name in _VERTEX.names or ()], axis=-1).astype(np.float64)
    return Mesh(columns[:, :3], columns[:, 3:6], columns[:, 6:], faces["index"].astype(np.int64))


def _header(vertices: int, faces: int) -> bytes:
    properties = "".join(f"property float {name}\n" for name in _VERTEX.names or ())
    return (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\n{properties}"
        f"element face {faces}\nproperty list uchar int vertex_indices\n"
    ).encode() + _END


def _sizes(vertices: int, faces: int) -> int:
    return vertices * _VERTEX.itemsize + faces * _FACE.itemsize
