"""The pictures of a capture arranged by pixel, ready for light at new places."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from ..camera import Camera
from ..capture import Capture
from ..errors import LightsphereError
from ..lights import Lights
from ..progress import Progress, Work
from ..shape import Shape
from ..shape.source import triangulate
from . import interpolant, lobes
from .emitters import Emitter
from .occlusion import Space, carved

ROWS = 4096
FAR = 1e4  # object sizes away at which lights at infinity are taken to stand
SHADOW_SHARE = 0.1  # of the expected value: a facing light that makes less is shadowed
FLOOR = 1e-3  # of the mean lit value, added to the expectation
MOST_RATIO = 100.0  # of value over expectation
REACH = 2.0  # steps of a pixel that are longer than so many of its widths lead to another surface


@dataclass(frozen=True)
class Stack:
    """What P pixels saw of L lights, relit by the source's rule.

    Parameters
    ----------
    resolution : (int, int)
        Width and height of the pictures [px].
    place : (2, P) int64
        Row and column of every pixel.
    points, normals, views : (P, 3) float64
        World space; normals and directions to the camera are unit vectors.
    lights : (L, 3) float64
        Positions [m]; lights at infinity stand :data:`FAR` away.
    values : (P, L, 3) float32
        Radiance over the light's intensity; NaN where saturated or not a number.
    triangles : (T, 3) int64
        Of the lights on the inner surface.
    """

    resolution: tuple[int, int]
    place: NDArray[np.int64]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    views: NDArray[np.float64]
    lights: NDArray[np.float64]
    values: NDArray[np.float32]
    triangles: NDArray[np.int64]

    def spacing(self) -> float:
        """Return the median angle between a light and the one next to it, as the object sees them [degrees]."""
        direction = self.lights - self.points.mean(axis=0)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        cosine = direction @ direction.T - 2.0 * np.eye(len(direction))
        return float(np.degrees(np.median(np.arccos(np.clip(cosine.max(axis=1), -1.0, 1.0)))))

    def add(self, emitter: Emitter, out: NDArray[np.float64]) -> None:
        """Add the light of an emitter to the pixels' radiance (P, 3)."""
        arriving = emitter.irradiance(self.points)
        interpolant.add_light_by_source(
            self.points, self.values, self.lights, self.triangles, emitter.place, emitter.distant, arriving, out
        )


@dataclass(frozen=True)
class Expected:
    """A stack whose lit values stand over what is expected of them; it has taken the values of the stack for its own.

    Parameters
    ----------
    stack : Stack
    weights, kinds, around, offsets, reach
        As :func:`pipeline.core.relight.interpolant.add_light` takes them.
    space : Space
    """

    stack: Stack
    weights: NDArray[np.float32]
    kinds: NDArray[np.uint8]
    around: NDArray[np.int32]
    offsets: NDArray[np.float64]
    reach: NDArray[np.float64]
    space: Space

    def add(self, emitter: Emitter, out: NDArray[np.float64]) -> None:
        """Add the light of an emitter to the pixels' radiance (P, 3)."""
        s, space = self.stack, self.space
        arriving = emitter.irradiance(s.points)
        interpolant.add_light(
            s.points, s.normals, s.views, self.weights, s.values, self.kinds, self.around, self.offsets, self.reach,
            space.codes, space.frames, space.points, space.ahead, space.rotation,
            s.lights, emitter.place, emitter.distant, arriving, out,
        )  # fmt: skip


def arrange(capture: Capture, shape: Shape, memory: float) -> Work[Stack]:
    """Read every picture of a capture once and arrange it by the object's pixels.

    Parameters
    ----------
    capture : Capture
        Of near or distant lights.
    shape : Shape
        Of that capture.
    memory : float
        Above this many MB the values live in an unnamed file beside the system's temporary files.

    Raises
    ------
    LightsphereError
        When the shape is of another capture, knows no depth, or a picture cannot be read.
    """
    stack = unread(capture, shape, memory)
    mask = capture.mask()
    _, intensity = placed(capture.lights, stack.points)
    for light in range(len(capture)):
        seen = usable(capture, light, mask)
        stack.values[:, light] = seen / np.maximum(intensity[light], 1e-30).astype(np.float32)
        yield Progress("read", light + 1, len(capture), "pictures")
    return stack


