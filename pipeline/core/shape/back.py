"""A back for a relief, so that it is watertight, casts whole shadows and looks sensible from behind. It is a guess.

Every vertex gets a partner on the same ray of the camera, further away: seen from the camera the back lies behind the
front, so that nothing changes there and nothing crosses. With d the depth of the front and c the depth of its contour,
drawn inside as smoothly as it can be (Laplace's equation on the mesh's edges), the back is as far behind the contour as
the front is before it, and a little thicker where the front is flat or hollow::

    thickness = LEAST footprint + max(2 (c - d), FLAT distance to the border)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.sparse.linalg import spsolve

from . import Shape
from .mesh import Mesh, edges_of

LEAST = 0.25  # footprints of a pixel
FLAT = 0.1

Array = NDArray[np.float64]
Faces = NDArray[np.int64]


def closed(mesh: Mesh, shape: Shape) -> Mesh:
    """Return a relief with a back and a rim: every edge has two triangles, all face outwards.

    Parameters
    ----------
    mesh : Mesh
        Of :func:`.mesh.relief`, or a simpler one of the same rays; its triangles come first, in their order. Vertices
        at which parts meet in a point are split.
    shape : Shape
        What the mesh was made from.

    Returns
    -------
    Mesh
        Texture coordinates of the back are those of the front.
    """
    front = _split(mesh)
    origins, rays = shape.camera.rays_at(_places(front, shape))
    depth = np.einsum("vi,vi->v", front.vertices - origins, rays)
    footprint = shape.camera.pixel_size(depth)
    edges, border = edges_of(front.faces)
    inside = _contour(depth, edges, border)
    thickness = LEAST * footprint + np.maximum(2 * (inside - depth), FLAT * _from_border(front, edges, border))
    behind = origins + (depth + thickness)[:, None] * rays
    count = len(front.vertices)
    rim = border[:, ::-1]  # as the triangle on the other side of the edge runs
    faces = np.concatenate(
        [
            front.faces,
            front.faces[:, ::-1] + count,
            np.stack([rim[:, 0], rim[:, 1], rim[:, 1] + count], axis=1),
            np.stack([rim[:, 0], rim[:, 1] + count, rim[:, 0] + count], axis=1),
        ]
    )
    vertices = np.concatenate([front.vertices, behind])
    normals = np.concatenate([front.normals, _normals(behind, front.faces[:, ::-1])])
    return Mesh(vertices, normals, np.concatenate([front.uv, front.uv]), faces)


def _split(mesh: Mesh) -> Mesh:
    """Split vertices whose triangles do not all hang together by edges there."""
    count = len(mesh.faces)
    corners = np.arange(3 * count).reshape(count, 3)
    ends = [(corners[:, i], corners[:, (i + 1) % 3]) for i in range(3)]
    first, second = (np.concatenate([pair[k] for pair in ends]) for k in (0, 1))
    vertex = mesh.faces.ravel()
    low, high = np.minimum(vertex[first], vertex[second]), np.maximum(vertex[first], vertex[second])
    order = np.lexsort([high, low])
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    a, b = order[:-1][same], order[1:][same]  # the two triangles' versions of one edge, which they run in turn
    joined = np.concatenate([np.stack([first[a], second[b]]), np.stack([second[a], first[b]])], axis=1)
    links = coo_array((np.ones(joined.shape[1]), joined), shape=(3 * count, 3 * count))
    _, group = connected_components(links, directed=False)
    _, chosen, faces = np.unique(group, return_index=True, return_inverse=True)
    source = vertex[chosen]
    return Mesh(mesh.vertices[source], mesh.normals[source], mesh.uv[source], faces.reshape(count, 3).astype(np.int64))


def _places(mesh: Mesh, shape: Shape) -> Array:
    """Return where vertices lie in the picture, (V, 2) [px]."""
    return np.stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]], axis=-1) * shape.camera.resolution


def _contour(depth: Array, edges: Faces, border: Faces) -> Array:
    """Return the border's depths drawn inside: the mean of its neighbours' at every other vertex."""
    fixed = np.zeros(len(depth), bool)
    fixed[border] = True
    weights = _symmetric(edges, np.ones(len(edges)), len(depth))
    laplacian = csr_array(_diagonal(weights.sum(axis=1)) - weights)
    free = np.flatnonzero(~fixed)
    result = depth.copy()
    if len(free):
        right = -laplacian[free][:, np.flatnonzero(fixed)] @ depth[fixed]
        result[free] = spsolve(laplacian[free][:, free].tocsc(), right)
    return result


def _from_border(mesh: Mesh, edges: Faces, border: Faces) -> Array:
    """Return every vertex's way to the border along edges [m]."""
    length = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    graph = _symmetric(edges, length, len(mesh.vertices))
    return np.asarray(dijkstra(graph, indices=np.unique(border), min_only=True))


def _normals(vertices: Array, faces: Faces) -> Array:
    """Return unit normals (V, 3): the mean of the triangles' by area."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal, total = np.cross(b - a, c - a), np.zeros_like(vertices)
    for i in range(3):
        np.add.at(total, faces[:, i], normal)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30))


def _symmetric(edges: Faces, values: Array, count: int) -> csr_array:
    both = np.concatenate([edges, edges[:, ::-1]])
    return csr_array(coo_array((np.concatenate([values, values]), both.T), shape=(count, count)))


def _diagonal(values: Array) -> csr_array:
    index = np.arange(len(values))
    return csr_array(coo_array((values, (index, index)), shape=(len(values),) * 2))
