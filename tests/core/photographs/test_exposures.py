"""Responses are taken off exactly, and exposures merge into the light that made them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.errors import LightsphereError
from pipeline.core.photographs.decode import decoded, saturation
from pipeline.core.photographs.exposures import merge
from pipeline.core.photographs.measured import measured
from pipeline.core.photographs.photographs import Picture, Shot
from pipeline.core.photographs.response import response_of
from tests import tolerances

TIMES = np.array([1 / 60, 1 / 15, 1 / 4, 1.0])


def encoded(light: np.ndarray) -> np.ndarray:
    """Encode light as sRGB: the standard's forward curve, which the program does not contain."""
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


@pytest.mark.parametrize(
    ("name", "stored", "light"),
    [("srgb", 0.5, 0.2140411), ("srgb", 0.04, 0.04 / 12.92), ("2.2", 0.5, 0.5**2.2), ("linear", 0.5, 0.5)],
)
def test_curves_pass_through_known_points(name: str, stored: float, light: float) -> None:
    curve = response_of(name, 8)
    assert float(curve.decode(np.array(stored))) == pytest.approx(light, rel=1e-6)
    assert curve.decode(np.array([0.0, 1.0])).tolist() == [0, 1]


def camera(value: np.ndarray) -> np.ndarray:
    """A camera's own curve: neither a power nor sRGB."""
    return np.clip(value, 0, 1) ** 0.45 * (1 + 0.25 * np.clip(value, 0, 1)) / 1.25


def shots(encode: Callable[[np.ndarray], np.ndarray], times: np.ndarray, bits: int = 8) -> tuple[Shot, ...]:
    light = np.random.default_rng(4).uniform(0, 1, (40, 50, 3)) ** 3
    noise = np.random.default_rng(5)

    def taken(time: float) -> Picture:
        stored = encode(light * time) + 0.004 * noise.standard_normal(light.shape)
        return Picture((np.round(np.clip(stored, 0, 1) * 255) / 255).astype(np.float32), bits, time)

    pictures = [taken(float(time)) for time in times]
    return tuple(Shot(f"{i}.png", partial(lambda one: one, picture)) for i, picture in enumerate(pictures))


@pytest.mark.parametrize("encode", [encoded, camera, lambda value: np.clip(value, 0, 1)])
def test_exposures_tell_the_cameras_curve(encode: Callable[[np.ndarray], np.ndarray]) -> None:
    curve = measured([shots(encode, TIMES * 3)])
    light = np.linspace(0.02, 0.9, 40)
    np.testing.assert_allclose(curve.decode(encode(light)), light, rtol=tolerances.MEASURED_RESPONSE)
    assert curve.decode(np.array([0.0, 1.0])) == pytest.approx([0, 1])


def test_wrong_times_give_another_curve() -> None:
    wrong = [
        dataclasses.replace(one, seconds=float(t)) for one, t in zip(shots(camera, TIMES * 3), TIMES**2, strict=True)
    ]
    light = np.linspace(0.1, 0.9, 20)
    assert np.abs(measured([wrong]).decode(camera(light)) / light - 1).max() > 5 * tolerances.MEASURED_RESPONSE


def test_a_response_without_exposures_is_told() -> None:
    with pytest.raises(LightsphereError, match=r"needs several of 0\.png"):
        measured([shots(camera, TIMES[:1])])
    with pytest.raises(LightsphereError, match="too few values"):
        measured([shots(camera, np.array([1e-6, 2e-6]))])
    with pytest.raises(LightsphereError, match="needs several of a thing"):
        response_of("exposures", 8)


def test_more_than_eight_bits_are_linear_by_custom() -> None:
    assert [response_of("auto", bits).name for bits in (8, 16, 32)] == ["sRGB", "linear", "linear"]


