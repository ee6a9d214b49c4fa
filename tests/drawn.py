"""Captures of closed-form surfaces that are held in memory, for solvers that read a capture's pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.core.camera import Camera
from pipeline.core.capture import Capture
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.rig import TURN, sphere
from pipeline.core.shape import Shape
from pipeline.core.shape.coarse_to_fine import Views
from pipeline.core.shape.double_sphere import depth_limits, recover
from pipeline.core.shape.observations import noise_of, observe
from pipeline.core.shape.settings import ShapeSettings
from tests import oracles

DIAMETER = 1.6  # of the ball in tests/synthetic.py
Reflect = Callable[[NDArray[Any], NDArray[Any], NDArray[Any]], NDArray[np.float64]]


@dataclass(frozen=True)
class Drawn(Capture):
    """A capture with its pictures (L, H, W, 3) and mask (H, W) in memory."""

    pictures: NDArray[np.float32] | None = None
    seen: NDArray[np.bool_] | None = None

    def image(self, light: int) -> NDArray[np.float32]:
        assert self.pictures is not None
        return self.pictures[light]

    def mask(self) -> NDArray[np.bool_]:
        assert self.seen is not None
        return self.seen


def lambert(normal: NDArray[Any], to_light: NDArray[Any], to_viewer: NDArray[Any]) -> NDArray[np.float64]:
    return oracles.lambert_cosine(normal, to_light, 0.5)


def ggx(normal: NDArray[Any], to_light: NDArray[Any], to_viewer: NDArray[Any]) -> NDArray[np.float64]:
    glossy = oracles.ggx_cosine(normal, to_light, to_viewer, ROUGHNESS)
    return oracles.lambert_cosine(normal, to_light, 0.3) + 0.3 * glossy


def beckmann(normal: NDArray[Any], to_light: NDArray[Any], to_viewer: NDArray[Any]) -> NDArray[np.float64]:
    glossy = oracles.beckmann_cosine(normal, to_light, to_viewer, ROUGHNESS)
    return oracles.lambert_cosine(normal, to_light, 0.3) + 0.3 * glossy


ROUGHNESS = 0.55


def two_spheres(inner: int = 80, outer: int = 20) -> Lights:
    """Lights of unit power on spheres of 2 and 3 m."""
    position = np.concatenate([2 * sphere(inner), 3 * sphere(outer) @ TURN.T])
    return Lights("near", position, np.full((inner + outer, 3), 12.0), np.repeat([0, 1], [inner, outer]))


def draw(shape: Shape, lights: Lights, reflect: Reflect, digits: type = np.float32) -> Drawn:
    """Draw a convex surface under each light, black where it faces away: f cos I / d^2, or f cos E."""
    points, known = np.nan_to_num(shape.points()), np.isfinite(shape.depth)
    normal = shape.camera.normals_to_world(np.nan_to_num(shape.normal))
    to_viewer = -shape.camera.rays()[1]
    pictures = np.empty((len(lights), *known.shape, 3), digits)
    for i in range(len(lights)):
        far = lights.kind == "distant"
        reach = np.broadcast_to(lights.position[i], points.shape) if far else lights.position[i] - points
        picture = reflect(normal, oracles.unit(reach), to_viewer) / (1.0 if far else (reach**2).sum(-1))
        pictures[i] = np.where(known, picture, 0)[..., None] * lights.intensity[i]
    names = tuple(f"light_{i:04d}.exr" for i in range(len(lights)))
    notes = {"diameter": DIAMETER, "transport": {"bounces": 0}}
    return Drawn(Path("drawn"), shape.camera, lights, names, ("",) * len(names), notes, pictures, known)


def solved(capture: Capture, **settings: Any) -> Shape:
    return finish(recover(capture, ShapeSettings(**settings)))


def errors(found: Shape, true: Shape) -> NDArray[np.float64]:
    """Absolute depth errors of the pixels that both know [% of the ball's diameter]."""
    apart = np.abs(found.depth.astype(np.float64) - true.depth)
    return np.asarray(100 * apart[np.isfinite(apart)] / DIAMETER)


def views(capture: Drawn) -> Views:
    """What the solver's parts are given."""
    mask = capture.mask()
    seen = finish(observe(capture, mask, 1024.0))
    rays = rays_of(capture.camera, mask)
    near, far = depth_limits(rays, capture.lights.position[capture.lights.on("inner")])
    return Views(mask, rays, near, far, seen.values, capture.lights.position, noise_of(seen), seen.bounced)


def rays_of(camera: Camera, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    origins, directions = camera.rays()
    return np.ascontiguousarray(np.concatenate([origins[mask], directions[mask]], axis=1))
