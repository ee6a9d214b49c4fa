"""What P pixels saw of L lights, as reflectance: the input of every photometric solver.

A pixel's value is its apparent BRDF y = f cos(theta_i) [1/sr]: radiance over irradiance of a distant light, radiance
times squared distance over radiant intensity of a near one. Everything is in camera space.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...capture import Capture
from ...compiled import kernel
from ...errors import LightsphereError
from ...progress import Progress, Work
from ...reflectance.angles import difference_coordinate

BAD_SHARE = 0.5  # a picture with more unusable pixels than this is damaged, not noisy
DARK = 0.02  # of the pixel's 90th percentile, which no highlight reaches: below it a light counts as shadowed
TINY = 1e-12
SOFT_BELOW = 0.9  # values above this share of the saturation are trusted less and less


@dataclass(frozen=True)
class Sight:
    """The values of P pixels under L lights, and where both are.

    Parameters
    ----------
    values : (P, L, 3) float32
        Apparent BRDF [1/sr]; 0 where unusable.
    usable : (P, L) float32
        0 where a value is saturated or not a number, 1 where it can be trusted.
    lights : (L, 3) float64
        Near: position [m]. Distant: unit direction to the light.
    near : bool
        Which of the two.
    points : (P, 3) float64
        Surface points [m]; any where the lights are distant.
    views : (P, 3) float64
        Unit directions to the camera.
    """

    values: NDArray[np.float32]
    usable: NDArray[np.float32]
    lights: NDArray[np.float64]
    near: bool
    points: NDArray[np.float64]
    views: NDArray[np.float64]

    def select(self, pixels: NDArray[Any]) -> Sight:
        """Return what some of the pixels saw."""
        rows = (self.values[pixels], self.usable[pixels], self.points[pixels], self.views[pixels])
        values, usable, points, views = (np.ascontiguousarray(row) for row in rows)
        return Sight(values, usable, self.lights, self.near, points, views)

    def lit(self) -> NDArray[np.bool_]:
        """Return which lights reach which pixels (P, L)."""
        gray = np.where(self.usable > 0, self.values.mean(axis=2), 0.0)
        return np.asarray(gray > DARK * np.quantile(gray, 0.9, axis=1, keepdims=True))

    def light_equations(self) -> NDArray[np.float64]:
        """Return the normal equations (P, 3, 3) of a matt surface: sums of l l^T of the lights l that are seen."""
        found, lit = np.zeros((len(self.values), 3, 3)), self.lit()
        for light, place in enumerate(self.lights):
            towards = place - self.points if self.near else np.broadcast_to(place, self.points.shape)
            towards = towards / np.linalg.norm(towards, axis=1, keepdims=True)
            found += lit[:, light, None, None] * towards[:, :, None] * towards[:, None, :]
        return found

    def scale(self) -> NDArray[np.float64]:
        """Return a usual value of every pixel (P,) [1/sr]: the 80th percentile of the lit ones, tiny where none is."""
        lit = np.where(self.lit(), self.values.mean(axis=2), np.nan)
        lit[np.isnan(lit).all(axis=1)] = TINY
        return np.asarray(np.nanquantile(lit, 0.8, axis=1), np.float64)


def see(capture: Capture, mask: NDArray[np.bool_], depth: NDArray[np.float32] | None = None) -> Work[Sight]:
    """Read every picture of a capture once and rearrange it by pixel.

    Parameters
    ----------
    capture : Capture
        Of near or distant lights.
    mask : (H, W) bool
        The P pixels to keep.
    depth : (H, W) float32, optional
        Distance along the rays [m]; near lights need it.

    Raises
    ------
    LightsphereError
        When the lights are unknown, a picture is missing or damaged, or near lights come without depth.
    """
    lights, camera = capture.lights, capture.camera
    if lights.kind == "unknown":
        raise LightsphereError(f"{capture.folder}: the lights are unknown; this method needs known lights")
    if lights.kind == "near" and depth is None:
        raise LightsphereError(f"{capture.folder}: the lights are near; recover or give a depth first")
    origins, directions = camera.rays()
    rotation, centre = camera.to_world[:3, :3], camera.to_world[:3, 3]
    views = -directions[mask] @ rotation
    points = np.zeros_like(views)
    places = lights.position @ rotation
    if lights.kind == "near" and depth is not None:
        points = (origins[mask] + depth[mask][:, None] * directions[mask] - centre) @ rotation
        places = (lights.position - centre) @ rotation
    values = np.empty((len(views), len(capture), 3), np.float32)
    usable = np.empty(values.shape[:2], np.float32)
    limit = float(capture.notes.get("saturation", np.inf))
    for light in range(len(capture)):
        seen = capture.image(light)[mask]
        good = np.isfinite(seen).all(axis=1)
        if len(good) and not good.mean() >= BAD_SHARE:
            raise LightsphereError(
                f"{capture.folder / capture.files[light]}: {100 * (1 - good.mean()):.0f} % of the object's pixels are "
                "not numbers; replace the picture"
            )
        brightest = np.where(good, seen.max(axis=1), np.inf)
        usable[:, light] = np.clip((limit - brightest) / ((1 - SOFT_BELOW) * limit), 0, 1) if limit < np.inf else good
        intensity = np.where(lights.intensity[light] > 0, lights.intensity[light], np.inf)
        squared = ((places[light] - points) ** 2).sum(axis=1, keepdims=True) if lights.kind == "near" else 1.0
        values[:, light] = np.where(good[:, None], seen, 0.0) * squared / intensity
        yield Progress("read", light + 1, len(capture), "pictures")
    return Sight(np.maximum(values, 0.0), usable, places, lights.kind == "near", points, views)


@kernel
def directions(
    point: NDArray[np.float64],
    view: NDArray[np.float64],
    lights: NDArray[np.float64],
    near: bool,
    to_light: NDArray[np.float64],
    half: NDArray[np.float64],
    difference: NDArray[np.float64],
) -> None:
    """Fill in, for one pixel, wi and h (L, 3) and the coordinate of theta_d (L,) of every light."""
    for k in range(lights.shape[0]):
        for i in range(3):
            to_light[k, i] = lights[k, i] - point[i] if near else lights[k, i]
        length = math.sqrt(to_light[k, 0] ** 2 + to_light[k, 1] ** 2 + to_light[k, 2] ** 2)
        towards = 0.0
        for i in range(3):
            to_light[k, i] /= length
            half[k, i] = to_light[k, i] + view[i]
            towards += to_light[k, i] * view[i]
        length = max(math.sqrt(half[k, 0] ** 2 + half[k, 1] ** 2 + half[k, 2] ** 2), 1e-12)
        for i in range(3):
            half[k, i] /= length
        difference[k] = difference_coordinate(towards)
