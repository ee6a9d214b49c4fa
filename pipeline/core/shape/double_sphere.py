"""Depth of every pixel for any BRDF, from point lights on two nested surfaces (Magda et al. 2001)."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..capture import Capture
from ..errors import LightsphereError
from ..progress import Work
from . import Shape, source
from .beyond_model import compare
from .coarse_to_fine import Solution, Views, neighbours_at, solve
from .integration import PAIR_ERROR, integrate
from .joint import GLOSSY, NONE
from .lobe import DEPTH, DIFFUSE, LOG_ALPHA, NX
from .observations import Observations, noise_of, observe
from .rounded import average_allowed
from .settings import ShapeSettings
from .tangents import disagreement

OWN_ERROR = 3.0  # expected error over the deviation that the fit states for itself
LEAST_SHARE = 0.5  # of its neighbours' deviations, below which no pixel's own is believed
MOST_DOUBT = 3.0  # disagreement with neighbours never exceeds this many of it: curved surfaces disagree, too
TURN = 2.0  # error of a normal over the angle by which an error in depth turns the directions to the lights
MOST_TURN = 0.5  # [rad], so that even pixels that know nothing follow from their neighbours
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
        Depth and normal NaN and confidence 0 where fewer than ``settings.min_lit`` lights are lit. Its notes hold
        ``saturated_values`` and ``broken_values``, how many values of the object's pixels were left out for that.

    Raises
    ------
    LightsphereError
        When the lights cannot fix depths (no two surfaces, coincident or coplanar lights), or a picture is damaged.
    """
    mask = capture.mask()
    if not mask.any():
        raise LightsphereError(f"{capture.folder}: no pixel shows the object; aim the camera at it and capture again")
    views, observations = yield from views_of(capture, mask, settings)
    left_out = {"saturated_values": int(observations.clipped.sum()), "broken_values": int(observations.bad.sum())}
    if settings.objective == "source":
        inner, outer = capture.lights.on("inner"), capture.lights.on("outer")
        found = yield from source.solve(views, inner, outer, settings.candidates, settings.min_lit)
        return dataclasses.replace(as_source_shape(capture, mask, found), notes=left_out)
    solution = yield from solve(views, settings.min_lit)
    yield from compare(views, capture.lights.surface, solution)
    if views.values.min() < 0.0 and not views.bounced:
        yield from average_allowed(views, solution)
    depth, deviation = settle(views, solution, capture.camera, settings.fuse)
    return dataclasses.replace(as_shape(capture, mask, solution, depth, deviation), notes=left_out)


def views_of(capture: Capture, mask: NDArray[np.bool_], settings: ShapeSettings) -> Work[tuple[Views, Observations]]:
    """Read what is given for the pixels of a mask (H, W); raises what :func:`recover` does."""
    check_lights(capture)
    observations = yield from observe(capture, mask, settings.memory)
    origins, directions = capture.camera.rays()
    rays = np.ascontiguousarray(np.concatenate([origins[mask], directions[mask]], axis=1))
    near, far = depth_limits(rays, capture.lights.position[capture.lights.on("inner")])
    views = Views(
        mask, rays, near, far, observations.values, capture.lights.position,
        noise_of(observations), observations.bounced,
    )  # fmt: skip
    return views, observations


def check_lights(capture: Capture) -> None:
    """Raise LightsphereError when the lights cannot fix depths by double covering."""
    lights = capture.lights
    if lights.kind != "near":
        other = "uncalibrated" if lights.kind == "unknown" else "acls"
        raise LightsphereError(
            f"{capture.folder} has {lights.kind} lights; double covering needs near point lights: use --method {other}"
        )
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


