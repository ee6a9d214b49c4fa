"""Drawing: a sample depends on recipe, seed and number alone; what is drawn keeps to the recipe and fills it."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from scipy import stats

from pipeline.core.dataset.draw import Sample, draw, lights_of, sample_name
from pipeline.core.dataset.recipe import Recipe
from pipeline.core.errors import LightsphereError

AXIS = np.array([0.0, 0.6, 0.8])
CENTRE = np.array([1.0, -2.0, 0.5])
UNLIKELY = 1e-6  # probability below which a draw is no accident


def many(count: int = 400, **values: Any) -> list[Sample]:
    recipe = Recipe.of(values)
    return [draw(recipe, index) for index in range(count)]


def test_a_sample_is_the_same_in_any_order_and_in_another_process() -> None:
    recipe = Recipe()
    forwards = [draw(recipe, index) for index in range(5)]
    assert [draw(recipe, index) for index in reversed(range(5))] == forwards[::-1]
    code = (
        "from pipeline.core.dataset.draw import draw; from pipeline.core.dataset.recipe import Recipe; "
        "print(draw(Recipe(), 3))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == str(forwards[3])


def test_a_range_changes_nothing_but_what_it_is_of() -> None:
    usual, other = Recipe(), Recipe.of({"material": {"patches": [0.5, 0.9]}, "camera": {"azimuth": [10, 20]}})
    for index in range(20):
        a, b = draw(usual, index), draw(other, index)
        assert (a.patches, a.azimuth) != (b.patches, b.azimuth)
        assert dataclasses.replace(b, patches=a.patches, azimuth=a.azimuth) == a


def test_seeds_and_numbers_make_different_samples() -> None:
    first = {draw(Recipe.of({"seed": seed}), index).render_seed for seed in range(20) for index in range(20)}
    assert len(first) == 400


def test_ranges_are_filled_evenly() -> None:
    samples = many(lights={"count": [3, 7]}, camera={"elevation": [-20, 30]}, material={"metal": 0.3})
    elevation = (np.array([sample.elevation for sample in samples]) + 20) / 50
    assert stats.kstest(elevation, "uniform").pvalue > UNLIKELY
    counts = np.bincount([sample.lights for sample in samples], minlength=9)
    assert counts[:3].sum() == counts[8:].sum() == 0
    assert stats.chisquare(counts[3:8]).pvalue > UNLIKELY
    parts = [part for sample in samples for part in sample.principled]
    metals = int(sum(part.metallic for part in parts))
    assert stats.binomtest(metals, len(parts), 0.3).pvalue > UNLIKELY
    assert stats.binomtest(metals, len(parts), 0.5).pvalue < UNLIKELY


def test_shares_of_the_splits_and_one_split_for_a_file() -> None:
    splits = [sample.split for sample in many(1000)]
    for name, share in (("train", 0.8), ("validation", 0.1), ("test", 0.1)):
        assert stats.binomtest(splits.count(name), 1000, share).pvalue > UNLIKELY
    of_scenes: dict[str, set[str]] = {}
    for sample in many(300, shape={"source": ["gourd", "steps", "thin", "teapot-metal"]}):
        of_scenes.setdefault(sample.shape, set()).add(sample.split)
    assert len(of_scenes) == 4
    assert all(len(found) == 1 for found in of_scenes.values())


def test_own_material_of_a_made_shape_is_refused() -> None:
    with pytest.raises(LightsphereError, match="own material, which a made shape has not"):
        draw(Recipe.of({"material": {"source": "own"}}), 0)


def test_names_sort_as_numbers_do() -> None:
    names = [sample_name(index) for index in (0, 9, 10, 999, 1_000_000)]
    assert names == sorted(names)


@pytest.mark.parametrize("spread", ["random", "even"])
def test_distant_lights_cover_their_cap_evenly(spread: str) -> None:
    recipe = Recipe.of({"lights": {"count": 2000, "spread": spread, "angle": [20, 60]}})
    lights = lights_of(recipe, draw(recipe, 0), CENTRE, 2.0, AXIS)
    lights.check()
    assert lights.kind == "distant"
    assert np.allclose(np.linalg.norm(lights.position, axis=1), 1)
    cosine = lights.position @ AXIS
    high, low = np.cos(np.radians((20, 60)))
    assert cosine.max() <= high + 1e-12 and cosine.min() >= low - 1e-12
    assert stats.kstest((cosine - low) / (high - low), "uniform").pvalue > UNLIKELY
    assert np.allclose(lights.intensity, np.pi)
    beside = lights.position - cosine[:, None] * AXIS
    assert np.linalg.norm(beside.mean(axis=0)) < 0.06  # no side of the cap is preferred


def test_near_lights_light_a_white_surface_alike() -> None:
    recipe = Recipe.of({"lights": {"count": 200, "layout": "near", "distance": [2, 5]}})
    lights = lights_of(recipe, draw(recipe, 1), CENTRE, 0.5, AXIS)
    distance = np.linalg.norm(lights.position - CENTRE, axis=1)
    assert distance.min() > 2 * 0.5 and distance.max() < 5 * 0.5
    assert np.allclose(lights.intensity / distance[:, None] ** 2, np.pi)


def test_two_spheres_are_nested() -> None:
    recipe = Recipe.of({"lights": {"count": 60, "layout": "double-sphere", "distance": [2, 3]}})
    lights = lights_of(recipe, draw(recipe, 1), CENTRE, 0.5, AXIS)
    distance = np.linalg.norm(lights.position - CENTRE, axis=1)
    assert np.allclose(distance[lights.on("inner")], 1.0)
    assert np.allclose(distance[lights.on("outer")], 1.5)
    assert len(lights) == 60 and len(lights.on("outer")) == 12
