"""Maps of a picture's pixels brought into the texture space of a mesh: what each texel's surface point shows."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from ..errors import LightsphereError
from ..shape import Shape
from ..shape.scan import Scan, blend

Visible = Callable[[NDArray[np.float64]], NDArray[np.bool_]]

SIZES = (16, 4096)  # of a texture [texels]
FINER = 1.5  # texels along a pixel's side: bilinear lookup blurs nothing that the pictures hold
CANDIDATES = 2_000_000  # texels that are tested at once
MOST_AREA = 4.0  # of all charts, in unit squares: a texture that repeats more cannot tell places apart
GRAZING = 0.1  # cosine of view and surface below which a texel is taken for unseen
SAME_SURFACE = 1.5  # distance [footprints] of a texel's point from the tangent plane of a pixel that shows it


def texture_size(scan: Scan, face: NDArray[np.int64]) -> int:
    """Return the power of two at which the pixels' and the texels' density on the seen surface come nearest.

    Parameters
    ----------
    scan : Scan
        Of one texture space.
    face : (K,) int64
        The triangle that each pixel shows.
    """
    area = float(np.abs(_areas(scan.uv)[np.unique(face)]).sum())
    if not len(face) or area <= 0:
        return SIZES[0]
    wanted = FINER * np.sqrt(len(face) / area)
    return int(np.clip(2 ** np.ceil(np.log2(wanted)), *SIZES))


def rasterise(uv: NDArray[np.float64], size: int | tuple[int, int]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return which triangle covers each texel's centre, and where.

    Parameters
    ----------
    uv : (T, 3, 2) float64
        Texture coordinates, v upwards; outside the unit square the texture repeats.
    size : int or (int, int)
        Side of the square texture, or width and height.

    Returns
    -------
    face : (H, W) int64
        -1 where there is none; of triangles that lie on each other the last. Rows top-down.
    weights : (H, W, 3) float64
        Barycentric coordinates of the centre.

    Raises
    ------
    LightsphereError
        When the charts cover the texture several times.
    """
    area = _areas(uv)
    if not np.isfinite(uv).all() or np.abs(area).sum() > MOST_AREA:
        raise LightsphereError(
            "the mesh's UVs repeat its texture, so that no texel is one place; unwrap the mesh, or delete its UVs"
        )
    width, height = np.broadcast_to(size, 2).tolist()
    place = np.stack([uv[..., 0], 1.0 - uv[..., 1]], axis=-1) * (width, height) - 0.5
    low = np.ceil(place.min(axis=1)).astype(np.int64)
    span = np.maximum(np.floor(place.max(axis=1)).astype(np.int64) - low + 1, 0)
    count = span.prod(axis=1) * (area != 0)
    face, weights = np.full((height, width), -1, np.int64), np.zeros((height, width, 3))
    for part in _blocks(count):
        which = np.repeat(part, count[part])
        index = np.arange(len(which)) - np.repeat(np.cumsum(count[part]) - count[part], count[part])
        column, row = (low[which] + np.stack([index % span[which, 0], index // span[which, 0]], axis=-1)).T
        centre = np.stack([column, row], axis=-1)
        a, b, c = (place[which, i] - centre for i in range(3))
        shares = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=-1)
        shares /= shares.sum(axis=-1, keepdims=True)
        inside = (shares >= -1e-9).all(axis=-1)
        where = row[inside] % height, column[inside] % width
        face[where], weights[where] = which[inside], shares[inside]
    return face, weights


def bake(
    maps: NDArray[np.float32], shape: Shape, scan: Scan, size: int, visible: Visible
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return a picture's maps in a texture space.

    Parameters
    ----------
    maps : (H, W, C) float32
        NaN where unknown.
    shape : Shape
        The surface that the pixels show.
    scan : Scan
        Of one texture space.
    size : int
        Of the texture.
    visible : callable
        Tells of points (K, 3) on the mesh which of them nothing hides from the camera.

    Returns
    -------
    texture : (size, size, C) float32
        Interpolated between those of the four pixels around that show the same surface. What was not seen has the
        values of the nearest point that was, and texels on no chart those of the nearest chart, for texture filters.
    confidence : (size, size) float32
        Cosine of view and surface times the share of the interpolation's weight that found pixels; 0 where the point
        is hidden, steeper than 84 degrees, outside the picture or on no chart.

    Raises
    ------
    LightsphereError
        When the pictures show nothing of this texture space, or its UVs repeat.
    """
    face, weights = rasterise(scan.uv, size)
    on_chart = face >= 0
    chosen, shares = face[on_chart], weights[on_chart]
    points = blend(scan.corners[chosen], shares)
    place, _ = shape.camera.project(points)
    directions = shape.camera.rays_at(place)[1]
    facing = np.abs((scan.surface_normals()[chosen] * directions).sum(axis=-1))
    good = np.flatnonzero(facing > GRAZING)
    good = good[visible(points[good])]
    values, found = _looked_up(maps, shape, points[good], place[good])
    sure = np.zeros(len(points), np.float32)
    sure[good] = found * facing[good]
    if not found.any():
        raise LightsphereError("the pictures show nothing of a part of the mesh; leave that part out")
    nearest = cKDTree(points[good][found > 0]).query(points)[1]
    texture, confidence = np.zeros((size, size, maps.shape[-1]), np.float32), np.zeros((size, size), np.float32)
    texture[on_chart], confidence[on_chart] = values[found > 0][nearest], sure
    beside = distance_transform_edt(~on_chart, return_distances=False, return_indices=True)
    return texture[tuple(beside)], confidence


def _looked_up(
    maps: NDArray[np.float32], shape: Shape, points: NDArray[np.float64], place: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Return the maps at places (K, 2) of the picture [px] and the share of the weight that showed the points."""
    height, width = shape.depth.shape
    surface = shape.points()
    normals = shape.camera.normals_to_world(shape.normal)
    footprint = shape.camera.pixel_size(shape.depth)
    corner = np.floor(place - 0.5).astype(np.int64)
    inner = place - 0.5 - corner
    total, found = np.zeros((len(points), maps.shape[-1])), np.zeros(len(points))
    for right, down in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = corner[:, 0] + right, corner[:, 1] + down
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        row, column = np.where(inside, row, 0), np.where(inside, column, 0)
        apart = np.abs(((points - surface[row, column]) * normals[row, column]).sum(axis=-1))
        same = inside & (apart < SAME_SURFACE * footprint[row, column]) & np.isfinite(maps[row, column]).all(axis=-1)
        weight = np.where(right, inner[:, 0], 1 - inner[:, 0]) * np.where(down, inner[:, 1], 1 - inner[:, 1]) * same
        total += weight[:, None] * np.where(same[:, None], maps[row, column], 0.0)
        found += weight
    with np.errstate(invalid="ignore", divide="ignore"):
        return (total / found[:, None]).astype(np.float32), found


def _blocks(count: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    """Split triangles so that each block has some two million candidate texels, or is one triangle."""
    total = np.cumsum(count)
    number = (total - 1) // CANDIDATES
    starts = np.flatnonzero(np.diff(number, prepend=-1))
    for part in np.split(np.arange(len(count)), starts[1:]):
        yield part[count[part] > 0]


def _areas(uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the signed areas of triangles in texture space (T,), in unit squares."""
    return _cross(uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]) / 2


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