def test_a_measured_curve_is_read(tmp_path: Path) -> None:
    path = tmp_path / "camera.txt"
    stored = np.linspace(0, 255, 256)
    np.savetxt(path, np.column_stack([stored, (stored / 255) ** 2 * 7]))
    value = np.array([0.0, 0.3, 0.77, 1.0])
    np.testing.assert_allclose(response_of(str(path), 8).decode(value), value**2, atol=2e-5)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0 0\n1 1\n1 2\n", "does not rise"),
        ("0 0 0\n1 1 1\n", "3 columns"),
        ("a b\n", "not a table"),
        ("1 1\n", "not rise"),
    ],
)
def test_a_table_that_is_no_curve_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "curve.txt"
    path.write_text(text)
    with pytest.raises(LightsphereError, match=said):
        response_of(str(path), 8)


@pytest.mark.parametrize("text", ["nowhere.txt", "0", "-1", "nan", "99"])
def test_a_response_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(LightsphereError, match=r"response nowhere|gamma"):
        response_of(text, 8)


def exposed(light: np.ndarray, time: float, rng: np.random.Generator) -> np.ndarray:
    """Expose 8 bits of sRGB with photon noise, the camera clipping at 1."""
    seen = light * time / TIMES[0]
    noisy = seen + rng.normal(0, 1, seen.shape) * np.sqrt(1e-4 * seen)
    return np.round(encoded(noisy) * 255) / 255


def merged(light: np.ndarray, times: np.ndarray = TIMES, stated: np.ndarray = TIMES) -> np.ndarray:
    rng = np.random.default_rng(1)
    pictures = [exposed(light, t, rng).astype(np.float32) for t in times]
    read = [partial(Picture, p, 8, s) for p, s in zip(pictures, stated, strict=True)]
    return decoded([Shot(f"exposure {i}", one) for i, one in enumerate(read)], "srgb").linear


def test_exposures_merge_into_the_light_over_four_decades() -> None:
    light = np.repeat(np.geomspace(1e-4, 0.9, 60)[:, None, None], 300, axis=1) * np.ones(3)
    found = merged(light)
    bias = np.abs(found.mean(axis=(1, 2)) / light[:, 0, 0] - 1)
    assert bias.max() < 0.02
    spread = found.std(axis=(1, 2)) / light[:, 0, 0]
    bright = light[:, 0, 0] > 1e-3
    # No estimate can be better than the photons of all exposures together, and the merged one is not much worse.
    photons = np.sqrt(1e-4 / light[bright, 0, 0] / sum(t for t in TIMES / TIMES[0]))
    assert (spread[bright] > 0.9 * photons).all()
    alone = np.abs(merged(light, TIMES[:1], TIMES[:1]) / light - 1).mean()
    assert np.abs(found / light - 1).mean() < alone / 3


def test_the_order_of_the_exposures_does_not_matter() -> None:
    light = np.geomspace(1e-3, 0.9, 300).reshape(10, 10, 3)
    stored = np.stack([encoded(light * t / TIMES[0]) for t in TIMES]).astype(np.float32)
    curve = response_of("srgb", 8)
    linear, rounding = curve.decode(stored), curve.rounding(stored, 8)
    forward = merge(linear, stored, rounding, TIMES)
    np.testing.assert_allclose(forward, merge(linear[::-1], stored[::-1], rounding[::-1], TIMES[::-1]), rtol=1e-5)
    np.testing.assert_allclose(forward, light, rtol=1e-4)


def test_wrong_times_do_not_pass() -> None:
    light = np.full((4, 4, 3), 0.02)
    assert np.abs(merged(light) / light - 1).mean() < 0.02
    assert np.abs(merged(light, stated=TIMES**1.05) / light - 1).mean() > 0.02


def test_what_the_shortest_exposure_clips_stays_saturated() -> None:
    found = merged(np.full((3, 3, 3), 5.0))
    assert (found >= saturation(response_of("srgb", 8), 8)).all() and (found <= 1).all()


def test_equal_or_unknown_times_are_told() -> None:
    picture = Picture(np.zeros((2, 2, 3), np.float32), 8, None)
    shots = [Shot("a.png", lambda: picture), Shot("b.png", lambda: picture)]
    with pytest.raises(LightsphereError, match=r"exposure times of a\.png to b\.png are not known .*exposures\.txt"):
        decoded(shots, "auto")
