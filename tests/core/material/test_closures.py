"""The closed forms of Cycles' closures: reciprocity, energy and limits that hold whatever the formula."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.material.closures import Lobe
from pipeline.core.material.energy import cosines, directional_albedo
from pipeline.core.material.quadrature import directions, view
from tests import oracles, tolerances

LOBES = [
    Lobe("diffuse"),
    Lobe("ggx", 0.06),
    Lobe("ggx", 0.5),
    Lobe("ggx", 0.5, 0.25),
    Lobe("beckmann", 0.3),
    Lobe("beckmann", 0.4, 4.0),
    Lobe("fresnel", 0.4),
    Lobe("retro", 0.5),
    Lobe("sheen", 0.4),
]


def random_directions(count: int, seed: int) -> NDArray[np.float64]:
    w = np.random.default_rng(seed).normal(size=(count, 3))
    w[:, 2] = np.abs(w[:, 2]) + 0.02
    return oracles.unit(w)


@pytest.mark.parametrize("lobe", [lobe for lobe in LOBES if lobe.kind != "retro"], ids=str)
def test_light_and_viewer_can_be_exchanged(lobe: Lobe) -> None:
    wi, wo = random_directions(500, 1), random_directions(500, 2)
    there, back = lobe.evaluate(wi, wo) * wo[:, 2], lobe.evaluate(wo, wi) * wi[:, 2]
    np.testing.assert_allclose(there, back, rtol=1e-9, atol=1e-30)
    assert not np.allclose(lobe.evaluate(wi, wo), lobe.evaluate(wo, wi), rtol=0.01)  # f cos alone is not symmetric


@pytest.mark.parametrize("lobe", LOBES, ids=str)
def test_no_closure_returns_more_than_it_receives(lobe: Lobe) -> None:
    albedo = directional_albedo(lobe.evaluate, lobe.aspect == 1)
    assert albedo.max() < 1 + tolerances.QUADRATURE and albedo.min() >= 0


@pytest.mark.parametrize("lobe", [Lobe("diffuse"), Lobe("ggx", 0.05), Lobe("beckmann", 0.2, 0.3)], ids=str)
def test_a_smooth_closure_returns_everything(lobe: Lobe) -> None:
    """White microfacets of small slope lose nothing to masking but near the horizon."""
    albedo = directional_albedo(lobe.evaluate, lobe.aspect == 1)
    np.testing.assert_allclose(albedo[cosines() > 0.3], 1.0, atol=tolerances.QUADRATURE)


def test_ggx_is_the_lobe_of_the_oracle() -> None:
    wi, wo = random_directions(500, 3), random_directions(500, 4)
    up = np.broadcast_to([0.0, 0.0, 1.0], wi.shape)
    wanted = oracles.ggx_cosine(up, wi, wo, 0.4)
    np.testing.assert_allclose(Lobe("ggx", 0.4).evaluate(wi, wo), wanted, rtol=1e-9)
    assert not np.allclose(Lobe("ggx", 0.42).evaluate(wi, wo), wanted, rtol=0.02)


def test_the_roughness_of_a_stretched_lobe_is_the_mean_of_its_alphas() -> None:
    along, across = Lobe("ggx", 0.5, 4.0).alphas
    assert across / along == pytest.approx(4.0) and (along * across) ** 0.25 == pytest.approx(0.5)


def test_a_retro_reflective_lobe_peaks_towards_the_light() -> None:
    wo = np.broadcast_to(oracles.unit(np.array([0.6, 0.1, 0.7])), (400, 3))
    wi = random_directions(400, 5)
    values = Lobe("retro", 0.3).evaluate(wi, wo)
    assert values[np.argmax((wi * wo).sum(axis=1))] == values.max()
    assert Lobe("retro", 0.3).evaluate(wo[:1], wo[:1])[0] > values.max()


@pytest.mark.parametrize("isotropic", [True, False])
def test_pairs_of_directions_fill_both_hemispheres(isotropic: bool) -> None:
    pairs = directions(isotropic)
    for w in (pairs.wi, pairs.wo):
        np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1.0, rtol=1e-12)
        assert w[:, 2].min() > 0
    assert pairs.weight.sum() == pytest.approx(2 * np.pi**2, rel=tolerances.QUADRATURE)
    mean = (pairs.weight * pairs.wi[:, 2]).sum() / pairs.weight.sum()
    assert mean == pytest.approx(0.5, rel=tolerances.QUADRATURE)  # of cos over the hemisphere
    crossed = (pairs.weight * pairs.wi[:, 2] ** 2).sum() / pairs.weight.sum()
    assert crossed == pytest.approx(1 / 3, rel=tolerances.QUADRATURE)


def test_pairs_of_directions_are_weighted_by_the_view() -> None:
    pairs = directions()
    mean = (pairs.weight * pairs.wo[:, 2]).sum() / pairs.weight.sum()
    assert mean == pytest.approx(2 / 3, rel=tolerances.QUADRATURE)  # of cos over a hemisphere weighted by cos


@pytest.mark.parametrize("cosine", [1.0, 0.3, 0.02])
def test_light_directions_of_one_view_fill_the_hemisphere(cosine: float) -> None:
    wi, weight = view(cosine)
    assert (weight * wi[:, 2]).sum() == pytest.approx(np.pi, rel=tolerances.QUADRATURE)


def test_five_per_cent_too_bright_is_an_error_of_five_per_cent() -> None:
    pairs = directions()
    value = Lobe("ggx", 0.3).evaluate(pairs.wi, pairs.wo)
    assert pairs.relative_rms(1.05 * value, value) == pytest.approx(0.05)
    assert pairs.relative_rms(0 * value, value) == 1.0
