"""The parts of which shape under unknown lights is made: responses, near lights, lobes, cues and starts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.shape.uncalibrated import equations, integrability, lobes
from pipeline.core.shape.uncalibrated.lamps import arriving, held_apart, places
from pipeline.core.shape.uncalibrated.outline import outline
from pipeline.core.shape.uncalibrated.start import equally_strong
from tests import oracles, synthetic, tolerances
from tests.photographed import directions

Array = NDArray[Any]
COUNT = 12  # lights


def test_derivatives_are_those_of_the_values() -> None:
    random = np.random.default_rng(0)
    weights, coefficients = random.uniform(0.5, 1, 2), random.uniform(0, 1, (2, lobes.COUNT, 3))
    view, light = oracles.unit(np.array([0.2, 0.1, 1.0])), np.array([0.5, -0.3, 0.9])
    normal = oracles.unit(np.array([0.3, 0.2, 0.8]))
    tangents = np.empty((2, 3))
    equations.frame(normal, tangents)

    def response(n: Array, s: Array, w: Array) -> tuple[Array, ...]:
        space = equations.workspace(2, lobes.COUNT)
        space[0][:] = tangents
        assert equations.respond(n, view, s, w, coefficients, space)
        return space[2:]

    value, by_normal, by_weight, by_light, by_lobe = response(normal, light, weights)
    np.testing.assert_allclose(tangents @ np.stack([normal, *tangents]).T, [[0, 1, 0], [0, 0, 1]], atol=1e-12)
    step = 1e-6
    for t in range(2):
        ahead, behind = (response(normal + s * step * tangents[t], light, weights)[0] for s in (1, -1))
        np.testing.assert_allclose(by_normal[t], (ahead - behind) / (2 * step), rtol=tolerances.JACOBIAN)
    for i in range(3):
        move = step * np.eye(3)[i]
        ahead, behind = (response(normal, light + s * move, weights)[0] for s in (1, -1))
        np.testing.assert_allclose(by_light[i], (ahead - behind) / (2 * step), rtol=tolerances.JACOBIAN)
    np.testing.assert_allclose(by_weight.T @ weights, value, rtol=1e-12)
    np.testing.assert_allclose(np.einsum("k,j,kjc->c", weights, by_lobe, coefficients), value, rtol=1e-12)


def test_a_near_light_falls_off_with_its_distance_squared() -> None:
    """Against a point at d / q of the intensity |m| / q^2; its derivatives against differences; q = 0 is distant."""
    light, offset = np.array([0.5, -0.3, 0.9, 0.35]), np.array([0.4, 0.5, -0.2])
    strength = np.linalg.norm(light[:3])
    towards = light[:3] / strength / light[3] - offset
    here, slopes = np.empty(3), np.empty((4, 3))
    arriving(light, offset, here, slopes)
    irradiance = strength / light[3] ** 2 / (towards**2).sum()
    np.testing.assert_allclose(here, irradiance * oracles.unit(towards), rtol=1e-12)
    step = 1e-6
    for i in range(4):
        ahead, behind, unused = np.empty(3), np.empty(3), np.empty((4, 3))
        arriving(light + step * np.eye(4)[i], offset, ahead, unused)
        arriving(light - step * np.eye(4)[i], offset, behind, unused)
        np.testing.assert_allclose(slopes[i], (ahead - behind) / (2 * step), rtol=tolerances.JACOBIAN, atol=1e-9)
    arriving(np.append(light[:3], 0.0), offset, here, slopes)
    np.testing.assert_allclose(here, light[:3], rtol=1e-12)


def test_near_lights_stay_outside() -> None:
    offsets = 0.8 * oracles.unit(np.random.default_rng(0).standard_normal((200, 3)))
    lights = np.hstack([directions(COUNT), np.linspace(-1.0, 9.0, COUNT)[:, None]])
    held = places(held_apart(lights, offsets))
    assert np.linalg.norm(held, axis=1).min() > 0.9 and np.linalg.norm(held, axis=1).max() < 1000
    untouched = np.hstack([directions(COUNT), np.full((COUNT, 1), 0.4)])
    np.testing.assert_array_equal(held_apart(untouched, offsets), untouched)


def test_lobes_are_those_of_ggx() -> None:
    """Against the oracle: a lobe over pi alpha is D V, whose product with the cosine the oracle gives."""
    normal = np.array([[0.0, 0.0, 1.0]])
    wi, wo = oracles.unit(np.array([[0.5, 0.2, 1.0]])), oracles.unit(np.array([[-0.1, 0.6, 1.0]]))
    half = oracles.unit(wi + wo)
    found = lobes.evaluated(half[:, 2], wi[:, 2], wo[:, 2])[0]
    for j, alpha in enumerate(lobes.ALPHAS):
        true = oracles.ggx_cosine(normal, wi, wo, np.sqrt(alpha))[0] / wi[0, 2]
        assert found[j + 1] == pytest.approx(np.pi * alpha * true, rel=1e-6)


@pytest.mark.parametrize(("model", "told"), [("pinhole", 8), ("orthographic", 5)])
def test_integrability_leaves_open_what_it_must(model: str, told: int) -> None:
    """A pinhole camera leaves the scale open, an orthographic one that and the bas-relief ambiguity."""
    camera = synthetic.camera(40, model, distance=2.5)
    ball = synthetic.ball(camera)
    mask = ball.confidence > 0
    origins, towards = camera.rays()
    rays = np.concatenate([(origins - camera.to_world[:3, 3])[mask], towards[mask]], axis=1)
    lights = directions(COUNT)
    matrix, target = integrability.cue(mask, rays, ball.normal[mask].astype(np.float64), lights, model == "pinhole")
    turned = lights @ (np.eye(3) + 0.02 * np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 0]]))
    flatter = lights * [1, 1, 1.05]
    off = [float(((target - matrix @ s.ravel()) ** 2).sum()) for s in (lights, turned, flatter)]
    assert off[1] > 100 * off[0]
    assert (off[2] > 1e-3 * off[1]) == (model == "pinhole"), off
    size = np.linalg.svd(matrix, compute_uv=False)
    assert (size > 1e-2 * size[0]).sum() <= told


def test_dome_over_a_disk_is_a_ball() -> None:
    camera = synthetic.camera(64, "orthographic")
    ball = synthetic.ball(camera)
    mask = ball.confidence > 0
    found = outline(mask, np.broadcast_to([0.0, 0.0, 1.0], (int(mask.sum()), 3)))
    apart = np.degrees(np.arccos(np.clip(oracles.dot(found.dome, ball.normal[mask]), -1, 1)))
    assert np.median(apart) < 2.0
    rim = ball.normal[mask][found.rim]
    assert np.abs(oracles.dot(rim, found.along[found.rim])).max() < 0.1


def test_equal_strengths_fix_a_factor_but_for_a_rotation() -> None:
    direction = directions(COUNT)
    mixed = direction @ np.array([[1.0, 0.3, 0.1], [0.0, 1.2, -0.4], [0.2, 0.0, 0.7]])
    matrix = equally_strong(mixed)
    assert matrix is not None
    np.testing.assert_allclose(np.linalg.norm(mixed @ matrix, axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(mixed @ matrix @ (mixed @ matrix).T, direction @ direction.T, atol=1e-9)
    assert equally_strong(np.ones((COUNT, 3))) is None
