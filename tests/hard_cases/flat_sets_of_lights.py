"""Distant lights in one plane, nearly in one plane, and in a narrow cone.

Why: the normal's equations have no, or hardly a, third direction; noise in it grows as 1 over its share.
Must: one plane is refused with what to do. Nearly one plane: normals from exact pictures still hold; with noise, they
are worse and say so: the error is about the deviation that is stated.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.shape import Shape
from pipeline.core.shape.photometric.recover import recover
from pipeline.core.shape.settings import ShapeSettings
from tests import drawn, oracles, synthetic
from tests.hard_cases.catalogue import Outcome

COUNT = 24
NOISE = 0.002  # of the brightest value
MOST = {4.0: 0.3, 30.0: 0.05}  # degrees: noise over the slope of the cosine and the root of the number of lights


def fan(out_of_plane: float) -> NDArray[np.float64]:
    """Directions in a fan from left to right before the object, every other one above it by so much, else below."""
    across = np.linspace(-0.9, 0.9, COUNT)
    up = np.where(np.arange(COUNT) % 2, out_of_plane, -out_of_plane)
    return oracles.unit(np.stack([across, up, np.ones(COUNT)], axis=-1))


def cone(half_angle: float) -> NDArray[np.float64]:
    turn = 2 * np.pi * np.arange(COUNT) / COUNT
    tilt = np.tan(np.radians(half_angle))
    return oracles.unit(np.stack([tilt * np.cos(turn), tilt * np.sin(turn), np.ones(COUNT)], axis=-1))


def captured(directions: NDArray[np.float64], noise: float) -> tuple[drawn.Drawn, Shape]:
    ball = synthetic.ball(synthetic.camera(20, "orthographic"))
    lights = Lights("distant", directions, np.full((COUNT, 3), np.pi), np.full(COUNT, 2))
    capture = drawn.draw(ball, lights, drawn.lambert)
    random = np.random.default_rng(0).standard_normal(capture.pictures.shape)
    noisy = capture.pictures + noise * capture.pictures.max() * random.astype(np.float32)
    return dataclasses.replace(capture, pictures=np.maximum(noisy, 0)), ball


def angles(directions: NDArray[np.float64], noise: float, method: str) -> tuple[float, float]:
    """Return the median error and the median stated deviation of the normals [degrees]."""
    capture, ball = captured(directions, noise)
    shape = finish(recover(capture, ShapeSettings(method=method, bases=1))).shape
    a, b = shape.normal.astype(np.float64), ball.normal.astype(np.float64)
    error = np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1)))
    stated = shape.layers.get("normal_deviation", np.full(error.shape, np.nan))
    return float(np.nanmedian(error)), float(np.nanmedian(stated)) if np.isfinite(stated).any() else np.nan


def run() -> list[Outcome]:
    found = []
    try:
        angles(fan(0.0), 0.0, "lambertian")
        found.append(Outcome("24 lights in one plane", np.inf, 0, "", "took them"))
    except LightsphereError as error:
        found.append(Outcome("24 lights in one plane", 0, 0, "", f"refused them: {str(error).partition(': ')[2]}"))
    for name, directions in (("0.001 out of one plane", fan(1e-3)), ("in a cone of 2 degrees", cone(2.0))):
        error, _ = angles(directions, 0.0, "lambertian")
        found.append(Outcome(f"24 lights {name}, exact pictures", error, 0.1, "normals, degrees", "solved it"))
    for half_angle in (4.0, 30.0):
        for method in ("lambertian", "acls"):
            error, stated = angles(cone(half_angle), NOISE, method)
            told = f"stated a deviation of {stated:.2g}" if np.isfinite(stated) else "solved it"
            condition = f"in a cone of {half_angle:g} degrees, noise .2 %, {method}"
            found.append(Outcome(condition, error, MOST[half_angle], "normals, degrees", told))
        found.append(Outcome(condition, error / stated, 1.2, "error over stated", "knows how far off it is"))
    return found