def usable(capture: Capture, light: int, mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return what a mask's pixels show under a light, (P, 3); NaN where it is saturated or not a number."""
    seen = capture.image(light)[mask]
    limit = float(capture.notes.get("saturation", np.inf))
    good = np.isfinite(seen).all(axis=1) & (seen < limit).all(axis=1)
    return np.where(good[:, None], seen, np.float32(np.nan))


def unread(capture: Capture, shape: Shape, memory: float) -> Stack:
    """Return the stack of a capture whose values are still to be filled in; see :func:`arrange`."""
    check(capture, shape)
    mask = capture.mask()
    place = np.stack(np.nonzero(mask))
    points, normals, views = surface(shape, mask)
    lights, _ = placed(capture.lights, points)
    values = _allocate((place.shape[1], len(capture), 3), memory)
    inner = capture.lights.on("inner")
    triangles = inner[triangulate(lights[inner])] if len(inner) >= 4 else np.empty((0, 3), np.int64)
    return Stack(capture.camera.resolution, place, points, normals, views, lights, values, triangles)


def surface(
    shape: Shape, mask: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return points, unit normals and directions to the camera (P, 3) of a mask's pixels, in the world.

    Pixels without depth take those of the nearest pixel that has one; where none has, LightsphereError is raised.
    """
    known = mask & np.isfinite(shape.depth) & np.isfinite(shape.normal).all(axis=-1)
    if not known.any():
        raise LightsphereError("the shape has no recovered pixel; recover the shape first")
    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)[:, mask]
    origins, directions = shape.camera.rays()
    points = origins[mask] + shape.depth[tuple(nearest)].astype(np.float64)[:, None] * directions[mask]
    normals = shape.camera.normals_to_world(shape.normal[tuple(nearest)])
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True), -directions[mask]


def placed(lights: Lights, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return position and radiant intensity (L, 3) of every light, at infinity as an object's points see it."""
    if lights.kind == "near":
        return lights.position, lights.intensity
    away = FAR * float(np.ptp(points, axis=0).max())
    return points.mean(axis=0) + away * lights.position, away**2 * lights.intensity


def check(capture: Capture, shape: Shape) -> None:
    """Raise LightsphereError unless a capture's lights are known and a shape has its camera."""
    if capture.lights.kind == "unknown":
        raise LightsphereError(
            f"{capture.folder}: the lights are unknown; find them by lightsphere shape --method uncalibrated"
        )
    own, other = shape.camera, capture.camera
    same = own.resolution == other.resolution and own.model == other.model
    if not (same and np.allclose(own.to_world, other.to_world) and np.allclose(own.focal, other.focal)):
        raise LightsphereError(
            f"the depth map is not of {capture.folder}: resolution or camera differ; give the shape made from it"
        )


def expect(stack: Stack) -> Work[tuple[NDArray[np.float32], NDArray[np.uint8]]]:
    """Fit what is expected of every pixel, put the stack's lit values over it in place, return weights and kinds."""
    cells = lobes.cells_of(*stack.place)
    order = np.argsort(cells, kind="stable")
    starts = np.searchsorted(cells[order], np.arange(cells.max() + 2))
    count = len(starts) - 1
    matrices = np.zeros((count, lobes.COLUMNS, lobes.COLUMNS))
    rights, shared = np.zeros((2, count, lobes.COLUMNS, 3))
    geometry = (stack.points, stack.normals, stack.views)
    lobes.cell_equations(*geometry, stack.lights, stack.values, starts, order, matrices, rights)
    lobes.solve_cells(matrices, rights, shared)
    pixels = len(cells)
    weights = np.zeros((pixels, lobes.COLUMNS + 1, 3), np.float32)
    kinds = np.zeros(stack.values.shape[:2], np.uint8)
    for start in range(0, pixels, ROWS):
        part = slice(start, min(start + ROWS, pixels))
        own = [array[part] for array in geometry]
        solved = np.empty((part.stop - start, lobes.COLUMNS, 3))
        lobes.solve_pixels(*own, stack.lights, stack.values[part], cells[part], matrices, shared, solved)
        weights[part, :-1] = solved
        interpolant.divide(
            *own, stack.lights, weights[part], stack.values[part], kinds[part], (SHADOW_SHARE, FLOOR, MOST_RATIO)
        )
        yield Progress("expect", part.stop, pixels, "pixels")
    return weights, kinds


def surrounded(stack: Stack, weights: NDArray[np.float32], kinds: NDArray[np.uint8], camera: Camera) -> Work[Expected]:
    """Return a stack, whose lit values stand over what is expected, with what its pixels tell of each other."""
    around, offsets = neighbourhood(stack)
    space = yield from carved(stack.points, stack.place, stack.lights, kinds, camera)
    return Expected(stack, weights, kinds, around, offsets, reach(stack, camera), space)


def reach(stack: Stack, camera: Camera) -> NDArray[np.float64]:
    """Return how far a step of each pixel may go on the same surface, (P,) [m]."""
    return np.asarray(REACH * camera.pixel_size(np.linalg.norm(stack.points - camera.to_world[:3, 3], axis=1)))


def neighbourhood(stack: Stack) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Return the pixels around each, (P, N), -1 for none, and where in the picture those are, (N, 2) [px]."""
    ring = interpolant.RING
    width, height = stack.resolution
    number = np.full((height + 2 * ring, width + 2 * ring), -1, np.int32)
    row, column = stack.place + ring
    number[row, column] = np.arange(len(row))
    steps = [(i, j) for i in range(-ring, ring + 1) for j in range(-ring, ring + 1)]
    return np.stack([number[row + i, column + j] for i, j in steps], axis=1), np.array(steps, np.float64)


def _allocate(shape: tuple[int, ...], memory: float) -> NDArray[np.float32]:
    if np.prod(shape) * 4 <= memory * 2**20:
        return np.empty(shape, np.float32)
    with tempfile.TemporaryFile() as file:  # the mapping keeps it
        return np.memmap(file, np.float32, "w+", shape=shape)
