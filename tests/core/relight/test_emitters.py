"""Lights as sums of points and directions: what leaves them, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.errors import LightsphereError
from pipeline.core.relight import emitters
from pipeline.core.relight.emitters import Emitter
from pipeline.core.relight.environment import emitters_of, sky
from pipeline.core.relight.profiles import SpotProfile, SpreadProfile, TableProfile
from pipeline.core.rig import sphere

ONE = np.ones(3)
FAR = 1e4


def flux(lights: list[Emitter]) -> float:
    """Return the power that leaves lights near the origin, as a large sphere about them receives it [W]."""
    points = FAR * sphere(20_000)
    received = sum(light.irradiance(points)[:, 0].astype(np.float64) for light in lights)
    return float(np.mean(received) * 4 * np.pi * FAR**2)


def square(count: int, side: float) -> list[Emitter]:
    local = side * emitters.rectangle(count)
    points = np.concatenate([local, np.zeros((len(local), 1))], axis=1)
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return emitters.area(points, normals, np.full(len(points), side**2 / len(points)), 3.0 * ONE)


def test_the_power_of_lights_is_that_of_their_points() -> None:
    assert flux([emitters.point([0, 0, 0], [2.0] * 3)]) == pytest.approx(8 * np.pi, rel=1e-4)
    assert flux(square(4, 0.5)) == pytest.approx(np.pi * 3.0 * 0.25, rel=2e-3)  # pi L A
    assert flux(emitters.ball(np.zeros(3), 0.3, 2.0 * ONE, 64)) == pytest.approx(8 * np.pi, rel=1e-3)
    tube = emitters.line(np.zeros(3), np.array([0.0, 0.5, 0.0]), ONE, 16)
    assert flux(tube) == pytest.approx(np.pi**2, rel=2e-3)  # the integral of sin over the sphere


def test_a_square_shines_as_its_integral() -> None:
    """Below its middle: E = 4 L / sqrt(1 + a^2) a atan(a / sqrt(1 + a^2)), a half the side over the distance."""
    a = 0.25 / 0.4
    expected = 3.0 * 4 * a / np.sqrt(1 + a * a) * np.arctan(a / np.sqrt(1 + a * a))
    place = np.array([[0.0, 0.0, 0.4]])
    found = sum(
        light.irradiance(place)[0, 0] * (0.4 / np.linalg.norm(place[0] - light.place)) for light in square(16, 0.5)
    )
    assert found == pytest.approx(expected, rel=2e-3)
    behind = square(16, 0.5)[0].irradiance(-place)
    assert behind.max() == 0.0


def test_a_spot_is_whole_inside_its_cone_and_dark_outside() -> None:
    profile = SpotProfile(np.radians(60), 0.5, (2.0, 1.0))
    tilt = np.radians([0.0, 14.0, 40.0, 50.0])
    across = np.stack([0 * tilt, np.sin(tilt), np.cos(tilt)], axis=1)
    along = np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], axis=1)
    assert profile(across)[[0, 2]] == pytest.approx([1.0, 0.0])
    assert 0.0 < profile(along)[2] < 1.0  # the cone is twice as wide along x
    assert profile(along)[3] == 0.0


def test_a_grid_before_a_light_keeps_its_power_and_ends_at_half_its_spread() -> None:
    """The integral of the profile times cos over the half sphere is pi, whatever the spread."""
    tilt = (np.arange(200_000) + 0.5) / 200_000 * np.pi / 2
    directions = np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], axis=1)
    for spread in (0.3, 1.5, 3.0):
        sent = SpreadProfile(spread)(directions)
        whole = 2 * np.pi * (sent * np.sin(tilt) * np.cos(tilt)).mean() * np.pi / 2
        assert whole == pytest.approx(np.pi, rel=1e-4)
        assert sent[tilt > spread / 2].max() == 0.0


def test_a_table_is_read_in_its_own_directions() -> None:
    directions, _ = sky(32, 64)
    table = TableProfile(directions + 2.0)
    np.testing.assert_allclose(table(directions.reshape(-1, 3)), directions.reshape(-1, 3) + 2.0, atol=1e-12)
    seam = np.array([[-1.0, 1e-3, 0.0], [-1.0, -1e-3, 0.0]]) / np.sqrt(1 + 1e-6)
    np.testing.assert_allclose(table(seam), seam + 2.0, atol=0.005)


def test_an_environment_keeps_its_power_and_its_sun() -> None:
    assert sum(light.intensity[0] for light in emitters_of(np.ones((16, 32, 3), np.float32), 64)) == pytest.approx(
        4 * np.pi
    )
    radiance = np.random.default_rng(0).uniform(0, 2, (32, 64, 3)).astype(np.float32)
    radiance[9, 20] = 5e4
    directions, angles = sky(32, 64)
    found = emitters_of(radiance, 50)
    assert len(found) == 50
    assert sum(light.intensity for light in found) == pytest.approx((radiance * angles[:, None, None]).sum((0, 1)))
    sun = max(found, key=lambda light: float(light.intensity[0]))
    assert np.degrees(np.arccos(min(1.0, sun.place @ directions[9, 20]))) < 0.5


def test_the_map_s_middle_looks_along_x_and_its_top_up() -> None:
    directions, angles = sky(90, 180)
    assert directions[45, 90] == pytest.approx([1, 0, 0], abs=0.05)
    assert directions[45, 45] == pytest.approx([0, 1, 0], abs=0.05)
    assert directions[0, 0, 2] > 0.99
    assert angles.sum() * 180 == pytest.approx(4 * np.pi)


def wrong(value: float) -> NDArray[np.float32]:
    radiance = np.ones((8, 16, 3), np.float32)
    radiance[3, 4] = value
    return radiance


@pytest.mark.parametrize(
    ("radiance", "said"),
    [(wrong(np.nan), "not numbers"), (wrong(-0.1), "negative"), (0 * wrong(1.0), "black")],
)
def test_a_map_that_cannot_shine_is_told(radiance: NDArray[np.float32], said: str) -> None:
    with pytest.raises(LightsphereError, match=said):
        emitters_of(radiance)
