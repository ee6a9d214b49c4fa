"""What may stand between the object and a light: space about it that no light was seen to cross.

Grids of voxels about the object, along the camera's axes. Empty are those that the camera looks through, before the
surface and beside the object, and those that the straight line from a lit pixel to its light crosses: space carving by
shadows (Savarese, Andreetto, Rushmeier, Bernardini and Perona 2007). All pixels carve together, so that a shadow's edge
between two lights is where the lines of other pixels, to other lights, pass the same occluder. What is left holds the
object, its unseen back too, and space that nothing tells of.

A shadow says that something stands on its line. Each voxel that is left is as dense as the surest of the shadows that
it may cast asks for: 1 / n where n steps of its line are left. A line to a new light is blocked as far as the densities
on it add up to one, in the mean of all grids: they are shifted against each other, so that what one of them rounds off
at an edge others keep.

Not modelled: occluders beyond the grid, and those that let light through. Shadows that no voxel left explains are told.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ..camera import Camera
from ..compiled import kernel, parallel_kernel
from ..progress import Progress, Work
from .lobes import direction

WIDER = 1.25  # than the object's largest extent is the grid
VOXEL = 0.4  # widths of a pixel
MOST = 320  # voxels along a side
SHIFTS = np.array([[0.0, 0.0, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.5, 0.5, 0.0]])  # of the grids, in voxels
STEP = 0.5  # of a voxel
AHEAD = 2.0  # widths of a pixel from a surface point to where its line begins to count
EMPTY, UNKNOWN = 0, 1  # codes of voxels; larger ones, of what stands on lines to shadowed lights, are of DENSITY
PER_OCTAVE, OCTAVES = 2, 10
DENSITY = np.append([0.0, 0.0], 2.0 ** (-np.arange(PER_OCTAVE * OCTAVES)[::-1] / PER_OCTAVE))  # of a step
NOT_EMPTY = np.append(0.0, np.ones(len(DENSITY) - 1))
PASSES = len(DENSITY)  # of each grid
AWAY, SHADOWED, LIT, BEYOND = 0, 1, 2, 3  # kinds of lights for a pixel; the last are shadowed by nothing in the grid


@dataclass(frozen=True)
class Space:
    """What P pixels know of the space about the object.

    Parameters
    ----------
    codes : (G, N, N, N) uint8
        Of every grid: EMPTY, UNKNOWN, or the place in DENSITY of how surely a voxel blocks light.
    frames : (G, 4) float64
        Lowest corner of each grid, in the camera's axes [m], and width of its voxels [m].
    points : (P, 3) float64
        In the camera's axes [m].
    ahead : (P,) float64
        Distance from each point from which on its lines count [m].
    rotation : (3, 3) float64
        From the camera's axes to the world's.
    """

    codes: NDArray[np.uint8]
    frames: NDArray[np.float64]
    points: NDArray[np.float64]
    ahead: NDArray[np.float64]
    rotation: NDArray[np.float64]


@kernel
def span(point: Any, u: Any, frame: Any, count: Any) -> Any:
    """Return where a line enters and leaves the grid; it leaves before it enters where it misses."""
    enter, leave = 0.0, np.inf
    for k in range(3):
        low, high = frame[k] - point[k], frame[k] + count * frame[3] - point[k]
        if u[k] != 0.0:
            enter = max(enter, min(low / u[k], high / u[k]))
            leave = min(leave, max(low / u[k], high / u[k]))
        elif low > 0.0 or high < 0.0:
            leave = -1.0
    return enter, leave


@kernel
def in_voxels(point: Any, u: Any, frame: Any) -> Any:
    """Return where a line starts and how far a metre on it goes, from the grid's corner, in voxels."""
    x, y, z = (point[0] - frame[0]) / frame[3], (point[1] - frame[1]) / frame[3], (point[2] - frame[2]) / frame[3]
    return x, y, z, u[0] / frame[3], u[1] / frame[3], u[2] / frame[3]


@kernel
def voxel(line: Any, s: Any, count: Any) -> Any:
    """Return the index of the voxel at a distance s along a line of :func:`in_voxels`."""
    i = min(max(int(line[0] + s * line[3]), 0), count - 1)
    j = min(max(int(line[1] + s * line[4]), 0), count - 1)
    k = min(max(int(line[2] + s * line[5]), 0), count - 1)
    return (i * count + j) * count + k


@kernel
def write(point: Any, u: Any, start: Any, end: Any, code: Any, codes: Any, frame: Any) -> None:
    """Write a code into the voxels on a line between two distances; what is empty stays so."""
    flat, count = codes.reshape(-1), len(codes)
    enter, leave = span(point, u, frame, count)
    s, end, line = max(start, enter), min(end, leave), in_voxels(point, u, frame)
    while s < end:
        at = voxel(line, s, count)
        if flat[at] != EMPTY:
            flat[at] = code
        s += STEP * frame[3]


@kernel
def total(point: Any, u: Any, start: Any, end: Any, worth: Any, most: Any, codes: Any, frame: Any) -> Any:
    """Return the sum of what the codes are worth at the steps of a line between two distances, at most so much."""
    flat, count = codes.reshape(-1), len(codes)
    enter, leave = span(point, u, frame, count)
    s, end, found, line = max(start, enter), min(end, leave), 0.0, in_voxels(point, u, frame)
    while s < end and found < most:
        found += worth[flat[voxel(line, s, count)]]
        s += STEP * frame[3]
    return min(found, most)


@kernel
def opacity(point: Any, u: Any, start: Any, end: Any, codes: Any, frames: Any) -> Any:
    """Return how surely something blocks a line between two distances: 0, or 1 as for a line to a shadowed light."""
    found = 0.0
    for g in range(len(codes)):
        found += total(point, u, start, end, DENSITY, 1.0, codes[g], frames[g])
    return found / len(codes)


