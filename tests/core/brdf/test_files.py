"""BRDFs and their files: reciprocity, normalisation, and what is written comes back."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.brdf import Brdf
from pipeline.core.brdf.files import MERL, MERL_SCALE, directions, merl_nodes, read_brdf, write_merl, write_npz
from pipeline.core.brdf.parametric import TorranceSparrow, Ward
from pipeline.core.brdf.tabulated import Tabulated, filled, half_and_difference
from pipeline.core.errors import LightsphereError
from pipeline.core.material.quadrature import view
from tests import oracles, tolerances

RED, GREY = np.array([0.5, 0.2, 0.1]), np.full(3, 0.3)
ISOTROPIC = Ward(RED, GREY, 0.2, 0.2)
BRUSHED = Ward(RED, GREY, 0.1, 0.3)
LOBE = TorranceSparrow(RED, 0.2 * GREY, 0.15)


def random_directions(count: int, seed: int) -> NDArray[np.float64]:
    w = np.random.default_rng(seed).normal(size=(count, 3))
    w[:, 2] = np.abs(w[:, 2]) + 0.1
    return oracles.unit(w)


def random_table(phi: int, seed: int = 5) -> Tabulated:
    rng = np.random.default_rng(seed)
    nodes = (np.arange(9) + 0.5) / 9 * np.pi / 2
    phi_d = (np.arange(phi) + 0.5) / phi * np.pi
    return Tabulated(rng.uniform(0.1, 1, (9, 9, phi, 3)), nodes, nodes, phi_d)


@pytest.mark.parametrize("brdf", [ISOTROPIC, BRUSHED, LOBE, random_table(1), random_table(8)])
def test_light_and_viewer_can_be_exchanged(brdf: Brdf) -> None:
    wi, wo = random_directions(300, 1), random_directions(300, 2)
    np.testing.assert_allclose(brdf.evaluate(wi, wo), brdf.evaluate(wo, wi), rtol=1e-9)


def test_a_table_that_knows_phi_apart_by_more_than_pi_would_not_be_reciprocal() -> None:
    wi, wo = random_directions(300, 1), random_directions(300, 2)
    phi, back = half_and_difference(wi, wo)[2], half_and_difference(wo, wi)[2]
    np.testing.assert_allclose(np.minimum(abs(phi - back), np.pi - abs(phi - back)), 0, atol=1e-9)
    assert np.ptp(phi) > 3


@pytest.mark.parametrize("brdf", [ISOTROPIC, LOBE, random_table(8), BRUSHED])
def test_turning_both_directions_changes_what_is_brushed_alone(brdf: Brdf) -> None:
    wi, wo = random_directions(300, 3), random_directions(300, 4)
    turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    same = np.allclose(brdf.evaluate(wi, wo), brdf.evaluate(wi @ turn.T, wo @ turn.T), rtol=1e-8)
    assert same == brdf.isotropic


@pytest.mark.parametrize(("alpha_x", "alpha_y"), [(0.03, 0.03), (0.02, 0.05)])
def test_ward_s_highlight_returns_its_colour(alpha_x: float, alpha_y: float) -> None:
    """Ward 1992: the lobe's integral is the specular colour while alpha is small, seen from above."""
    wi, weight = view(1.0)
    brdf = Ward(np.zeros(3), GREY, alpha_x, alpha_y)
    up = np.broadcast_to([0.0, 0.0, 1.0], wi.shape)
    returned = ((weight * wi[:, 2])[:, None] * brdf.evaluate(wi, up)).sum(axis=0)
    np.testing.assert_allclose(returned, GREY, rtol=tolerances.WARD)


def test_ward_s_highlight_is_longer_along_the_wider_axis() -> None:
    up = np.array([[0.0, 0.0, 1.0]])
    along, across = (oracles.unit(np.array([w])) for w in ([0.3, 0.0, 1.0], [0.0, 0.3, 1.0]))
    assert (BRUSHED.evaluate(across, up) > 1.5 * BRUSHED.evaluate(along, up)).all()


def test_the_simplified_lobe_stays_finite_at_the_horizon() -> None:
    w = oracles.unit(np.array([[1.0, 0.0, 1e-6]]))
    back = w * [-1, 1, 1]
    assert np.isfinite(LOBE.evaluate(w, back)).all()


def test_angles_of_directions_come_back() -> None:
    rng = np.random.default_rng(6)
    theta_h, theta_d = rng.uniform(0, 0.7, 200) ** 3, rng.uniform(0.01, 0.7, 200)
    phi_d = rng.uniform(0, np.pi, 200)
    found = half_and_difference(*directions(theta_h, theta_d, phi_d))
    np.testing.assert_allclose(found[0], theta_h, atol=1e-14)
    np.testing.assert_allclose(found[1], theta_d, atol=1e-12)
    np.testing.assert_allclose(found[2], phi_d, atol=1e-6)


@pytest.mark.parametrize("phi", [1, 6])
def test_a_table_has_its_own_values_at_its_nodes(phi: int) -> None:
    brdf = random_table(phi)
    angles = np.meshgrid(brdf.theta_h, brdf.theta_d, brdf.phi_d, indexing="ij")
    np.testing.assert_allclose(brdf.evaluate(*directions(*angles)), brdf.table.reshape(-1, 3), rtol=1e-6)
    swapped = brdf.evaluate(*directions(angles[1], angles[0], angles[2]))
    assert not np.allclose(swapped, brdf.table.reshape(-1, 3), rtol=0.1)


