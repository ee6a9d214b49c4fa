"""The nearest lights of a pixel against a sort of all of them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.relight.interpolant import NEAR, NEAREST, find_nearest
from pipeline.core.relight.occlusion import AWAY, LIT, SHADOWED

LIGHTS = 300


def found(
    points: NDArray[np.float64], place: NDArray[np.float64], lights: NDArray[np.float64], kinds: NDArray[np.uint8]
) -> list[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Return lights and squared distances of one pixel after the other, as a block of pixels is gone through."""
    axes = np.ascontiguousarray(lights.T).astype(np.float32)
    cosines, near = np.empty(len(lights), np.float32), np.full(1, NEAR)
    answers = []
    for point, kind in zip(points, kinds, strict=True):
        nearest, distances = np.empty(NEAREST + 1, np.int64), np.empty(NEAREST + 1)
        u = (place - point) / np.linalg.norm(place - point)
        find_nearest(point, u, lights, axes, kind, True, cosines, near, nearest, distances)
        answers.append((nearest, distances))
    return answers


@pytest.mark.parametrize("usable", [0.9, 0.1, 0.02])
def test_the_nearest_lights_are_those_of_a_sort(usable: float) -> None:
    random = np.random.default_rng(11)
    lights = random.normal(size=(LIGHTS, 3))
    lights *= (random.choice([2.0, 3.0], LIGHTS) / np.linalg.norm(lights, axis=1))[:, None]
    points, place = random.uniform(-0.5, 0.5, (40, 3)), np.array([1.5, -1.0, 2.0])
    kinds = np.where(random.uniform(size=(40, LIGHTS)) < usable, random.choice([SHADOWED, LIT], (40, LIGHTS)), AWAY)
    for point, kind, (nearest, distances) in zip(
        points, kinds, found(points, place, lights, kinds.astype(np.uint8)), strict=True
    ):
        directions = lights - point
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        u = (place - point) / np.linalg.norm(place - point)
        squares = np.where(kind == AWAY, np.inf, ((directions - u) ** 2).sum(axis=1))
        right = [light for light in np.argsort(squares)[: NEAREST + 1] if kind[light] != AWAY]
        assert nearest[nearest >= 0].tolist() == right
        assert distances[: len(right)] == pytest.approx(squares[right], abs=1e-12)


def test_lights_in_one_place_are_an_end_too() -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.5, 0.2, 0.0]])
    lights = np.repeat([[0.0, 0.0, 3.0]], LIGHTS, axis=0)
    for nearest, distances in found(points, lights[0], lights, np.full((3, LIGHTS), LIT, np.uint8)):
        assert len(set(nearest.tolist())) == NEAREST + 1
        assert (nearest >= 0).all()
        assert distances.max() < 1e-12
