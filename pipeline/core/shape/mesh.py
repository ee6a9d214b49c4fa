"""The relief mesh through the recovered pixels, torn at depth edges.

**Where the surface is torn.** Between two neighbouring pixels the surface is taken as one when its slope could
have led from one depth to the other. With ``a`` and ``b`` the change of depth that the tangent plane of either
end predicts and ``c`` the change there is, a smooth surface, whose slope runs from one end's to the other's, has
``c`` between ``a`` and ``b`` (mean value theorem), and so has a crease between two planes. A depth edge has a ``c``
outside of them by more than the pixel's footprint ``s``. The edge is kept where ::

    excess = max(c - max(a, b), min(a, b) - c, 0) <= TOLERANCE (s + (|a| + |b|) / 2)

and where ``|c| <= STEEPEST s``. Every term scales with the object, so the choice is the same in metres and in
millimetres; on a plane ``a = b = c``, and nothing is torn up to a slant of 84 degrees. Not told apart from a
surface: a depth edge whose front side turns away from the view so much at its last pixel that the tangent
there reaches the surface behind.

**Where it ends.** A border vertex stands half a pixel further out, where its pixel ends, then half way towards the
mean of its neighbours on the border, which takes the pixel stairs off a contour; it stays on its tangent plane.
With the border through the pixel centres a renderer would miss every border pixel (6 % of a teapot of 128 px), and
see through depth edges from the very camera. Pixel centres lie now nearer to a round contour, now farther off, where
depth changes by several pixels: teeth, from anywhere else. So border vertices slide along their rays, PASSES times half
way to the mean of where their neighbours' planes and their own together say that they are, which for a border of
constant curvature is where they belong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..errors import LightsphereError
from . import Shape

#: Excess over the tangents' predictions that is still one surface, in footprints: below one
#: footprint a step cannot be told from a slope of 45 degrees within a pixel.
TOLERANCE = 1.0
#: Steepest slope in footprints: beyond 84 degrees a pixel covers ten times its width of surface, and
#: what joins two pixels is the guess that hangs between a contour and what lies behind it.
STEEPEST = 10.0
#: Steepest slope in footprints by which a border vertex is moved: a tangent that leaves more steeply makes spikes.
BORDER_SLOPE = 2.0
#: Times that border vertices are drawn to where their neighbours' planes are.
PASSES = 32
#: Islands of fewer triangles carry no shape; they are what is left of single wrong pixels.
SMALLEST_ISLAND = 12

#: Corners of a quad in the order counter-clockwise for the viewer (rows run down), as (row, column).
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))


@dataclass(frozen=True)
class Mesh:
    """Triangles through pixel centres.

    Parameters
    ----------
    vertices : (V, 3) float64
        World space [m].
    normals : (V, 3) float64
        Unit, world space.
    uv : (V, 2) float64
        Pixel coordinates over the resolution, v upwards: textures of the capture's resolution fit texel by pixel.
    faces : (F, 3) int64
        Vertex indices, counter-clockwise as the camera sees them.
    """

    vertices: NDArray[np.float64]
    normals: NDArray[np.float64]
    uv: NDArray[np.float64]
    faces: NDArray[np.int64]


def relief(shape: Shape, least_confidence: float = 0.0) -> Mesh:
    """Return the mesh through the recovered pixels of a shape.

    Parameters
    ----------
    shape : Shape
        Depth, normals and confidence.
    least_confidence : float
        Pixels of this confidence or less are left out; 0 leaves out only what was not recovered.

    Returns
    -------
    Mesh
        One vertex per pixel that a triangle uses, at its centre but for the border. No edge has more than two
        triangles.

    Raises
    ------
    LightsphereError
        When no four neighbouring pixels make a surface.
    """
    points = shape.points()
    known = np.isfinite(points).all(-1) & np.isfinite(shape.normal).all(-1) & (shape.confidence > least_confidence)
    faces = _triangles(shape, known)
    faces = _without_islands(faces, known.size)
    if not len(faces):
        raise LightsphereError("the shape has no connected surface to mesh; recover more pixels or lower the threshold")
    used = np.unique(faces)
    position = np.full(known.size, -1)
    position[used] = np.arange(len(used))
    height, width = known.shape
    row, column = np.divmod(used, width)
    normals = shape.camera.normals_to_world(shape.normal).reshape(-1, 3)[used]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    centres = np.stack([column, row], axis=-1) + 0.5
    faces = position[faces]
    border = edges_of(faces)[1].T
    border = np.concatenate([border, border[::-1]], axis=1)
    place = centres + _outwards(faces, used, width)
    place = np.stack([_drawn(axis, axis[border[0]], border[1]) for axis in place.T], axis=-1)
    vertices = _placed(shape, points.reshape(-1, 3)[used], normals, place, border)
    uv = np.stack([place[:, 0] / width, 1.0 - place[:, 1] / height], axis=-1)
    return Mesh(vertices, normals, uv, faces)


def _triangles(shape: Shape, known: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Two triangles per quad, split along the diagonal whose ends agree, each with three continuous edges."""
    quads = _quads(known.shape)
    normals = shape.normal.reshape(-1, 3).astype(np.float64)
    usable = _Continuity(shape, known)
    sides = [usable(quads[:, i], quads[:, (i + 1) % 4]) for i in range(4)]
    faces = []
    # splits[d]: the triangles (corner indices) and their sides when the diagonal joins corners d and d + 2
    valid, agreement = [], []
    for d in (0, 1):
        diagonal = usable(quads[:, d], quads[:, d + 2])
        first = diagonal & sides[d] & sides[d + 1]
        second = diagonal & sides[d + 2] & sides[(d + 3) % 4]
        valid.append((first, second))
        agreement.append(np.einsum("pi,pi->p", normals[quads[:, d]], normals[quads[:, d + 2]]))
    count = [a.astype(int) + b for a, b in valid]
    second_diagonal = (count[1] > count[0]) | ((count[1] == count[0]) & (agreement[1] > agreement[0]))
    for d, chosen in ((0, ~second_diagonal), (1, second_diagonal)):
        for part, corners in zip(valid[d], ((d, d + 1, d + 2), (d + 2, (d + 3) % 4, d)), strict=True):
            faces.append(quads[chosen & part][:, corners])
    return np.concatenate(faces)


