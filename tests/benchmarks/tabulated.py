"""Captures of a sphere of one tabulated isotropic material, drawn in memory under distant lights."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from pipeline.core.camera import Camera
from pipeline.core.capture import Truth
from pipeline.core.lights import Lights
from pipeline.core.rig import distant
from tests import oracles, synthetic
from tests.drawn import Drawn

TABLES = "merl_fits/bivariate_80.npz"
Brdf = Callable[[NDArray[Any], NDArray[Any], NDArray[Any]], NDArray[np.float64]]


@dataclass(frozen=True)
class DrawnWithTruth(Drawn):
    """A capture in memory of which the truth is known."""

    known: Truth | None = None

    def truth(self) -> Truth | None:
        """Return what was drawn."""
        return self.known


def materials(data: Path) -> list[str]:
    """Return the names of the measured-like materials in a folder of third-party data."""
    with np.load(data / TABLES) as tables:
        return [name for name in tables if tables[name].ndim == 3]


def measured(data: Path, name: str) -> Brdf:
    """Return f(n, wi, wo) (..., 3) [1/sr] of a table, bilinear in sqrt(theta_h) and theta_d between its bins' centres.

    The bins are even in these coordinates. Outside the outermost centres the table goes on as it ends; bins below the
    horizon, which no pair of directions reaches, take their neighbour's value so that those beside them can be
    interpolated.
    """
    with np.load(data / TABLES) as tables:
        table, theta_h, theta_d = (tables[key].astype(np.float64) for key in (name, "theta_h", "theta_d"))
    for i in range(1, len(table)):
        table[i] = np.where(np.isnan(table[i]), table[i - 1], table[i])
    for j in range(1, table.shape[1]):
        table[:, j] = np.where(np.isnan(table[:, j]), table[:, j - 1], table[:, j])
    axes = (np.sqrt(theta_h), theta_d)
    look_up = RegularGridInterpolator(axes, table)

    def f(normal: NDArray[Any], to_light: NDArray[Any], to_viewer: NDArray[Any]) -> NDArray[np.float64]:
        place = half_angles(normal, to_light, to_viewer)
        place[..., 0] = np.sqrt(place[..., 0])
        for i, axis in enumerate(axes):
            place[..., i] = np.clip(place[..., i], axis[0], axis[-1])
        return np.asarray(look_up(place))

    return f


def half_angles(normal: NDArray[Any], to_light: NDArray[Any], to_viewer: NDArray[Any]) -> NDArray[np.float64]:
    """Return half angle and difference angle (..., 2) of directions [rad]."""
    half = oracles.unit(to_light + to_viewer)
    cosine = np.stack(np.broadcast_arrays(oracles.dot(normal, half), oracles.dot(half, to_light)), axis=-1)
    return np.arccos(np.clip(cosine, 0, 1))


def sphere(brdf: Brdf, lights: Lights | int = 100, side: int = 64) -> DrawnWithTruth:
    """Draw a sphere, seen orthographically along -z, under distant lights: L = E f cos(theta_i), no shadow but its own.

    Parameters
    ----------
    brdf : f(n, wi, wo) -> (..., 3) [1/sr]
    lights : Lights or int
        So many over the hemisphere about the view where it is a number.
    side : int
        Width and height of the pictures [px]; the sphere's diameter is .8 of it.
    """
    camera = synthetic.camera(side, "orthographic")
    lamps = distant(lights, np.array([0.0, 0.0, 1.0])) if isinstance(lights, int) else lights
    ball = synthetic.ball(camera)
    seen = np.isfinite(ball.depth)
    normal = exact_normals(camera)[seen]
    pictures = np.zeros((len(lamps), *seen.shape, 3), np.float32)
    for picture, direction, irradiance in zip(pictures, lamps.position, lamps.intensity, strict=True):
        cosine = normal @ direction
        lit = cosine > 0
        reflected = np.zeros_like(normal)
        reflected[lit] = brdf(normal[lit], direction, np.array([0.0, 0.0, 1.0])) * cosine[lit, None]
        picture[seen] = irradiance * reflected
    names = tuple(f"light_{i:04d}.exr" for i in range(len(lamps)))
    known = Truth(
        ball.depth, ball.normal, ball.points().astype(np.float32), seen.astype(np.int32), 2 * synthetic.RADIUS
    )
    notes = {"diameter": 2 * synthetic.RADIUS, "transport": {"bounces": 0}}
    return DrawnWithTruth(Path("drawn"), camera, lamps, names, ("",) * len(names), notes, pictures, seen, known)


def exact_normals(camera: Camera) -> NDArray[np.float64]:
    """Return the sphere's normals in float64, (H, W, 3); not unit off the sphere."""
    place = camera.rays()[0][..., :2] / synthetic.RADIUS
    height = np.sqrt(np.maximum(1 - (place**2).sum(-1, keepdims=True), 0))
    return np.concatenate([place, height], axis=-1)