@parallel_kernel
def look_through(depth: Any, focal: Any, centre: Any, is_pinhole: Any, margin: Any, codes: Any, frame: Any) -> None:
    """Empty what the camera sees to lie before the surface, or beside it; see :meth:`.Camera.project`.

    ``depth`` (H, W) is infinite beside the object, and what is out of the picture is beside it.
    """
    count, (height, width) = len(codes), depth.shape
    for i in prange(count):
        x = frame[0] + (i + 0.5) * frame[3]
        for j in range(count):
            y = frame[1] + (j + 0.5) * frame[3]
            for k in range(count):
                z = frame[2] + (k + 0.5) * frame[3]
                distance, scale = -z, 1.0
                if is_pinhole:
                    distance, scale = math.sqrt(x * x + y * y + z * z), -z
                column = math.floor(centre[0] + focal[0] * x / scale)
                row = math.floor(centre[1] - focal[1] * y / scale)
                inside = scale > 0.0 and 0 <= column < width and 0 <= row < height
                if not inside or distance < depth[int(row), int(column)] - margin:
                    codes[i, j, k] = EMPTY


@parallel_kernel
def draw_lines(  # type: ignore[no-untyped-def]
    points, lights, kinds, kind, code, ahead, codes, frame
):
    """Write a code on the lines to the lights of one kind (P, L). All write the same: their order does not matter."""
    for p in prange(len(points)):
        u = np.empty(3)
        for i in range(len(lights)):
            if kinds[p, i] == kind:
                far = math.sqrt(direction(points[p], lights[i], u))
                write(points[p], u, ahead[p], far, code, codes, frame)


@parallel_kernel
def measure_shadows(points: Any, lights: Any, kinds: Any, ahead: Any, codes: Any, frame: Any, shadows: Any) -> None:
    """Write the code of what must at least stand on every line to a shadowed light, (P, L).

    It is 0 for other lights, and where the line is empty.
    """
    for p in prange(len(points)):
        u = np.empty(3)
        for i in range(len(lights)):
            shadows[p, i] = 0
            if kinds[p, i] == SHADOWED:
                far = math.sqrt(direction(points[p], lights[i], u))
                steps = total(points[p], u, ahead[p], far, NOT_EMPTY, np.inf, codes, frame)
                if steps > 0.0:
                    shadows[p, i] = max(len(DENSITY) - 1 - int(PER_OCTAVE * math.log2(steps)), UNKNOWN + 1)


def carved(
    points: NDArray[np.float64],
    place: NDArray[np.int64],
    lights: NDArray[np.float64],
    kinds: NDArray[np.uint8],
    camera: Camera,
) -> Work[Space]:
    """Return what is known of the space about the object from its pixels' lights.

    Where voxels are wider than :data:`VOXEL` the grids share the pixels among them: lines are dense enough.

    Parameters
    ----------
    points : (P, 3) float64
    place : (2, P) int64
        Row and column of every pixel.
    lights : (L, 3) float64
    kinds : (P, L) uint8
        Changed in place where no grid explains a shadow: BEYOND.
    camera : Camera
    """
    rotation = np.ascontiguousarray(camera.to_world[:3, :3])
    local, shining = ((there - camera.to_world[:3, 3]) @ rotation for there in (points, lights))
    distance = camera.project(points)[1]
    pixel = camera.pixel_size(distance)
    low, high = local.min(axis=0), local.max(axis=0)
    size = max(WIDER * float((high - low).max()), float(pixel.max()))
    finest = VOXEL * float(np.median(pixel))
    width = max(finest, size / MOST)
    count = math.ceil(size / width)
    grids = len(SHIFTS)
    frames = np.column_stack([(low + high - count * width) / 2 + width * SHIFTS, np.full(grids, width)])
    codes = np.full((grids, count, count, count), UNKNOWN, np.uint8)
    depth = np.full(camera.resolution[::-1], np.inf)
    depth[tuple(place)] = distance
    ahead = AHEAD * pixel
    shares = min(grids, int((width / finest) ** 2))
    is_explained = np.zeros(kinds.shape, bool)
    for g in range(grids):
        look_through(depth, camera.focal, camera.centre, camera.model == "pinhole", width, codes[g], frames[g])
        own = slice(g % shares, None, shares)
        shadows = yield from _carve(g * PASSES, local[own], kinds[own], ahead[own], shining, codes[g], frames[g])
        is_explained[own] |= shadows > 0
    kinds[(kinds == SHADOWED) & ~is_explained] = BEYOND
    return Space(codes, frames, local, ahead, rotation)


def _carve(
    done: int, points: Any, kinds: Any, ahead: Any, lights: Any, codes: Any, frame: Any
) -> Work[NDArray[np.uint8]]:
    """Draw into one grid what points see of lights, and return the codes of the shadows that it explains, (P, L)."""
    passes = len(SHIFTS) * PASSES
    points, kinds, ahead = (np.ascontiguousarray(array) for array in (points, kinds, ahead))  # as kernels know them
    shadows = np.empty(kinds.shape, np.uint8)
    draw_lines(points, lights, kinds, LIT, EMPTY, ahead, codes, frame)
    yield Progress("carve", done + 1, passes, "passes")
    measure_shadows(points, lights, kinds, ahead, codes, frame, shadows)
    yield Progress("carve", done + 2, passes, "passes")
    for code in range(UNKNOWN + 1, len(DENSITY)):  # the surest last
        draw_lines(points, lights, shadows, code, code, ahead, codes, frame)
        yield Progress("carve", done + code + 1, passes, "passes")
    return shadows
