"""Pictures rearranged by pixel: noise floor, saturation, values that cannot be used."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from pipeline.core.shape.observations import Observations, noise_floor, noise_of, observe
from tests import drawn, synthetic, tolerances

BALL = synthetic.ball(synthetic.camera(14))
CAPTURE = drawn.draw(BALL, drawn.two_spheres(), drawn.ggx)
LEVEL = 2e-3  # of the noise, of the 90th percentile


def clean() -> NDArray[np.float32]:
    """Value over intensity of single colours, half of them dark."""
    assert CAPTURE.pictures is not None
    return np.asarray(CAPTURE.pictures[:, CAPTURE.mask()].ravel() / 12, np.float32)


def deviation() -> float:
    return LEVEL * float(np.quantile(clean(), 0.9))


def seen(capture: drawn.Drawn, memory: float = 1024.0) -> Observations:
    return finish(observe(capture, capture.mask(), memory))


def repainted(pictures: NDArray[np.float32]) -> drawn.Drawn:
    return dataclasses.replace(CAPTURE, pictures=pictures)


def pictures() -> NDArray[np.float32]:
    assert CAPTURE.pictures is not None
    return CAPTURE.pictures.copy()


@pytest.mark.parametrize("factor", [1.0, 3.0])
@pytest.mark.parametrize("cut", [False, True])
def test_the_floor_of_planted_noise_is_found(cut: bool, factor: float) -> None:
    planted = factor * deviation()
    relative, absolute = np.random.default_rng(0).standard_normal((2, *clean().shape))
    noisy = clean() * (1 + 0.01 * relative) + planted * absolute
    values = np.maximum(noisy, 0) if cut else noisy
    assert noise_floor(values.astype(np.float32)) == pytest.approx(planted, rel=tolerances.NOISE_FLOOR)


@pytest.mark.parametrize("levels", [60, 255])
def test_the_floor_of_planted_quantisation_is_found(levels: int) -> None:
    capture = drawn.draw(BALL, drawn.two_spheres(320, 80), drawn.ggx)
    assert capture.pictures is not None
    values = capture.pictures[:, capture.mask()].ravel() / 12
    step = float(values.max()) / levels
    found = noise_floor((np.round(values / step) * step).astype(np.float32))
    assert found == pytest.approx(step / np.sqrt(12), rel=tolerances.NOISE_FLOOR)


def test_pictures_without_a_floor_have_none() -> None:
    assert noise_floor(clean()) == 0
    relative = 1 + 0.01 * np.random.default_rng(1).standard_normal(clean().shape)
    assert noise_floor((clean() * relative).astype(np.float32)) == 0
    assert noise_floor(np.empty(0, np.float32)) == 0
    assert noise_floor(np.zeros(100, np.float32)) == 0


def test_half_floats_have_no_floor_that_hides_dark_values() -> None:
    assert noise_floor(clean().astype(np.float16).astype(np.float32)) < 0.1 * deviation()


def test_values_are_roots_of_value_over_intensity() -> None:
    found = seen(CAPTURE)
    expected = np.cbrt(pictures()[:, CAPTURE.mask(), 0].T / 12.0)
    np.testing.assert_allclose(found.values, expected, rtol=1e-6)
    assert found.floor == 0 and not found.bounced and not found.clipped.any() and not found.bad.any()


def test_coarse_steps_keep_the_brightest_colour_and_say_what_was_rounded_away() -> None:
    tint = np.array([0.5, 1.0, 0.8], np.float32)
    lit = pictures()[pictures() > 0]
    step = float(np.median(lit))
    coarse = (np.round(pictures() * tint / step) * step).astype(np.float32)
    coarse[7, 7, 7] = np.nan
    found = seen(repainted(coarse))
    brightest = coarse[:, CAPTURE.mask(), 1].T / 12
    own = np.flatnonzero(np.flatnonzero(CAPTURE.mask().ravel()) == 7 * 14 + 7)[0]
    assert found.values[own, 7] == 0
    brightest[own, 7] = 0
    np.testing.assert_allclose(found.values[brightest > 0], np.cbrt(brightest[brightest > 0]), rtol=1e-6)
    assert found.floor == pytest.approx(step / 12 / np.sqrt(12), rel=1e-4)
    rest = np.delete(found.values[brightest == 0], np.flatnonzero(found.values[brightest == 0] == 0))
    assert len(rest) == (brightest == 0).sum() - 1
    np.testing.assert_allclose(rest, -np.cbrt(step / 24), rtol=1e-4)


def test_fine_steps_hide_nothing() -> None:
    step = float(np.quantile(pictures(), 0.999)) / 255
    found = seen(repainted((np.round(pictures() / step) * step).astype(np.float32)))
    assert (found.values >= 0).all()


def test_large_captures_live_in_a_file_with_the_same_values() -> None:
    found = seen(CAPTURE, memory=0.0)
    assert isinstance(found.values, np.memmap)
    np.testing.assert_array_equal(found.values, seen(CAPTURE).values)


def test_colours_are_divided_each_by_its_own_intensity() -> None:
    power = np.random.default_rng(2).uniform(0.2, 5, (len(CAPTURE), 3))
    power[::3, 1] = 0.0  # a light without green
    lights = dataclasses.replace(CAPTURE.lights, intensity=12 * power)
    changed = (pictures() * power[:, None, None]).astype(np.float32)
    found = seen(dataclasses.replace(CAPTURE, lights=lights, pictures=changed))
    np.testing.assert_allclose(found.values, seen(CAPTURE).values, rtol=1e-6)


def test_values_that_are_no_numbers_are_left_out_and_counted() -> None:
    spoilt = pictures()
    spoilt[3, 7, 7, 1], spoilt[4, 7, 7] = np.nan, np.inf
    spoilt[5, 7, 7] = -1e-9
    found = seen(repainted(spoilt))
    own = np.flatnonzero(np.flatnonzero(CAPTURE.mask().ravel()) == 7 * 14 + 7)[0]
    assert found.bad[own] == 2 and found.bad.sum() == 2
    assert (found.values[own, [3, 4, 5]] == 0).all()
    untouched = np.delete(np.arange(len(found.values)), own)
    np.testing.assert_array_equal(found.values[untouched], seen(CAPTURE).values[untouched])


def test_a_picture_without_numbers_is_named() -> None:
    spoilt = pictures()
    spoilt[42] = np.nan
    with pytest.raises(LightsphereError, match=r"light_0042\.exr: 100 % .* not numbers; render"):
        seen(repainted(spoilt))


def test_saturation_is_seen_where_values_share_the_largest() -> None:
    limit = np.float32(np.quantile(pictures(), 0.99))
    found = seen(repainted(np.minimum(pictures(), limit)))
    hit = (pictures()[:, CAPTURE.mask()] >= limit).any(-1).T
    np.testing.assert_array_equal(found.clipped, hit.sum(axis=1))
    assert (found.values[hit] == 0).all() and (found.values[~hit] == seen(CAPTURE).values[~hit]).all()


def test_a_stated_saturation_counts_for_single_values() -> None:
    limit = float(pictures().max())
    found = seen(dataclasses.replace(CAPTURE, notes={**CAPTURE.notes, "saturation": limit}))
    assert found.clipped.sum() == 1 and seen(CAPTURE).clipped.sum() == 0


def test_bounced_light_is_known_from_the_notes_or_the_lack_of_shadow() -> None:
    assert seen(dataclasses.replace(CAPTURE, notes={"transport": {"bounces": 3}})).bounced
    assert not seen(dataclasses.replace(CAPTURE, notes={})).bounced
    assert seen(dataclasses.replace(CAPTURE, notes={}, pictures=pictures() + np.float32(0.01))).bounced


def test_bounced_light_counts_as_noise_of_bright_pixels() -> None:
    direct, bounced = seen(CAPTURE), seen(dataclasses.replace(CAPTURE, notes={"transport": {"bounces": 3}}))
    assert (noise_of(direct) == direct.floor).all()
    bright = np.quantile(bounced.values.astype(np.float64) ** 3, 0.9, axis=1)
    np.testing.assert_allclose(noise_of(bounced), 0.02 * bright, rtol=0.05)
