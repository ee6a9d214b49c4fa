"""Small surfaces of which everything is known in closed form, and captures of them drawn by numpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.core import images
from pipeline.core.camera import Camera
from pipeline.core.capture import Capture
from pipeline.core.lights import Lights
from pipeline.core.rig import sphere
from pipeline.core.shape import Shape
from tests import oracles

RADIUS = 0.8


def camera(size: int = 48, model: str = "pinhole", distance: float = 5.0) -> Camera:
    """A camera on the z axis that looks at the origin and sees about 2 m."""
    to_world = np.eye(4)
    to_world[2, 3] = distance
    focal = size * distance / 2.0 if model == "pinhole" else size / 2.0
    return Camera(model, to_world, (size, size), (focal, focal), (size / 2, size / 2))


def shape_of(view: Camera, depth: NDArray[np.float64], world_normal: NDArray[np.float64]) -> Shape:
    known = np.isfinite(depth)
    normal = np.where(known[..., None], view.normals_to_camera(np.nan_to_num(world_normal)), np.nan)
    return Shape(view, depth.astype(np.float32), normal.astype(np.float32), known.astype(np.float32))


def ball(view: Camera) -> Shape:
    """A ball of RADIUS about the origin."""
    origins, directions = view.rays()
    along = -(origins * directions).sum(-1)
    inside = along**2 - (origins**2).sum(-1) + RADIUS**2
    depth = np.where(inside > 0, along - np.sqrt(np.maximum(inside, 0)), np.nan)
    return shape_of(view, depth, (origins + depth[..., None] * directions) / RADIUS)


def bowl(view: Camera, half_angle: float) -> Shape:
    """The inside of a ball of RADIUS about the origin, as far as so many degrees from its bottom, seen from above."""
    origins, directions = view.rays()
    along = -(origins * directions).sum(-1)
    inside = along**2 - (origins**2).sum(-1) + RADIUS**2
    depth = along + np.sqrt(np.maximum(inside, 0))
    points = origins + depth[..., None] * directions
    seen = (inside > 0) & (points[..., 2] < -RADIUS * np.cos(np.radians(half_angle)))
    return shape_of(view, np.where(seen, depth, np.nan), -points / RADIUS)


def plane(view: Camera, normal: NDArray[np.float64], offset: float = 0.0) -> Shape:
    """A plane through ``offset * normal``."""
    origins, directions = view.rays()
    depth = (offset - origins @ normal) / (directions @ normal)
    return shape_of(view, depth, np.broadcast_to(normal, origins.shape))


def step(view: Camera, height: float) -> Shape:
    """Two planes that face the camera, the right one nearer by a height."""
    low, high = (plane(view, np.array([0.0, 0.0, 1.0]), z) for z in (0.0, height))
    right = np.arange(view.resolution[0]) >= view.resolution[0] // 2
    return shape_of(
        view, np.where(right, high.depth, low.depth), np.broadcast_to([0.0, 0.0, 1.0], (*low.depth.shape, 3))
    )


def crease(view: Camera) -> Shape:
    """A roof: two planes of 60 degrees slant that meet in a ridge towards the camera."""
    tilt = np.radians(60)
    left, right = (plane(view, np.array([s * np.sin(tilt), 0.0, np.cos(tilt)]), 0.3) for s in (-1, 1))
    nearer = left.depth > right.depth
    depth = np.where(nearer, left.depth, right.depth)
    normal = np.where(nearer[..., None], left.normal, right.normal)
    return shape_of(view, depth, view.normals_to_world(normal))


def lights(inner: int = 60, outer: int = 20) -> Lights:
    position = np.concatenate([2 * sphere(inner), 3 * sphere(outer)])
    return Lights("near", position, np.full((inner + outer, 3), 12.0), np.repeat([0, 1], [inner, outer]))


def write_capture(
    folder: Path,
    shape: Shape,
    albedo: NDArray[np.float64],
    specular: NDArray[np.float64],
    roughness: float,
    shadow: NDArray[np.bool_] | None = None,
) -> Capture:
    """Draw a surface under lights: L = (albedo cos / pi + specular D G / (4 cos_o)) I / d^2, black where shadowed.

    ``albedo`` and ``specular`` are (3,) or (H, W, 3); ``shadow`` is (L, H, W).
    """
    lamps = lights()
    points, known = shape.points(), np.isfinite(shape.depth)
    normal = shape.camera.normals_to_world(np.nan_to_num(shape.normal))
    to_viewer = -shape.camera.rays()[1]
    names = []
    for i in range(len(lamps)):
        reach = lamps.position[i] - np.nan_to_num(points)
        to_light = oracles.unit(reach)
        diffuse = oracles.lambert_cosine(normal, to_light, 1.0)[..., None]
        glossy = oracles.ggx_cosine(normal, to_light, to_viewer, roughness)[..., None]
        picture = (albedo * diffuse + specular * glossy) * lamps.intensity[i] / (reach**2).sum(-1)[..., None]
        lit = known if shadow is None else known & ~shadow[i]
        names.append(f"light_{i:04d}.exr")
        images.write_rgb(folder / names[-1], np.where(lit[..., None], picture, 0).astype(np.float32))
    images.write_channels(folder / "mask.exr", {"mask.V": known.astype(np.float32)})
    made = Capture(folder, shape.camera, lamps, tuple(names), ("",) * len(names), {})
    made.save()
    return made
