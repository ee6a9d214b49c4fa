"""The nearest Principled BSDF: what is one comes back, what is none is said, blending follows the weights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.material.closures import Lobe
from pipeline.core.material.principled import Parameters, fit_principled
from pipeline.core.material.surface import White, bases_of
from pipeline.core.reflectance import Reflectance
from tests import tolerances


@dataclass(frozen=True)
class Planted:
    """A Principled BSDF as a BRDF."""

    parameters: Parameters
    isotropic: bool = True

    def evaluate(self, wi: NDArray[Any], wo: NDArray[Any]) -> NDArray[np.float64]:
        return self.parameters.evaluate(wi, wo) / wi[:, 2, None]


PLASTIC = Parameters(np.array([0.5, 0.2, 0.1]), np.array([0.6, 0.6, 0.6]), 0.0, 0.3)
METAL = Parameters(np.array([0.9, 0.6, 0.3]), np.ones(3), 1.0, 0.45)


def ones(*shape: int) -> NDArray[np.float32]:
    return np.ones(shape, np.float32)


@pytest.mark.parametrize("planted", [PLASTIC, METAL])
def test_a_planted_principled_comes_back(planted: Parameters) -> None:
    found = fit_principled([Planted(planted)], ones(1, 1, 1, 1))
    assert found.notes["principled_rel_rms"][0] < tolerances.PLANTED_PRINCIPLED
    np.testing.assert_allclose(found.base[0, 0], planted.base, atol=0.03)
    assert found.roughness[0, 0] == pytest.approx(planted.roughness, abs=0.02)
    assert found.metallic[0, 0] == pytest.approx(planted.metallic, abs=0.05)


def test_what_no_principled_can_be_is_said() -> None:
    retro = White(Lobe("retro", 0.4))
    found = fit_principled([retro], ones(1, 1, 1, 1))
    assert found.notes["principled_rel_rms"][0] > 0.3


def test_parameters_are_blended_by_the_weights() -> None:
    weights = np.zeros((1, 4, 2, 1), np.float32)
    weights[0, :, :, 0] = [[1, 0], [0, 1], [0.5, 0.5], [0.5, 0]]
    found = fit_principled([Planted(PLASTIC), Planted(METAL)], weights)
    np.testing.assert_allclose(found.metallic[0, :2], [0, 1], atol=0.05)
    assert 0.2 < found.metallic[0, 2] < 0.98
    np.testing.assert_allclose(found.base[0, 2], (found.base[0, 0] + found.base[0, 1]) / 2, atol=1e-5)
    np.testing.assert_allclose(found.base[0, 3], found.base[0, 0] / 2, atol=1e-5)
    low, high = sorted((found.roughness[0, 0], found.roughness[0, 1]))
    assert low <= found.roughness[0, 2] <= high


def test_unknown_texels_stay_unknown_and_nothing_exceeds_one() -> None:
    weights = np.full((1, 3, 1, 1), 5.0, np.float32)
    weights[0, 1] = np.nan
    found = fit_principled([Planted(METAL)], weights)
    assert np.isnan(found.base[0, 1]).all() and np.isnan(found.roughness[0, 1])
    assert found.base[0, 0].max() == 1.0 and found.metallic[0, 0] <= 1.0


def test_a_diffuse_and_one_lobe_are_white_closures() -> None:
    colour = np.broadcast_to(np.float32([0.4, 0.2, 0.1]), (1, 2, 3)).copy()
    roughness = np.float32([[0.3, 0.5]])
    one_lobe = Reflectance(colour, 0.1 * colour, 0 * roughness, roughness, 0 * roughness)
    bases, weights = bases_of(one_lobe)
    assert len(bases) == 5 and weights.shape == (1, 2, 5, 3)
    wi = wo = np.array([[0.3, 0.1, 0.9]]) / np.linalg.norm([0.3, 0.1, 0.9])
    value = sum(w * b.evaluate(wi, wo)[0] for b, w in zip(bases, weights[0, 1], strict=True))
    expected = colour[0, 1] / np.pi + 0.1 * colour[0, 1] * Lobe("ggx", 0.5).evaluate(wi, wo)[0] / wi[0, 2]
    np.testing.assert_allclose(value, expected, rtol=1e-6)