@pytest.mark.parametrize("brdf", [ISOTROPIC, LOBE])
def test_a_merl_table_comes_back_exactly_at_its_bins(brdf: Brdf, tmp_path: Path) -> None:
    path = tmp_path / "a.binary"
    write_merl(path, brdf)
    assert path.stat().st_size == 12 + 3 * 8 * 90 * 90 * 180
    read = read_brdf(path)
    wi, wo = directions(*np.meshgrid(*merl_nodes(), indexing="ij"))
    some = np.flatnonzero((wi[:, 2] > 0) & (wo[:, 2] > 0))[::97]
    np.testing.assert_allclose(read.evaluate(wi[some], wo[some]), brdf.evaluate(wi[some], wo[some]), rtol=1e-6)
    wi, wo = random_directions(2000, 7), random_directions(2000, 8)
    between = np.abs(read.evaluate(wi, wo) / brdf.evaluate(wi, wo) - 1)
    assert np.median(between) < tolerances.BETWEEN_BINS


def test_single_cells_of_a_merl_file_are_where_the_format_says(tmp_path: Path) -> None:
    """One cell a colour, at theta_h bin 2, theta_d bin 30, phi_d bin 100."""
    planes = np.full((3, *MERL), 0.0)
    planes[:, 2, 30, 100] = (1500.0, 3000.0, 1500.0)
    path = tmp_path / "cells.binary"
    path.write_bytes(struct.pack("<3i", *MERL) + planes.astype("<f8").tobytes())
    theta_h = (2.5 / 90) ** 2 * np.pi / 2
    wi, wo = directions(np.array([theta_h]), np.array([30.5 / 90 * np.pi / 2]), np.array([100.5 / 180 * np.pi]))
    read = read_brdf(path)
    np.testing.assert_allclose(read.evaluate(wi, wo)[0], [1.0, 2.3, 1.66], rtol=1e-6)
    np.testing.assert_allclose(read.evaluate(wo, wi)[0], [1.0, 2.3, 1.66], rtol=1e-6)
    np.testing.assert_allclose(MERL_SCALE * 1500, [1.0, 1.15, 1.66])


@pytest.mark.parametrize("brdf", [ISOTROPIC, BRUSHED, LOBE, random_table(1), random_table(5)])
def test_an_npz_comes_back_whole(brdf: Brdf, tmp_path: Path) -> None:
    write_npz(tmp_path / "a.npz", brdf)
    read = read_brdf(tmp_path / "a.npz")
    assert type(read) is type(brdf)
    wi, wo = random_directions(50, 9), random_directions(50, 10)
    np.testing.assert_array_equal(read.evaluate(wi, wo), brdf.evaluate(wi, wo))


def test_cells_that_were_never_measured_take_their_neighbour_s_value() -> None:
    table = np.arange(24.0).reshape(4, 2, 1, 3) + 1
    for unknown in (np.nan, np.inf, -1.0):
        holed = table.copy()
        holed[3, 1] = unknown
        whole, count = filled(holed)
        assert count == 1
        np.testing.assert_array_equal(whole[3, 1], whole[3, 0] if (whole[3, 1] == whole[3, 0]).all() else whole[2, 1])
        np.testing.assert_array_equal(whole[:3], table[:3])
    with pytest.raises(LightsphereError, match="no value at all"):
        filled(np.full((2, 2, 1, 3), -1.0))


def written(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


NODES = {"theta_h": np.array([0.1, 0.5]), "theta_d": np.array([0.2, 0.9])}
BAD: dict[str, tuple[Any, str]] = {
    "no file": (None, "is missing"),
    "no key": ({"table": np.ones((2, 2, 3))}, "theta_h, theta_d is missing"),
    "shape": ({"table": np.ones((3, 2, 3)), **NODES}, "has the shape"),
    "order": ({"table": np.ones((2, 2, 3)), **NODES, "theta_h": np.array([0.5, 0.1])}, "must ascend"),
    "degrees": ({"table": np.ones((2, 2, 3)), **NODES, "theta_h": np.array([5.0, 50.0])}, "radians"),
    "nothing": ({"table": np.full((2, 2, 3), np.nan), **NODES}, "no value at all"),
    "model": ({"model": "phong"}, "unknown"),
    "ward": ({"model": "ward", "diffuse": RED, "specular": GREY, "alpha_x": 0.1, "alpha_y": 2.0}, "alpha_y is 2"),
    "colour": ({"model": "ward", "diffuse": -RED, "specular": GREY, "alpha_x": 0.1, "alpha_y": 0.2}, "diffuse is"),
    "words": ({"table": np.array([["a"]]), **NODES}, "no numbers"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_npz_says_what_is_wrong(case: str, tmp_path: Path) -> None:
    arrays, message = BAD[case]
    path = tmp_path / "bad.npz"
    if arrays is not None:
        written(path, **arrays)
    with pytest.raises(LightsphereError, match=rf"bad\.npz.*{message}"):
        read_brdf(path)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "no MERL table"),
        (struct.pack("<3i", 90, 90, 360), "no MERL table"),
        (struct.pack("<3i", *MERL) + bytes(80), "copy it again"),
    ],
)
def test_a_bad_binary_says_what_is_wrong(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "bad.binary").write_bytes(data)
    with pytest.raises(LightsphereError, match=rf"bad\.binary.*{message}"):
        read_brdf(tmp_path / "bad.binary")


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(b"x")
    (tmp_path / "a.npz").write_bytes(b"x")
    with pytest.raises(LightsphereError, match="no BRDF file"):
        read_brdf(tmp_path / "a.exr")
    with pytest.raises(LightsphereError, match="damaged"):
        read_brdf(tmp_path / "a.npz")
    with pytest.raises(LightsphereError, match="isotropic"):
        write_merl(tmp_path / "b.binary", BRUSHED)
