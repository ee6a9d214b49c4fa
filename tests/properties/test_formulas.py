"""What holds of every formula, whatever it is given."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from pipeline.core.brdf.parametric import TorranceSparrow, Ward
from pipeline.core.brdf.tabulated import directions as of_angles
from pipeline.core.brdf.tabulated import half_and_difference
from pipeline.core.camera import Camera
from pipeline.core.dataset.sensor import Sensor
from pipeline.core.inverse import ALPHAS, FREE, LEAST, MOST, Model, moved
from pipeline.core.inverse.estimate import newton
from pipeline.core.material import STOPS, stop_shares
from pipeline.core.material.closures import LEAST_ROUGHNESS, Lobe
from pipeline.core.photographs.response import response_of
from pipeline.core.reflectance.nonnegative import solve
from pipeline.core.relight.environment import emitters_of, sky
from tests.properties.strategies import cameras, directions, rounded, vectors

COLOURS = vectors(0.0, 1.0)
CLOSE = 1e-6  # relative


@given(directions(), directions())
def test_half_and_difference_angles_keep_what_does_not_depend_on_the_turn(
    wi: NDArray[np.float64], wo: NDArray[np.float64]
) -> None:
    theta_h, theta_d, phi_d = half_and_difference(wi, wo)
    assert 0 <= theta_h[0] <= np.pi / 2 and 0 <= theta_d[0] <= np.pi / 2 and 0 <= phi_d[0] <= np.pi
    back = of_angles(theta_h, theta_d, phi_d)
    # to the digits that the half vector of two nearly opposite directions has
    tolerance = 1e-12 / max(np.cos(theta_d[0]), 1e-6)
    assert (back[0] * back[1]).sum() == pytest.approx((wi * wo).sum(), abs=tolerance)
    cosines = sorted([back[0][0, 2], back[1][0, 2]])
    assert cosines == pytest.approx(sorted([wi[0, 2], wo[0, 2]]), abs=tolerance)


@given(directions(), directions(), st.sampled_from(["ggx", "beckmann"]), st.floats(LEAST_ROUGHNESS, 1.0))
def test_microfacets_reflect_both_ways_alike(
    wi: NDArray[np.float64], wo: NDArray[np.float64], kind: str, roughness: float
) -> None:
    lobe = Lobe(kind, roughness)
    there, back = lobe.evaluate(wi, wo)[0], lobe.evaluate(wo, wi)[0]
    assert np.isfinite([there, back]).all() and min(there, back) >= 0
    assert there * wo[0, 2] == pytest.approx(back * wi[0, 2], rel=CLOSE, abs=1e-300)


@given(directions(), directions(), st.sampled_from(["fresnel", "retro", "sheen"]), st.floats(0.1, 1.0))
def test_other_closures_are_light_that_is_there(
    wi: NDArray[np.float64], wo: NDArray[np.float64], kind: str, roughness: float
) -> None:
    value = Lobe(kind, roughness).evaluate(wi, wo)[0]
    assert np.isfinite(value) and value >= 0


@given(directions(), directions(), COLOURS, COLOURS, st.floats(1e-3, 1.0), st.floats(1e-3, 1.0))
def test_parametric_models_reflect_both_ways_alike_and_add_up(
    wi: NDArray[np.float64],
    wo: NDArray[np.float64],
    diffuse: NDArray[np.float64],
    specular: NDArray[np.float64],
    first: float,
    second: float,
) -> None:
    nothing = np.zeros(3)
    for model, shape in ((TorranceSparrow, (first,)), (Ward, (first, second))):
        whole = model(diffuse, specular, *shape).evaluate(wi, wo)
        assert np.isfinite(whole).all() and (whole >= 0).all()
        np.testing.assert_allclose(model(diffuse, specular, *shape).evaluate(wo, wi), whole, rtol=CLOSE)
        parts = model(diffuse, nothing, *shape).evaluate(wi, wo) + model(nothing, specular, *shape).evaluate(wi, wo)
        np.testing.assert_allclose(parts, whole, rtol=CLOSE)


@given(st.floats(0.0, 1.0))
def test_stops_are_linear_between_each_other(cosine: float) -> None:
    shares = stop_shares(np.array([cosine]))[0]
    assert shares.sum() == pytest.approx(1.0) and (shares >= -1e-12).all()
    assert (shares > 1e-12).sum() <= 2
    assert shares @ STOPS == pytest.approx(cosine, abs=1e-12)


@given(cameras(), st.floats(-100, 100), st.floats(-100, 100), st.floats(1e-2, 1e4))
def test_what_a_ray_meets_is_seen_where_the_ray_goes_through(
    camera: Camera, column: float, row: float, depth: float
) -> None:
    place = np.array([column, row])
    origin, direction = camera.rays_at(place)
    assert np.linalg.norm(direction) == pytest.approx(1.0)
    seen, distance = camera.project(origin + depth * direction)
    far = (np.abs(camera.to_world[:3, 3]).max() + depth) / depth  # digits lost to a camera far from the world's origin
    assert distance == pytest.approx(depth, rel=1e-12 * far)
    np.testing.assert_allclose(seen, place, atol=1e-12 * far * max(camera.focal) * 20)


@given(
    arrays.arrays(np.float64, (6, 4), elements=rounded(0, 10)),
    arrays.arrays(np.float64, 3, elements=rounded(-5, 5)),
    st.integers(1, 4),
)
def test_non_negative_least_squares_are_better_than_any_other(
    columns: NDArray[np.float64], right: NDArray[np.float64], count: int
) -> None:
    """Than the best of every support by numpy, columns that depend on each other included."""
    a, y = columns[:, :count], np.tile(right, 2)
    found = np.zeros(4)
    gain = solve(a.T @ a, a.T @ y, count, found)
    w = found[:count]
    assert (w >= 0).all()
    power = max(float(y @ y), 1e-30)
    assert ((a @ w - y) ** 2).sum() == pytest.approx(y @ y - gain, abs=1e-6 * power)
    for size in range(1, count + 1):
        for chosen in itertools.combinations(range(count), size):
            part = a[:, list(chosen)]
            if np.linalg.cond(part) > 1e4:
                continue
            other, *_ = np.linalg.lstsq(part, y, rcond=None)
            if (other >= 0).all():
                assert gain >= y @ y - ((part @ other - y) ** 2).sum() - 1e-6 * power


@given(
    arrays.arrays(np.float32, (4, 8, 3), elements=st.floats(0, 1000, width=32)).filter(lambda values: values.any()),
    st.integers(1, 40),
)
def test_an_environment_keeps_its_light(radiance: NDArray[np.float32], count: int) -> None:
    found = emitters_of(radiance, count)
    assert 1 <= len(found) <= max(count, 1)
    power = (radiance.astype(np.float64) * sky(4, 8)[1][:, None, None]).sum(axis=(0, 1))
    np.testing.assert_allclose(sum(one.intensity for one in found), power, rtol=1e-6)
    assert all(np.linalg.norm(one.place) == pytest.approx(1.0) for one in found)


@given(
    st.sampled_from(["diffuse", "specular", "alpha", "ratio", "angle"]),
    st.floats(-20, 20),
    vectors(LEAST, MOST),
    st.floats(*ALPHAS),
    st.floats(1, 30),
)
def test_a_moved_reflectance_stays_one(
    kind: str, by: float, colour: NDArray[np.float64], alpha: float, ratio: float
) -> None:
    model = Model("anisotropic", colour, colour, alpha, ratio, 30.0)
    assert kind in FREE[model.level]
    other = moved(model, kind, by)
    for values in (other.diffuse, other.specular):
        assert (values >= LEAST).all() and (values <= MOST).all()
    assert ALPHAS[0] <= other.alpha <= ALPHAS[1] and other.ratio >= 1 and 0 <= other.angle < 180
    assert sorted(other.alphas) == list(other.alphas)


@given(
    arrays.arrays(np.float64, (3, 12), elements=rounded(-1, 1)),
    vectors(-2, 2),
    arrays.arrays(np.float64, 12, elements=st.floats(0.1, 10)),
)
def test_a_step_without_noise_is_that_of_least_squares(
    slopes: NDArray[np.float64], true: NDArray[np.float64], weight: NDArray[np.float64]
) -> None:
    if np.linalg.cond(slopes) > 100:
        return
    residual = true @ slopes
    step, deviation = newton(np.stack([slopes] * 2), np.stack([residual] * 2), weight, damping=0.0)
    np.testing.assert_allclose(step, true, atol=1e-8)
    np.testing.assert_array_equal(deviation, 0)


@given(st.floats(0, 4), st.sampled_from([8, 10, 12, 16]), st.sampled_from(["linear", "srgb"]))
def test_a_sensor_without_noise_is_off_by_half_a_step_at_most(light: float, bits: int, response: str) -> None:
    shown = Sensor(2.0, 0.0, 0.0, bits, response).expose(np.full((1, 1, 3), light, np.float32), None)  # type: ignore[arg-type]
    true = min(light / 2.0, 1.0)
    step = 1 / (2**bits - 1)
    steepest = 2.4 / 1.055 if response == "srgb" else 1.0
    assert abs(float(shown[0, 0, 0]) - true) <= 0.5 * step * steepest * 1.001 + 1e-6


@given(st.sampled_from(["linear", "srgb", "2.2", "0.7"]), st.floats(0, 1), st.floats(0, 1))
def test_responses_rise_from_nothing_to_full_scale(text: str, low: float, high: float) -> None:
    curve = response_of(text, 8).curve
    low, high = sorted([low, high])
    assert curve(np.float64(low)) <= curve(np.float64(high)) + 1e-15
    assert curve(np.float64(0)) == 0 and curve(np.float64(1)) == pytest.approx(1)
