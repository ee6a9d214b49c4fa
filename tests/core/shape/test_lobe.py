"""The lobe model: its derivatives, and its limits against the microfacet distributions it generalises."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.rig import sphere
from pipeline.core.shape import lobe
from tests import oracles, tolerances

NORMAL = oracles.unit(np.array([0.2, -0.3, 1.0]))
RAY = np.concatenate([[0.3, 0.2, 5.0], oracles.unit(np.array([-0.02, -0.05, -1.0]))])
DEPTH = 4.6
POINT = RAY[:3] + DEPTH * RAY[3:]


def pixel(lights: NDArray[np.float64], roots: NDArray[np.float64], bounced: bool) -> lobe.Pixel:
    nothing = np.zeros(lobe.UNKNOWNS)
    weights = np.linspace(0.5, 1.0, len(lights))
    middle = float(np.median(roots))
    return lobe.Pixel(RAY, 3.0, 6.0, len(lights), lights, roots, weights, middle, 0.0, bounced, nothing, nothing)


def facing(count: int, least: float) -> NDArray[np.float64]:
    """Lights on spheres of 2 and 3 m that a surface at POINT faces with at least this cosine."""
    lights = np.concatenate([2 * sphere(count), 3 * sphere(count // 2)])
    return np.ascontiguousarray(lights[oracles.dot(NORMAL, oracles.unit(lights - POINT)) > least])


def state_of(alpha: float, kappa: float, bounced: bool) -> NDArray[np.float64]:
    bounce = (0.05, 0.02, -0.03, 0.01) if bounced else (0.0, 0.0, 0.0, 0.0)
    return np.array([DEPTH, *NORMAL, np.log(alpha), kappa, 0.4, 0.9, 0.5, *bounce])


def stepped(state: NDArray[np.float64], unknown: int, step: float) -> NDArray[np.float64]:
    """Move one unknown: the second and third turn the normal towards its tangents."""
    out = state.copy()
    if unknown in (1, 2):
        frame = lobe.tangents(*state[lobe.NX : lobe.NX + 3])
        out[1:4] = oracles.unit(state[1:4] + step * np.array(frame[3 * unknown - 3 : 3 * unknown]))
    else:
        out[unknown + (1 if unknown > 2 else 0)] += step
    return out


@pytest.mark.parametrize("bounced", [False, True])
@pytest.mark.parametrize("glossy", [False, True])
@pytest.mark.parametrize(("alpha", "kappa"), [(0.3, 0.01), (0.1, 0.3), (0.25, 0.49), (0.25, 0.51), (0.15, 0.7)])
def test_derivatives_agree_with_differences(alpha: float, kappa: float, glossy: bool, bounced: bool) -> None:
    lights = facing(60, 0.02)
    known = pixel(lights, np.full(len(lights), 0.3), bounced)
    state = state_of(alpha, kappa, bounced)
    residuals, jacobian = np.empty(len(lights)), np.full((len(lights), lobe.UNKNOWNS), np.nan)
    lobe.evaluate(state, glossy, known, 0.1, residuals, jacobian)
    used = lobe.UNKNOWNS if bounced else lobe.DIRECT_UNKNOWNS
    for unknown in range(used):
        sides = []
        for sign in (-1, 1):
            moved = stepped(state, unknown, sign * 1e-6)
            lobe.evaluate(moved, glossy, known, 0.1, residuals, np.empty((0, lobe.UNKNOWNS)))
            sides.append(residuals.copy())
        difference = (sides[1] - sides[0]) / 2e-6
        largest = np.abs(difference).max()
        assert glossy == (largest > 0) or unknown not in (3, 4, 6, 7)
        apart = np.abs(jacobian[:, unknown] - difference).max()
        assert apart <= tolerances.JACOBIAN * max(largest, 1e-3), unknown
        if largest > 0:  # a wrong sign is seen
            assert np.abs(jacobian[:, unknown] + difference).max() > 0.5 * largest


def rounded(lights: NDArray[np.float64], state: NDArray[np.float64], step: float) -> lobe.Pixel:
    """What a pixel in that state sees of lights in steps, those rounded to 0 last."""
    predicted = np.empty(len(lights))
    lobe.evaluate(state, True, pixel(lights, np.zeros(len(lights)), False), 1.0, predicted, np.empty((0, 12)))
    values = step * np.round((predicted / np.linspace(0.5, 1.0, len(lights))) ** 3 / step)
    order = np.argsort(values == 0, kind="stable")
    roots = np.cbrt(np.where(values > 0, values, step / 2))[order]
    known = pixel(np.ascontiguousarray(lights[order]), roots, False)
    return known._replace(lit=int((values > 0).sum()), noise=step / np.sqrt(12))


def test_rounded_values_ask_for_their_step_and_no_more() -> None:
    lights, state, step = facing(60, 0.02), state_of(0.3, 0.4, False), 0.1
    known = rounded(lights, state, step)
    assert 12 < known.lit < len(lights) - 12
    residuals, jacobian = np.empty(len(lights)), np.empty((len(lights), lobe.UNKNOWNS))
    lobe.evaluate(state, True, known, 0.1, residuals, jacobian)
    assert (residuals[known.lit :] == 0).all() and (jacobian[known.lit :] == 0).all()
    cubes = known.roots[: known.lit] ** 3
    widest = known.roots[: known.lit] - np.cbrt(cubes - step / 2)
    assert (abs(residuals) / known.weights)[: known.lit].max() <= lobe.SOFT * widest.max() * (1 + 1e-9)
    brighter = state.copy()
    brighter[[lobe.DIFFUSE, lobe.SPECULAR, lobe.RISE]] *= 3
    lobe.evaluate(brighter, True, known, 0.1, residuals, jacobian)
    assert (residuals[known.lit :] > 0).sum() >= 8
    moved = brighter.copy()
    moved[lobe.DEPTH] += 1e-6
    after = np.empty(len(lights))
    lobe.evaluate(moved, True, known, 0.1, after, np.empty((0, lobe.UNKNOWNS)))
    np.testing.assert_allclose((after - residuals) / 1e-6, jacobian[:, 0], atol=1e-4 * abs(jacobian[:, 0]).max())


def lobe_values(lights: NDArray[np.float64], roughness: float, kappa: float) -> NDArray[np.float64]:
    """The model's lobe alone, D G with D = 1 at its peak."""
    state = state_of(roughness**2, kappa, False)
    state[[lobe.DIFFUSE, lobe.SPECULAR, lobe.RISE]] = 0.0, 1.0, 0.0
    known = pixel(lights, np.zeros(len(lights)), False)
    residuals = np.empty(len(lights))
    lobe.evaluate(state, True, known, 1.0, residuals, np.empty((0, lobe.UNKNOWNS)))
    d2 = ((lights - POINT) ** 2).sum(-1)
    return np.asarray((residuals / known.weights) ** 3 * d2)


