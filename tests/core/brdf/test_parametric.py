"""Ward's lobe and the simplified Torrance-Sparrow lobe against their closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.brdf import Brdf
from pipeline.core.brdf.parametric import TorranceSparrow, Ward
from pipeline.core.errors import LightsphereError
from pipeline.core.material.quadrature import view
from tests import oracles, tolerances
from tests.core.brdf.materials import (
    BRUSHED,
    GREY,
    ISOTROPIC,
    LOBE,
    RED,
    UP,
    random_directions,
    reciprocal,
    turned_alike,
)


class Lopsided:
    """A reflectance that knows the viewer's angle alone: none that exists."""

    isotropic = True

    def evaluate(self, wi: NDArray[Any], wo: NDArray[Any]) -> NDArray[np.float64]:
        return GREY / wo[:, 2:]


def returned(brdf: Brdf, cosine: float) -> NDArray[np.float64]:
    """Directional-hemispherical reflectance (3,) of a view, by sums over light directions."""
    wi, weight = view(cosine)
    wo = np.broadcast_to([np.sqrt(1 - cosine**2), 0.0, cosine], wi.shape)
    return np.asarray(((weight * wi[:, 2])[:, None] * brdf.evaluate(wi, wo)).sum(axis=0))


@pytest.mark.parametrize("brdf", [ISOTROPIC, BRUSHED, LOBE])
def test_light_and_viewer_can_be_exchanged(brdf: Brdf) -> None:
    assert reciprocal(brdf)
    assert not reciprocal(Lopsided())


@pytest.mark.parametrize("brdf", [ISOTROPIC, BRUSHED, LOBE])
def test_turning_both_directions_changes_what_is_brushed_alone(brdf: Brdf) -> None:
    assert turned_alike(brdf) == brdf.isotropic


def test_without_a_highlight_the_diffuse_colour_comes_back() -> None:
    for brdf in (Ward(RED, np.zeros(3), 0.2, 0.2), TorranceSparrow(RED, np.zeros(3), 0.2)):
        np.testing.assert_allclose(returned(brdf, 0.8), RED, rtol=tolerances.QUADRATURE)


@pytest.mark.parametrize(("alpha_x", "alpha_y"), [(0.03, 0.03), (0.02, 0.05)])
def test_ward_s_highlight_returns_its_colour_from_above(alpha_x: float, alpha_y: float) -> None:
    """Ward 1992: the lobe's integral is the specular colour while alpha is small, seen from above."""
    found = returned(Ward(np.zeros(3), GREY, alpha_x, alpha_y), 1.0)
    np.testing.assert_allclose(found, GREY, rtol=tolerances.WARD)
    assert not np.allclose(1.05 * found, GREY, rtol=tolerances.WARD)


@pytest.mark.parametrize("cosine", [0.9, 0.7, 0.4])
def test_ward_s_highlight_returns_the_cosine_of_its_colour_from_aside(cosine: float) -> None:
    """With dwi = 4 cos(theta_d) dwh, a narrow lobe about the mirror direction gives cos(theta_d) = cos(theta_o):
    the loss at flat angles that Duer 2006 mends."""
    found = returned(Ward(np.zeros(3), GREY, 0.02, 0.02), cosine)
    np.testing.assert_allclose(found, cosine * GREY, rtol=tolerances.WARD)


def test_ward_s_highlight_tells_tangent_from_bitangent() -> None:
    """Light from above, viewers 20 degrees off along x and along y: theta_h is 10 degrees."""
    theta = np.radians(20.0)
    for heading, alpha in (([1.0, 0.0], 0.1), ([0.0, 1.0], 0.3)):
        wo = np.array([[*(np.sin(theta) * np.array(heading)), np.cos(theta)]])
        lobe = np.exp(-(np.tan(theta / 2) ** 2) / alpha**2) / (4 * np.pi * 0.1 * 0.3 * np.sqrt(np.cos(theta)))
        np.testing.assert_allclose(BRUSHED.evaluate(UP, wo)[0], RED / np.pi + GREY * lobe, rtol=1e-12)
        swapped = Ward(RED, GREY, 0.3, 0.1)
        assert not np.allclose(swapped.evaluate(UP, wo)[0], RED / np.pi + GREY * lobe, rtol=0.1)


@pytest.mark.parametrize("sigma", [0.02, 0.05])
def test_the_simplified_lobe_returns_two_pi_sigma_squared_from_above(sigma: float) -> None:
    """theta_h is half the light's angle: 2 pi times the integral of exp(-theta^2 / (8 sigma^2)) theta / 4."""
    found = returned(TorranceSparrow(np.zeros(3), GREY, sigma), 1.0)
    np.testing.assert_allclose(found, 2 * np.pi * sigma**2 * GREY, rtol=tolerances.WARD)


def test_the_simplified_lobe_falls_by_the_root_of_e_within_sigma() -> None:
    wi = np.array([[np.sin(0.3), 0.0, np.cos(0.3)]])
    lobe = LOBE.specular / (4 * np.cos(0.3)) * np.exp(-0.5)
    np.testing.assert_allclose(LOBE.evaluate(wi, UP)[0], RED / np.pi + lobe, rtol=1e-12)


def test_the_simplified_lobe_stays_as_it_is_at_80_degrees_where_it_is_steeper() -> None:
    steep, grazing = (oracles.unit(np.array([[np.cos(a), 0.0, np.sin(a)]])) for a in (np.radians(10.0), 1e-6))
    at_80, beyond = (LOBE.evaluate(w, w * [-1, 1, 1]) for w in (steep, grazing))
    np.testing.assert_allclose(beyond, at_80, rtol=1e-9)
    assert (LOBE.evaluate(UP, UP) < at_80).all()


@pytest.mark.parametrize("brdf", [ISOTROPIC, BRUSHED, LOBE])
def test_nothing_is_negative_or_infinite(brdf: Brdf) -> None:
    wi, wo = random_directions(2000, 7), random_directions(2000, 8)
    wo[::3] *= [1, 1, 1e-6]
    value = brdf.evaluate(wi, oracles.unit(wo))
    assert np.isfinite(value).all()
    assert (value >= 0).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"diffuse": -RED}, "diffuse is"),
        ({"specular": np.full(3, np.nan)}, "specular is"),
        ({"specular": np.ones(4)}, "specular is"),
        ({"alpha_x": 0.0}, "alpha_x is 0.0; give one number from 0.001 to 1"),
        ({"alpha_y": 1.5}, "alpha_y is 1.5"),
        ({"alpha_y": np.nan}, "alpha_y is nan"),
        ({"alpha_y": np.array([0.1, 0.2])}, "alpha_y is"),
    ],
)
def test_what_is_no_parameter_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(LightsphereError, match=message):
        Ward(**{"diffuse": RED, "specular": GREY, "alpha_x": 0.1, "alpha_y": 0.2, **change})


@pytest.mark.parametrize("sigma", [0.0, -0.1, np.inf])
def test_a_lobe_without_width_is_refused(sigma: float) -> None:
    with pytest.raises(LightsphereError, match="sigma is"):
        TorranceSparrow(RED, GREY, sigma)