def settle(
    views: Views, solution: Solution, camera: Camera, fused: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return final depths and their expected errors, (P,) each [m]; NaN and infinite where not recovered.

    The expected error is made of the fit's own (its curvature, taken threefold since misfit is not independent from
    light to light, and not for much less than the neighbours'), of the disagreement with the neighbours, and of what
    fusion changed. Not modelled: pictures that were sampled beside the pixel centres; how much better than each of
    them many doubtful depths are together.
    """
    solved = solution.kind != NONE
    depth = np.where(solved, solution.state[:, DEPTH], np.nan)
    normal = np.where(solved[:, None], solution.state[:, NX : NX + 3], np.nan)
    own = OWN_ERROR * believed(views.mask, solution.deviation)
    expected = expected_error(views, own, depth, normal, camera.model == "pinhole")
    if not (fused and solved.any()):
        return depth, expected
    picture = _Pictures(views.mask, np.float64)
    seen, trust = picture(camera.normals_to_camera(normal)), picture(normal_confidence(views, expected))
    settled = integrate(seen, views.mask, camera, trust, picture(depth), picture(expected))[views.mask]
    return settled, np.hypot(expected, settled - depth)


def believed(mask: NDArray[np.bool_], deviation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return stated deviations (P,), raised to a share of the median in a square of three by three pixels.

    A fit that has run into a limit, or found an accidental minimum, states almost none.
    """
    around = neighbours_at(mask, np.arange(len(deviation)), 1)
    theirs = np.where((around >= 0) & np.isfinite(deviation[around]), deviation[around], np.nan)
    usual = np.nanmedian(np.column_stack([theirs, deviation]), axis=1)
    return np.asarray(np.maximum(deviation, LEAST_SHARE * usual))


def expected_error(
    views: Views, own: NDArray[np.float64], depth: NDArray[np.float64], normal: NDArray[np.float64], pinhole: bool
) -> NDArray[np.float64]:
    """Return the expected error (P,) [m] of depths that have one of their own and neighbours to disagree with."""
    apart = disagreement(views.mask, views.rays, depth, normal, pinhole)
    return np.hypot(own, np.minimum(apart, MOST_DOUBT * own))


def normal_confidence(views: Views, expected: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far the normals of depths with an expected error (P,) [m] are to be believed, (P,), 0 to 1.

    A wrong depth sees the lights in wrong directions, by the error over the lights' distance, and the normal turns
    with them. That angle adds to the one by which neighbours' tangent planes miss each other anyway.
    """
    turn = np.minimum(TURN * expected / (0.5 * (views.far - views.near)), MOST_TURN)
    return np.asarray(1.0 / (1.0 + (turn / PAIR_ERROR) ** 2))


def as_shape(
    capture: Capture,
    mask: NDArray[np.bool_],
    solution: Solution,
    depth: NDArray[np.float64],
    deviation: NDArray[np.float64],
) -> Shape:
    """Put the results of the masked pixels back into pictures.

    Confidence is 1 / (1 + expected error / (0.1 % of the object's width in the picture)): 1 where the depth is exact,
    1/2 where it is expected to be off by a thousandth of the object.
    """
    solved = solution.kind != NONE
    state = solution.state
    columns = np.flatnonzero(mask.any(axis=0))
    usual_depth = np.median(depth[solved]) if solved.any() else 1.0
    width = (columns[-1] - columns[0] + 1) * float(capture.camera.pixel_size(np.array(usual_depth)))
    expected = np.where(solved, deviation, np.inf)
    picture = _Pictures(mask)
    normal = np.where(solved[:, None], state[:, NX : NX + 3], np.nan)
    layers = {
        "expected_error": np.where(solved, expected, np.nan),
        "residual": np.where(solved, solution.spread, np.nan),
        "diffuse": np.where(solved, state[:, DIFFUSE], np.nan),
        "roughness": np.where(solution.kind == GLOSSY, np.exp(0.5 * state[:, LOG_ALPHA]), np.nan),
    }
    return Shape(
        camera=capture.camera,
        depth=picture(depth),
        normal=picture(np.asarray(normal @ capture.camera.to_world[:3, :3])),
        confidence=picture(1.0 / (1.0 + expected / (1e-3 * width)), outside=0.0),
        layers={name: picture(layer) for name, layer in layers.items()},
    )


def as_source_shape(capture: Capture, mask: NDArray[np.bool_], depth: NDArray[np.float64]) -> Shape:
    """Put depths alone into pictures: normals by central differences, confidence 1 wherever there is a depth."""
    picture = _Pictures(mask)
    origins, directions = capture.camera.rays()
    points = origins + picture(depth)[..., None].astype(np.float64) * directions
    normal = np.cross(np.gradient(points, axis=1), -np.gradient(points, axis=0))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return Shape(
        camera=capture.camera,
        depth=picture(depth),
        normal=capture.camera.normals_to_camera(normal).astype(np.float32),
        confidence=np.isfinite(picture(depth)).astype(np.float32),
    )


class _Pictures:
    """Spread values of masked pixels over the picture."""

    def __init__(self, mask: NDArray[np.bool_], kind: type[Any] = np.float32) -> None:
        self.mask = mask
        self.kind = kind

    def __call__(self, values: NDArray[np.float64], outside: float = np.nan) -> NDArray[Any]:
        picture = np.full(self.mask.shape + values.shape[1:], outside, self.kind)
        picture[self.mask] = values
        return picture
