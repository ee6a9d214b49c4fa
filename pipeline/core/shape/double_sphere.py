"""Depth of every pixel for any BRDF, from point lights on two nested surfaces (Magda et al. 2001)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..capture import Capture
from ..errors import LightsphereError
from ..progress import Work
from . import Shape, joint
from .beyond_model import compare
from .coarse_to_fine import Solution, Views, solve
from .lobe import DEPTH, NX
from .observations import noise_of, observe
from .settings import ShapeSettings

NEAREST = 1e-3  # share of the surface's radius that stays free before the camera


def recover(capture: Capture, settings: ShapeSettings) -> Work[Shape]:
    """Recover depth, normal and confidence of every pixel of a double-sphere capture.

    Parameters
    ----------
    capture : Capture
        Near lights on an inner and an outer surface, of any shape, closed or not, in any number and of any power.
        The lit surface lies inside the inner one.
    settings : ShapeSettings

    Returns
    -------
    Shape
        Depth and normal NaN and confidence 0 where fewer than ``settings.min_lit`` lights are lit.

    Raises
    ------
    LightsphereError
        When the lights cannot fix depths (no two surfaces, coincident or coplanar lights), or a picture is damaged.
    """
    check_lights(capture)
    mask = capture.mask()
    if not mask.any():
        raise LightsphereError(f"{capture.folder}: no pixel shows the object; aim the camera at it and capture again")
    observations = yield from observe(capture, mask, settings.memory)
    origins, directions = capture.camera.rays()
    rays = np.ascontiguousarray(np.concatenate([origins[mask], directions[mask]], axis=1))
    near, far = depth_limits(rays, capture.lights.position[capture.lights.on("inner")])
    views = Views(
        mask, rays, near, far, observations.values, capture.lights.position,
        noise_of(observations), observations.bounced,
    )  # fmt: skip
    solution = yield from solve(views, settings.min_lit)
    yield from compare(views, capture.lights.surface, solution)
    return as_shape(capture, mask, solution)


def check_lights(capture: Capture) -> None:
    """Raise LightsphereError when the lights cannot fix depths by double covering."""
    lights = capture.lights
    if lights.kind != "near":
        raise LightsphereError(f"{capture.folder} has {lights.kind} lights; double covering needs near point lights")
    for surface in ("inner", "outer"):
        if len(lights.on(surface)) < 4:
            raise LightsphereError(
                f"{capture.folder} has {len(lights.on(surface))} lights on the {surface} surface; "
                "capture with at least 4 on each"
            )
    extent = float(np.ptp(lights.position, axis=0).max())
    order = np.lexsort(np.round(lights.position / max(extent, 1e-30), 9).T)
    gaps = np.linalg.norm(np.diff(lights.position[order], axis=0), axis=1)
    same = np.flatnonzero(gaps <= 1e-7 * extent)
    if len(same):
        first, second = sorted(order[same[0] : same[0] + 2].tolist())
        raise LightsphereError(f"lights {first} and {second} coincide; remove one of them with its picture")
    thickness = np.linalg.svd(lights.position - lights.position.mean(axis=0), compute_uv=False)[2]
    if thickness <= 1e-6 * extent:
        raise LightsphereError(
            "all lights lie in one plane; move some of them out of it, depths are not fixed otherwise"
        )


def depth_limits(
    rays: NDArray[np.float64], inner: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where each ray enters and leaves the ball about the inner lights' centroid that holds them all.

    Parameters
    ----------
    rays : (P, 6) float64
        Origin [m] and unit direction.
    inner : (L, 3) float64
        The inner lights [m].

    Returns
    -------
    near, far : (P,) float64
        Depths [m], ``near < far``; a ray that misses the ball gets its closest point, half a radius to both sides.
    """
    centre = inner.mean(axis=0)
    radius = float(np.linalg.norm(inner - centre, axis=1).max())
    to_centre = rays[:, :3] - centre
    along = -(to_centre * rays[:, 3:]).sum(axis=1)
    half = np.sqrt(np.maximum(along**2 - (to_centre**2).sum(axis=1) + radius**2, 0.25 * radius**2))
    near = np.maximum(along - half, NEAREST * radius)
    return near, np.maximum(along + half, near + 0.5 * radius)


def as_shape(capture: Capture, mask: NDArray[np.bool_], solution: Solution) -> Shape:
    """Put the solution of the masked pixels back into pictures."""
    solved = solution.kind != joint.NONE
    depth = np.where(solved, solution.state[:, DEPTH], np.nan)
    normal = capture.camera.normals_to_camera(solution.state[:, NX : NX + 3])
    scale = np.nanmedian(depth) * 1e-2
    confidence = np.where(solved, 1.0 / (1.0 + solution.deviation / scale), 0.0)
    picture = _Pictures(mask)
    return Shape(
        camera=capture.camera,
        depth=picture(depth),
        normal=picture(np.where(solved[:, None], normal, np.nan)),
        confidence=picture(confidence, outside=0.0),
        layers={"residual": picture(np.where(solved, solution.spread, np.nan))},
        notes={"capture": str(capture.folder.resolve())},
    )


class _Pictures:
    """Spread values of masked pixels over the picture."""

    def __init__(self, mask: NDArray[np.bool_]) -> None:
        self.mask = mask

    def __call__(self, values: NDArray[np.float64], outside: float = np.nan) -> NDArray[np.float32]:
        picture = np.full(self.mask.shape + values.shape[1:], outside, np.float32)
        picture[self.mask] = values
        return picture
