"""The sensor: noise of the stated size, values within white, steps of the stated number."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core import images
from pipeline.core.dataset.draw import draw
from pipeline.core.dataset.recipe import Recipe, SensorRecipe
from pipeline.core.dataset.sensor import Sensor, is_ideal, noise_of, sensor_of

WHITE = 2.5


def exposed(level: float, seed: int = 1, **values: float | int | str) -> np.ndarray:
    sensor = Sensor(**({"white": WHITE, "full_well": 0.0, "read_noise": 0.0, "bits": 0, "response": "linear"} | values))
    return sensor.expose(np.full((200, 200, 3), level * WHITE, np.float32), np.random.default_rng(seed))


def test_without_noise_and_bits_light_over_white_comes_back() -> None:
    assert np.allclose(exposed(0.3), 0.3, rtol=1e-6)
    assert (exposed(1.7) == 1).all()


@pytest.mark.parametrize(("full_well", "read_noise"), [(1000.0, 0.0), (500.0, 8.0)])
def test_noise_has_the_variance_of_electrons(full_well: float, read_noise: float) -> None:
    level = 0.4
    found = exposed(level, full_well=full_well, read_noise=read_noise).astype(np.float64)
    variance = level / full_well + (read_noise / full_well) ** 2
    deviations = found.size**-0.5
    assert abs(found.mean() - level) < 5 * variance**0.5 * deviations
    assert found.var() == pytest.approx(variance, rel=5 * 2**0.5 * deviations)
    assert found.var() != pytest.approx(1.05 * variance, rel=5 * 2**0.5 * deviations)


@pytest.mark.parametrize("response", ["linear", "srgb"])
def test_numbers_are_the_nearest_of_so_many_steps(response: str) -> None:
    light = np.linspace(0, 1, 3000, dtype=np.float32).reshape(1, 1000, 3) * np.float32(WHITE)
    sensor = Sensor(WHITE, 0.0, 0.0, 6, response)
    found = sensor.expose(light, np.random.default_rng(0))
    stored = np.unique(found)
    assert len(stored) == 64
    encode = images.srgb if response == "srgb" else np.asarray
    assert np.allclose(encode(stored) * 63, np.arange(64), atol=2e-3)
    assert np.abs(encode(found) - encode(light / WHITE)).max() <= 0.5 / 63 + 1e-5


def test_white_is_the_percentile_of_what_is_lit() -> None:
    recipe = Recipe.of({"sensor": {"bits": 8, "white": 90}})
    values = np.concatenate([np.zeros(500), np.arange(1, 101)]).astype(np.float32)
    found = sensor_of(recipe.sensor, draw(recipe, 0), [values[:300, None], values[300:, None]])
    assert found.white == pytest.approx(np.percentile(np.arange(1, 101), 90))


def test_black_pictures_have_a_white() -> None:
    recipe = Recipe.of({"sensor": {"bits": 8}})
    assert sensor_of(recipe.sensor, draw(recipe, 0), [np.zeros((5, 3), np.float32)]).white == 1


def test_noise_differs_between_pictures_samples_and_seeds_and_comes_back() -> None:
    recipe = Recipe()
    keys = [(seed, index, light) for seed in (0, 1) for index in (0, 1) for light in (0, 1)]
    drawn = {key: noise_of(key[0], draw(recipe, key[1]), key[2]).random() for key in keys}
    assert len(set(drawn.values())) == 8
    assert noise_of(1, draw(recipe, 1), 1).random() == drawn[1, 1, 1]


def test_a_sensor_that_is_not_asked_for_changes_nothing() -> None:
    assert is_ideal(SensorRecipe())
    assert not is_ideal(SensorRecipe(bits=12))
    assert not is_ideal(SensorRecipe(full_well=(0.0, 100.0)))
