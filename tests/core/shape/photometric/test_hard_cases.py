"""Shadows, saturation, colour in the weights, one material only: planted normals come back from drawn pictures."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from pipeline.core.progress import finish
from pipeline.core.rig import hemisphere
from pipeline.core.shape.photometric import lambertian
from pipeline.core.shape.photometric.acls import Options, decompose
from pipeline.core.shape.photometric.sight import Sight
from tests.tolerances import PLANTED_MAPS, PLANTED_NORMAL

LIGHTS = 80
VIEW = np.array([0.0, 0.0, 1.0])


def normals() -> NDArray[np.float64]:
    """Normals of a ball's pixels, up to 70 degrees from the view."""
    x, y = np.meshgrid(np.linspace(-0.93, 0.93, 30), np.linspace(-0.93, 0.93, 30))
    inside = x**2 + y**2 < 0.88
    x, y = x[inside], y[inside]
    return np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1)


def materials(cosine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Two materials (..., 2, 3) by the cosine of theta_h: matt red, and gray with a highlight."""
    gloss = 0.8 * np.exp(-(np.tan(np.arccos(np.minimum(cosine, 1))) ** 2) / 0.15**2)
    red = np.broadcast_to([0.2, 0.05, 0.03], (*cosine.shape, 3))
    gray = 0.08 + gloss[..., None] * np.ones(3)
    return np.stack([red, gray], axis=-2)


def draw(n: NDArray[np.float64], weights: NDArray[np.float64], lights: NDArray[np.float64]) -> NDArray[np.float32]:
    half = lights + VIEW
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    f = np.einsum("plkc,pk->plc", materials(np.clip(n @ half.T, 0, 1)), weights)
    return (f * np.maximum(n @ lights.T, 0)[..., None]).astype(np.float32)


def planted() -> tuple[Sight, NDArray[np.float64], NDArray[np.float64]]:
    """What a ball's pixels see, its normals, and its weights: shares of both materials in patches, some mixed."""
    n = normals()
    share = np.clip(0.5 + 2.0 * np.sin(5 * n[:, 0]) * np.cos(4 * n[:, 1]), 0, 1)
    weights = np.stack([share, 1 - share], axis=-1)
    directions = hemisphere(LIGHTS)
    values = draw(n, weights, directions)
    views = np.broadcast_to(VIEW, n.shape).copy()
    sight = Sight(values, np.ones(values.shape[:2], np.float32), directions, False, np.zeros_like(views), views)
    return sight, n, weights


def angle(found: NDArray[np.float64], true: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(found, true), axis=1), (found * true).sum(axis=1)))


def test_highlights_do_not_mislead() -> None:
    """Far better than plain Lambertian least squares, and the weight maps follow the true ones."""
    sight, n, weights = planted()
    found = finish(decompose(sight, Options(bases=2)))
    b = lambertian.plain(sight)
    plain = angle(b / np.linalg.norm(b, axis=1, keepdims=True), n)
    assert plain.mean() > 5 * angle(found.normals, n).mean()
    likeness = np.corrcoef(np.concatenate([weights, found.weights[..., 0]], axis=1).T)[:2, 2:]
    assert likeness.max(axis=1).min() > PLANTED_MAPS


def test_cast_shadows_are_left_out() -> None:
    """A third of the lights taken from half of the pixels leaves their normals where they are."""
    sight, n, _ = planted()
    values = sight.values.copy()
    values[::2, : LIGHTS // 3] = 0.0
    shadowed = finish(decompose(dataclasses.replace(sight, values=values), Options(bases=2)))
    assert np.median(angle(shadowed.normals, n)[::2]) < PLANTED_NORMAL


def test_saturated_values_are_left_out() -> None:
    sight, n, _ = planted()
    bright = sight.values.max(axis=2) > 0.2
    values = np.where(bright[..., None], np.float32(0.2), sight.values)
    usable = np.where(bright, np.float32(0), np.float32(1))
    clipped = finish(decompose(dataclasses.replace(sight, values=values, usable=usable), Options(bases=2)))
    assert angle(clipped.normals, n).mean() < 2 * PLANTED_NORMAL


def test_colour_in_the_weights() -> None:
    """One set of tables without colour, three weights a basis."""
    sight, n, _ = planted()
    gray = finish(decompose(sight, Options(bases=2, colour="weights")))
    assert gray.table.shape[3] == 1
    assert gray.weights.shape[2] == 3
    assert angle(gray.normals, n).mean() < PLANTED_NORMAL


def test_one_material_takes_one_basis() -> None:
    sight, n, _ = planted()
    values = draw(n, np.broadcast_to([0.3, 0.7], (len(n), 2)), sight.lights)
    single = finish(decompose(dataclasses.replace(sight, values=values), Options(bases=3)))
    assert single.table.shape[2] == 1
