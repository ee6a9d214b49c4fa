"""Half and difference angles, and tables over them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.core.brdf.tabulated import Tabulated, directions, filled, half_and_difference
from pipeline.core.errors import LightsphereError
from tests.core.brdf.materials import random_directions, random_table, reciprocal, turned_alike

ONES = np.ones((2, 2, 2, 3))
NODES = {"theta_h": np.array([0.1, 0.5]), "theta_d": np.array([0.2, 0.9]), "phi_d": np.array([0.3, 1.9])}


@pytest.mark.parametrize("phi", [1, 2, 8])
def test_a_table_is_reciprocal_and_isotropic(phi: int) -> None:
    assert reciprocal(random_table(phi))
    assert turned_alike(random_table(phi))


def test_exchanging_light_and_viewer_turns_phi_by_pi() -> None:
    wi, wo = random_directions(300, 1), random_directions(300, 2)
    phi, back = half_and_difference(wi, wo)[2], half_and_difference(wo, wi)[2]
    np.testing.assert_allclose(np.minimum(abs(phi - back), np.pi - abs(phi - back)), 0, atol=1e-9)
    assert np.ptp(phi) > 3


def test_angles_of_directions_come_back() -> None:
    rng = np.random.default_rng(6)
    theta_h, theta_d = rng.uniform(0, 0.7, 200) ** 3, rng.uniform(0.01, 0.7, 200)
    phi_d = rng.uniform(0, np.pi, 200)
    found = half_and_difference(*directions(theta_h, theta_d, phi_d))
    np.testing.assert_allclose(found[0], theta_h, atol=1e-14)
    np.testing.assert_allclose(found[1], theta_d, atol=1e-12)
    np.testing.assert_allclose(found[2], phi_d, atol=1e-6)


def test_half_angles_keep_their_digits_where_highlights_are() -> None:
    """Directions are good to 1e-16: half angles of 1e-9 keep 6 digits, of which an arc cosine leaves none."""
    theta_h = np.geomspace(1e-9, 1e-5, 9)
    wi, wo = directions(theta_h, np.full(9, 0.4), np.full(9, 1.1))
    np.testing.assert_allclose(half_and_difference(wi, wo)[0], theta_h, rtol=1e-6)
    cosine = (wi + wo)[:, 2] / np.linalg.norm(wi + wo, axis=1)
    assert abs(np.arccos(np.minimum(cosine, 1))[0] / theta_h[0] - 1) > 0.5


@pytest.mark.parametrize("phi", [1, 6])
def test_a_table_has_its_own_values_at_its_nodes(phi: int) -> None:
    brdf = random_table(phi)
    h, d, p = np.meshgrid(brdf.theta_h, brdf.theta_d, brdf.phi_d, indexing="ij")
    np.testing.assert_allclose(brdf.evaluate(*directions(h, d, p)), brdf.table.reshape(-1, 3), rtol=1e-9)
    assert not np.allclose(brdf.evaluate(*directions(d, h, p)), brdf.table.reshape(-1, 3), rtol=0.1)


def test_between_nodes_a_table_is_linear_in_the_root_of_theta_h_and_in_theta_d() -> None:
    """Planted: f = sqrt(theta_h), 1 + theta_d and theta_h in three colours; the last is not linear in the root."""
    nodes = np.linspace(0.1, 1.2, 7) ** 2 / 1.2
    h, d = np.meshgrid(nodes, nodes, indexing="ij")
    brdf = Tabulated(np.stack([np.sqrt(h), 1 + d, h], axis=-1)[:, :, None], nodes, nodes, np.array([np.pi / 2]))
    rng = np.random.default_rng(3)
    theta_h, theta_d = rng.uniform(nodes[0], nodes[-1], (2, 200))
    value = brdf.evaluate(*directions(theta_h, theta_d, rng.uniform(0, np.pi, 200)))
    np.testing.assert_allclose(value[:, :2], np.stack([np.sqrt(theta_h), 1 + theta_d], axis=-1), rtol=1e-9)
    assert not np.allclose(value[:, 2], theta_h, rtol=1e-3)
    outside = brdf.evaluate(*directions(np.array([0.0, 1.5]), np.array([0.0, 1.5]), np.ones(2)))
    np.testing.assert_allclose(outside, brdf.table[[0, -1], [0, -1], 0], rtol=1e-12)


def test_phi_goes_round() -> None:
    """With nodes at 45 and 135 degrees, 0 and 180 lie halfway between the last and the first."""
    table = np.stack([np.full((1, 1, 3), 1.0), np.full((1, 1, 3), 3.0)], axis=2)
    brdf = Tabulated(table, np.array([0.2]), np.array([0.3]), np.array([0.25, 0.75]) * np.pi)
    phi = np.array([0.0, 0.125, 0.25, 0.5, 0.75, 0.875, 1.0]) * np.pi
    value = brdf.evaluate(*directions(np.full(7, 0.2), np.full(7, 0.3), phi))
    np.testing.assert_allclose(value[:, 0], [2, 1.5, 1, 2, 3, 2.5, 2], rtol=1e-9)


def test_the_last_angle_before_zero_is_pi_in_floating_point() -> None:
    wi, wo = (np.array([[sign * 0.6, -sign * 1e-20, 0.8]]) for sign in (1.0, -1.0))
    assert half_and_difference(wi, wo)[2][0] == np.pi
    brdf = Tabulated(np.arange(6.0).reshape(1, 1, 2, 3), np.array([0.2]), np.array([0.3]), np.array([0.0, 2.0]))
    np.testing.assert_allclose(brdf.evaluate(wi, wo), brdf.table[0, :, 0])


@pytest.mark.parametrize("unknown", [np.nan, np.inf, -1.0])
def test_cells_that_were_never_measured_take_a_neighbour_s_value(unknown: float) -> None:
    table = np.arange(24.0).reshape(4, 2, 1, 3) + 1
    holed = table.copy()
    holed[3, 1, 0, 1] = unknown  # one colour is enough
    whole, count = filled(holed)
    assert count == 1
    assert any(np.array_equal(whole[3, 1], near) for near in (table[3, 0], table[2, 1]))
    whole[3, 1] = table[3, 1]
    np.testing.assert_array_equal(whole, table)


def test_a_table_of_holes_is_refused() -> None:
    with pytest.raises(LightsphereError, match="no value at all"):
        filled(np.full((2, 2, 1, 3), -1.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"table": ONES[:1]}, r"has the shape \(1, 2, 2, 3\), its nodes say \(2, 2, 2, 3\)"),
        ({"table": ONES[..., :1]}, "has the shape"),
        ({"theta_h": np.array([0.5, 0.1])}, "theta_h must ascend"),
        ({"theta_d": np.array([0.5, 0.5])}, "theta_d must ascend"),
        ({"theta_d": np.array([5.0, 50.0])}, "theta_d .* radians"),
        ({"phi_d": np.array([0.0, np.nan])}, "phi_d must ascend"),
        ({"theta_h": np.array([[0.1], [0.5]])}, r"theta_h has the shape \(2, 1\)"),
        ({"theta_h": np.zeros(0), "table": ONES[:0]}, r"theta_h has the shape \(0,\)"),
        ({"phi_d": np.array([0.0, np.pi])}, "one angle"),
        ({"table": -ONES}, "no reflectance"),
        ({"table": ONES * np.nan}, "no reflectance"),
    ],
)
def test_what_is_no_table_is_refused(change: dict[str, Any], message: str) -> None:
    assert Tabulated(**{"table": ONES, **NODES}).isotropic
    with pytest.raises(LightsphereError, match=message):
        Tabulated(**{"table": ONES, **NODES, **change})