def _quads(size: tuple[int, int]) -> NDArray[np.int64]:
    """Return the flat pixel indices of every quad's corners, (Q, 4)."""
    height, width = size
    index = np.arange(height * width).reshape(height, width)
    return np.stack(
        [index[r : height - 1 + r, c : width - 1 + c].ravel() for r, c in CORNERS],
        axis=-1,
    )


class _Continuity:
    """Whether the surface runs on from pixel to pixel; see the module's docstring."""

    def __init__(self, shape: Shape, known: NDArray[np.bool_]) -> None:
        origins, directions = shape.camera.rays()
        self.known = known.ravel()
        self.depth = shape.depth.ravel().astype(np.float64)
        self.origins = origins.reshape(-1, 3)
        self.directions = directions.reshape(-1, 3)
        self.points = shape.points().reshape(-1, 3)
        self.normals = shape.camera.normals_to_world(shape.normal).reshape(-1, 3)

    def __call__(self, p: NDArray[np.int64], q: NDArray[np.int64]) -> NDArray[np.bool_]:
        change = self.depth[q] - self.depth[p]
        forward = self._predict(p, q) - self.depth[p]
        backward = self.depth[q] - self._predict(q, p)
        low, high = np.minimum(forward, backward), np.maximum(forward, backward)
        excess = np.maximum(np.maximum(change - high, low - change), 0.0)
        footprint = self._footprint(p, q)
        allowed = TOLERANCE * (footprint + (np.abs(forward) + np.abs(backward)) / 2)
        smooth = (excess <= allowed) & (np.abs(change) <= STEEPEST * footprint)
        return np.asarray(self.known[p] & self.known[q] & smooth)

    def _predict(self, p: NDArray[np.int64], q: NDArray[np.int64]) -> NDArray[np.float64]:
        """Depth along the ray of q of the tangent plane at p; far away where the ray runs along the plane."""
        normal = self.normals[p]
        above = np.einsum("pi,pi->p", normal, self.points[p] - self.origins[q])
        along = np.einsum("pi,pi->p", normal, self.directions[q])
        grazing = -1e-6  # a surface that is seen faces the camera: normal . direction < 0
        return np.asarray(above / np.minimum(along, grazing))

    def _footprint(self, p: NDArray[np.int64], q: NDArray[np.int64]) -> NDArray[np.float64]:
        """Distance of the two rays at the nearer depth [m]."""
        nearer = np.fmin(self.depth[p], self.depth[q])[:, None]
        ends = [self.origins[i] + nearer * self.directions[i] for i in (p, q)]
        return np.asarray(np.linalg.norm(ends[1] - ends[0], axis=-1))


