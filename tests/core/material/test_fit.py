"""Basis BRDFs as mixtures: what is a mixture comes back, what is none is bounded, counted and said."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.errors import LightsphereError
from pipeline.core.material import STOPS, Mixture, stop_shares
from pipeline.core.material.closures import Lobe
from pipeline.core.material.energy import bounded, cosines, directional_albedo, reciprocity_error
from pipeline.core.material.fit import DICTIONARY, fit
from pipeline.core.material.quadrature import directions
from pipeline.core.progress import finish
from tests import tolerances

GGX = [Lobe("ggx", float(r)) for r in DICTIONARY["ggx"]]
RED, GREY = np.array([0.5, 0.1, 0.05]), np.full(3, 0.2)


@dataclass(frozen=True)
class Planted:
    """A BRDF given as f cos(theta_i)."""

    f_cos: Callable[[NDArray[Any], NDArray[Any]], NDArray[np.float64]]
    isotropic: bool = True

    def evaluate(self, wi: NDArray[Any], wo: NDArray[Any]) -> NDArray[np.float64]:
        return self.f_cos(wi, wo) / wi[:, 2, None]


def mixed(*parts: tuple[NDArray[np.float64], Lobe]) -> Planted:
    def f_cos(wi: NDArray[Any], wo: NDArray[Any]) -> NDArray[np.float64]:
        return np.sum([lobe.evaluate(wi, wo)[:, None] * colour for colour, lobe in parts], axis=0)

    return Planted(f_cos, all(lobe.aspect == 1 for _, lobe in parts))


def test_a_planted_mixture_comes_back_with_its_lobes() -> None:
    found = finish(fit([mixed((RED, Lobe("diffuse")), (GREY, GGX[12]), (0.5 * RED, GGX[22]))], 4))
    assert {GGX[12], GGX[22]} <= set(found.lobes)
    assert found.notes["material_rel_rms"][0] < tolerances.PLANTED_MIXTURE
    np.testing.assert_allclose(found.curves[0, 0, 2:], np.broadcast_to(RED, (8, 3)), rtol=0.02)


def test_one_lobe_is_enough_for_one() -> None:
    found = finish(fit([mixed((RED, Lobe("diffuse")), (GREY, GGX[15]))], 4))
    assert [lobe.kind for lobe in found.lobes] == ["diffuse", "ggx"]
    errors = found.notes["error_by_lobes"]
    assert len(errors) == 5 and errors[0] > 0.3 and errors[1] < tolerances.PLANTED_MIXTURE
    assert all(b <= a + 1e-6 for a, b in itertools.pairwise(errors))  # a lobe more never harms


def test_lambert_needs_no_gloss() -> None:
    found = finish(fit([mixed((RED, Lobe("diffuse")))], 4))
    assert found.lobes == (Lobe("diffuse"),)


def test_bases_share_their_lobes() -> None:
    bases = [mixed((RED, Lobe("diffuse")), (GREY, GGX[8])), mixed((GREY, Lobe("diffuse")), (RED, GGX[20]))]
    found = finish(fit(bases, 2))
    assert set(found.lobes) == {Lobe("diffuse"), GGX[8], GGX[20]}
    np.testing.assert_allclose(found.notes["material_rel_rms"], 0, atol=tolerances.PLANTED_MIXTURE)
    eight, twenty = (found.lobes.index(GGX[i]) for i in (8, 20))
    assert found.curves[0, twenty, 2:].max() < 0.01 < found.curves[0, eight, 2:].min()
    assert found.curves[1, eight, 2:].max() < 0.01 < found.curves[1, twenty, 2:].min()


def test_fresnel_lobes_are_grey_and_a_share() -> None:
    found = finish(fit([mixed((RED, GGX[18]), (np.array([1.0, 0.6, 0.2]), Lobe("fresnel", 0.4)))], 3))
    for number, lobe in enumerate(found.lobes):
        if lobe.kind == "fresnel":
            curve = found.curves[0, number]
            assert curve.max() <= 1 and np.ptp(curve, axis=1).max() == 0
    plain = finish(fit([mixed((RED, GGX[18]), (np.ones(3), Lobe("fresnel", 0.4)))], 3, fresnel=False))
    assert "fresnel" not in {lobe.kind for lobe in plain.lobes}


@pytest.mark.parametrize("kind", ["retro", "sheen", "beckmann"])
def test_other_kinds_of_lobes_are_found_where_they_pay(kind: str) -> None:
    lobe = Lobe(kind, float(DICTIONARY[kind][3]))
    found = finish(fit([mixed((0.2 * RED, Lobe("diffuse")), (GREY, lobe))], 1))
    assert found.lobes[1] == lobe


def test_brushed_metal_is_stretched_the_right_way() -> None:
    found = finish(fit([mixed((GREY, Lobe("ggx", 0.4, 4.0)))], 2))
    assert found.notes["material_rel_rms"][0] < 0.1
    strongest = max(range(len(found.lobes)), key=lambda i: found.curves[0, i].max())
    assert 2 < found.lobes[strongest].aspect < 8
    turned = finish(fit([mixed((GREY, Lobe("ggx", 0.4, 0.25)))], 2))
    strongest = max(range(len(turned.lobes)), key=lambda i: turned.curves[0, i].max())
    assert 1 / 8 < turned.lobes[strongest].aspect < 1 / 2


def test_a_basis_that_shines_by_itself_is_lowered_to_what_it_receives() -> None:
    bright = finish(fit([mixed((3 * RED, Lobe("diffuse")), (2 * GREY, GGX[10]))], 2))
    assert bright.notes["albedo_unbounded"][0] > 1.5
    assert bright.notes["albedo"][0] <= 1 + 1e-9
    assert directional_albedo(bright.evaluate).max() <= 1 + 1e-9
    assert bright.notes["material_rel_rms"][0] > 0.2  # and the error says so
    kept = finish(fit([mixed((RED, Lobe("diffuse")))], 2))
    assert kept.notes["albedo"] == kept.notes["albedo_unbounded"]


def test_no_view_between_two_stops_exceeds_one() -> None:
    curves = np.random.default_rng(3).uniform(0, 3, (1, 2, len(STOPS), 3))
    mixture = bounded(Mixture((Lobe("diffuse"), GGX[14]), curves))
    albedo = directional_albedo(mixture.evaluate)
    assert len(albedo) > 30 and albedo.max() <= 1 + 1e-9
    assert albedo[cosines() > 0.5].max() > 0.7  # lowered, not put out


def test_curves_of_the_view_cost_reciprocity_and_constants_do_not() -> None:
    pairs = directions()
    level = Mixture((Lobe("diffuse"), GGX[14]), np.full((1, 2, len(STOPS), 3), 0.3))
    assert reciprocity_error(level, pairs)[0] < 1e-9
    tilted = Mixture(level.lobes, level.curves * (0.5 + STOPS[:, None]))
    assert reciprocity_error(tilted, pairs)[0] > 0.02


def test_curves_are_linear_between_their_stops() -> None:
    cosine = np.array([0.0, STOPS[3], 0.5 * (STOPS[6] + STOPS[7]), 1.0])
    shares = stop_shares(cosine)
    np.testing.assert_allclose(shares.sum(axis=1), 1)
    np.testing.assert_allclose(shares @ STOPS, cosine, atol=1e-12)
    assert (np.rint(STOPS * 255) == STOPS * 255).all()


@pytest.mark.parametrize("bases", [0, 5])
def test_a_number_of_bases_that_no_material_takes_is_refused(bases: int) -> None:
    with pytest.raises(LightsphereError, match="1 to 4"):
        finish(fit([mixed((RED, Lobe("diffuse")))] * bases, 2))


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_a_basis_without_values_is_named(value: float) -> None:
    broken = Planted(lambda wi, wo: np.full((len(wi), 3), value))
    with pytest.raises(LightsphereError, match="basis BRDF 2 is black or not finite"):
        finish(fit([mixed((RED, Lobe("diffuse"))), broken], 2))
