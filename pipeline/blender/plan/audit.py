"""Find out whether a finished capture lacks more light than was asked for: everything on, at random places."""

from __future__ import annotations

import dataclasses
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.capture import Capture
from ...core.progress import Progress, Work
from .. import cycles, truth
from ..olat import pictures
from .contents import ruled_out
from .decide import MOST_BOUNCES
from .effects import DEPTH_OF_FIELD, MOTION_BLUR, SWITCHES

LIGHTS = 6  # a third of a picture's cost, all together, where pictures have 64 samples
SIDE = 1 / 6  # of the picture, the side of the window that is rendered
SAMPLES = 128
SEEDS = (15485863, 32452843)  # neither a capture's nor the probe's
CERTAIN = 2.0  # standard deviations of noise by which an error must be larger than what was asked for


@dataclasses.dataclass(frozen=True)
class Audit:
    """How far a capture's pictures are from pictures with every effect that its scene can show.

    Parameters
    ----------
    held : bool
        Whether no group is further off than what was asked for, and noise besides.
    group : str
        The material whose surfaces are furthest off.
    error_pct, uncertainty_pct : float
        By how much its light is, and the standard deviation of that [%].
    asked_pct : float
    lights : list of int
        That were tried, drawn at random.
    pixels : int
        Of the object, counted once for each light.
    """

    held: bool
    group: str
    error_pct: float
    uncertainty_pct: float
    asked_pct: float
    lights: list[int]
    pixels: int


def audit(scene: bpy.types.Scene, capture: Capture) -> Work[Audit]:
    """Render random windows under random lights with everything on, and compare a finished capture with them.

    A window is drawn around a pixel that its light reaches, so that there is something to compare.
    """
    settings = capture.notes["settings"]
    rng = np.random.default_rng(settings["seed"])
    absent = ruled_out(scene) | dict.fromkeys((DEPTH_OF_FIELD, MOTION_BLUR), "")
    switches = {switch: name not in absent for name, switch in SWITCHES.items()}
    everything = cycles.Transport(MOST_BOUNCES, **switches, samples=SAMPLES)
    known = capture.truth()
    assert known is not None  # it was rendered with the capture
    groups, names = truth.groups(scene, known.material, capture.mask())
    parts = {}
    for light in map(int, rng.permutation(len(capture))):
        captured = capture.image(light).astype(np.float64)
        lit = (groups > 0) & (captured > 0).any(axis=-1)
        if not lit.any():
            continue
        window = window_around(lit, rng, SIDE)
        work = (pictures(scene, capture.camera, everything, capture.lights, [light], s, window=window) for s in SEEDS)
        parts[light] = (groups[window], captured[window], *map(next, work))
        yield Progress("audit", len(parts), LIGHTS, "lights")
        if len(parts) == LIGHTS:
            break
    noisy = capture.notes["transport"]["samples"] if capture.notes["transport"]["bounces"] else np.inf
    errors = _errors(list(parts.values()), SAMPLES / noisy)
    asked = settings["error"] / 100
    held = all(error <= asked + CERTAIN * deviation for error, deviation in errors.values())
    if not errors:
        return Audit(True, "", 0.0, 0.0, settings["error"], [], 0)
    worst = max(errors, key=lambda number: errors[number][0])
    error, deviation = (round(100 * value, 4) for value in errors[worst])
    pixels = sum(int((part[0] > 0).sum()) for part in parts.values())
    return Audit(held, names[worst], error, deviation, settings["error"], list(parts), pixels)


def window_around(shown: NDArray[np.bool_], rng: np.random.Generator, side: float) -> tuple[slice, slice]:
    """Return the rows and columns around a random pixel of those shown (H, W), a share of the picture's side each."""
    places = np.argwhere(shown)
    place = places[rng.integers(len(places))]
    size = [max(2, round(side * n)) for n in shown.shape]
    starts = [int(np.clip(p - s // 2, 0, n - s)) for p, s, n in zip(place, size, shown.shape, strict=True)]
    rows, columns = (slice(start, start + s) for start, s in zip(starts, size, strict=True))
    return rows, columns


def _errors(parts: list[tuple[NDArray[Any], ...]], noise: float) -> dict[int, tuple[float, float]]:
    """Return how far each group's light is off, relative, and the standard deviation of that.

    Parameters
    ----------
    parts : list of (groups (H, W), captured (H, W, 3), rendered twice, 2 of (H, W, 3))
    noise : float
        The captured pictures' variance over that of one of the rendered ones.
    """
    found = {}
    for number in sorted({int(one) for groups, *_ in parts for one in np.unique(groups) if one}):
        captured, first, second = (np.array([part[i][part[0] == number].sum() for part in parts]) for i in (1, 2, 3))
        whole = float((first + second).sum()) / 2
        if whole > 0:
            variance = float(((first - second) ** 2).sum()) * (1 / 4 + noise / 2)
            found[number] = (abs(float(captured.sum()) - whole) / whole, variance**0.5 / whole)
    return found