def _outwards(faces: NDArray[np.int64], pixels: NDArray[np.int64], width: int) -> NDArray[np.float64]:
    """Return how far every vertex moves right and down, (V, 2) [px]: half a pixel off a side without an edge."""
    ends = np.concatenate([faces[:, [i, j]] for i in range(3) for j in range(3) if i != j])
    step = pixels[ends[:, 1]] - pixels[ends[:, 0]]
    joined = np.zeros((4, len(pixels)))
    for side, wanted in enumerate((1, -1, width, -width)):
        joined[side, ends[step == wanted, 0]] = 1.0
    right, left, down, up = joined
    return np.asarray(np.stack([left - right, up - down], axis=-1) / 2)


def edges_of(faces: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return all edges once, (E, 2), and those with one triangle as it runs along them, (B, 2)."""
    along = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, first, count = np.unique(np.sort(along, axis=1), axis=0, return_index=True, return_counts=True)
    return along[first], along[first[count == 1]]


def _drawn(values: NDArray[np.float64], seen: NDArray[np.float64], ends: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return vertices' values (V,), on the border half way to the mean of what their neighbours say of them, (E,)."""
    count = np.bincount(ends, minlength=len(values))
    said = np.bincount(ends, seen, len(values)) / np.maximum(count, 1)
    return np.where(count > 0, (values + said) / 2, values)


def _placed(
    shape: Shape,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    place: NDArray[np.float64],
    border: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Move vertices to other places (V, 2) of the picture [px] on their tangent planes, and border vertices along
    their rays to where their neighbours' planes meet these; border edges (2, E) from one end to the other, then back.
    """
    origins, directions = shape.camera.rays_at(place)
    depth = _met(points, normals, origins, directions)
    starts, ends = border
    back = np.roll(np.arange(len(starts)), len(starts) // 2)
    for _ in range(PASSES):
        there = origins[starts] + depth[starts, None] * directions[starts]
        rise = _met(there, normals[starts], origins[ends], directions[ends]) - depth[starts]
        depth = _drawn(depth, depth[starts] + (rise - rise[back]) / 2, ends)
    return np.asarray(origins + depth[:, None] * directions)


def _met(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the depths along rays at which they meet tangent planes, no farther than BORDER_SLOPE lets these run."""
    depth = np.einsum("pi,pi->p", points - origins, directions)
    limit = BORDER_SLOPE * np.linalg.norm(origins + depth[:, None] * directions - points, axis=-1)
    along = np.minimum(np.einsum("pi,pi->p", normals, directions), -1e-6)
    met = np.einsum("pi,pi->p", normals, points - origins) / along
    return np.asarray(np.clip(met, depth - limit, depth + limit))


def _without_islands(faces: NDArray[np.int64], pixels: int) -> NDArray[np.int64]:
    """Leave out connected pieces of fewer than SMALLEST_ISLAND triangles."""
    start, end = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    graph = coo_array((np.ones(len(start), np.int8), (start, end)), shape=(pixels, pixels))
    piece = connected_components(graph, directed=False)[1][faces[:, 0]]
    return np.asarray(faces[np.bincount(piece, minlength=1)[piece] >= SMALLEST_ISLAND])