def variation(values: NDArray[np.float64]) -> float:
    return float(np.ptp(values) / np.median(values))


@pytest.mark.parametrize("roughness", [0.3, 0.6])
def test_a_kappa_of_one_half_is_ggx(roughness: float) -> None:
    lights = facing(400, 0.05)
    true = oracles.ggx_cosine(NORMAL, oracles.unit(lights - POINT), -RAY[3:], roughness)
    assert variation(lobe_values(lights, roughness, 0.5) / true) < tolerances.CLOSED_FORM
    assert variation(lobe_values(lights, roughness, 0.45) / true) > 0.05


@pytest.mark.parametrize("roughness", [0.4, 0.6])
def test_a_small_kappa_is_beckmann(roughness: float) -> None:
    lights = facing(400, 0.05)
    to_light = oracles.unit(lights - POINT)
    cos_h = oracles.dot(NORMAL, oracles.unit(to_light - RAY[3:]))
    near = (1 / cos_h**2 - 1) < 6 * roughness**4
    assert near.sum() > 20
    true = oracles.beckmann_cosine(NORMAL, to_light, -RAY[3:], roughness)
    assert variation(lobe_values(lights, roughness, 1e-5)[near] / true[near]) < tolerances.WALTER_LAMBDA
    assert variation(lobe_values(lights, roughness, 0.1)[near] / true[near]) > 0.1


@pytest.mark.parametrize("roughness", [0.2, 0.4])
def test_the_least_kappa_is_beckmann_to_the_digits_of_float_pictures(roughness: float) -> None:
    """Lights at one angle to the normal have one G, so that their values go as D alone."""
    around = np.linspace(0, 2 * np.pi, 400)[:, None]
    tangent, bitangent = np.reshape(lobe.tangents(*NORMAL), (2, 3))
    mirror = float(oracles.dot(NORMAL, -RAY[3:]))
    across = np.sqrt(1 - mirror**2) * (np.cos(around) * tangent + np.sin(around) * bitangent)
    to_light = mirror * NORMAL + across
    tan2 = 1 / oracles.dot(NORMAL, oracles.unit(to_light - RAY[3:])) ** 2 - 1
    near = tan2 < 8 * roughness**4
    assert near.sum() > 20 and np.ptp(tan2[near]) > 4 * roughness**4
    true = np.exp(-tan2 / roughness**4) * (1 + tan2) ** 2
    lights = np.ascontiguousarray(POINT + 2.0 * to_light)
    assert variation((lobe_values(lights, roughness, lobe.KAPPA_RANGE[0]) / true)[near]) < tolerances.LEAST_KAPPA
    assert variation((lobe_values(lights, roughness, 1e-3) / true)[near]) > 1e3 * tolerances.LEAST_KAPPA


def test_the_lobe_is_one_where_half_vector_and_normal_meet() -> None:
    to_viewer = -RAY[3:]
    mirror = 2 * oracles.dot(NORMAL, to_viewer) * NORMAL - to_viewer
    light = np.array([POINT + 2.0 * mirror])
    cosine = float(oracles.dot(NORMAL, to_viewer))  # G of equal angles: (1 + x) / (1 + 2 x)
    alpha = 0.3
    x = (np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)) - 1) / 2
    assert lobe_values(light, alpha**0.5, 0.5)[0] == pytest.approx((1 + x) / (1 + 2 * x), rel=1e-9)
