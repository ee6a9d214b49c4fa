"""BRDF files: what is written comes back, cells lie where the format says, and bad files say what is wrong."""

from __future__ import annotations

import dataclasses
import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.core.brdf import Brdf
from pipeline.core.brdf.files import MERL, MERL_SCALE, merl_nodes, read_brdf, write_merl, write_npz
from pipeline.core.brdf.tabulated import directions
from pipeline.core.errors import LightsphereError
from tests import tolerances
from tests.core.brdf.materials import BRUSHED, GREY, ISOTROPIC, LOBE, RED, random_directions, random_table

HEADER = struct.pack("<3i", *MERL)


def written(path: Path, **arrays: Any) -> Path:
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize("brdf", [ISOTROPIC, LOBE])
def test_a_merl_table_comes_back_exactly_at_its_bins(brdf: Brdf, tmp_path: Path) -> None:
    path = tmp_path / "a.binary"
    write_merl(path, brdf)
    assert [file.name for file in tmp_path.iterdir()] == ["a.binary"]
    assert path.stat().st_size == 12 + 3 * 8 * 90 * 90 * 180
    read = read_brdf(path)
    wi, wo = directions(*np.meshgrid(*merl_nodes(), indexing="ij"))
    some = np.flatnonzero((wi[:, 2] > 0) & (wo[:, 2] > 0))[::97]
    true = brdf.evaluate(wi[some], wo[some])
    np.testing.assert_allclose(read.evaluate(wi[some], wo[some]), true, rtol=1e-9)
    for wrong in (1.01 * true, true[:, ::-1]):  # another scale, other colour planes
        assert not np.allclose(read.evaluate(wi[some], wo[some]), wrong, rtol=1e-3)
    wi, wo = random_directions(2000, 7), random_directions(2000, 8)
    between = np.abs(read.evaluate(wi, wo) / brdf.evaluate(wi, wo) - 1)
    assert np.median(between) < tolerances.BETWEEN_BINS


def test_cells_below_the_horizon_are_written_as_never_measured(tmp_path: Path) -> None:
    """A half vector at the normal has no pair below; one near the horizon has, but where the pair lies sideways. phi_d
    and pi - phi_d are mirror images."""
    path = tmp_path / "a.binary"
    write_merl(path, ISOTROPIC)
    planes = np.frombuffer(path.read_bytes(), "<f8", offset=12).reshape(3, *MERL)
    below = planes[0] < 0
    assert (planes[:, below] == -1).all()
    assert (planes[:, ~below] > 0).all()
    assert below[-1, -1, 0]
    assert not below[0].any()
    np.testing.assert_array_equal(below, below[:, :, ::-1])


def test_single_cells_of_a_merl_file_are_where_the_format_says(tmp_path: Path) -> None:
    """One cell a colour, at theta_h bin 2, theta_d bin 30, phi_d bin 100, by the index of each value in the file."""
    values = np.zeros(3 * 90 * 90 * 180)
    cell = 100 + 180 * (30 + 90 * 2)
    values[cell + 90 * 90 * 180 * np.arange(3)] = (1500.0, 3000.0, 1500.0)
    path = tmp_path / "cells.binary"
    path.write_bytes(HEADER + values.astype("<f8").tobytes())
    theta_h, theta_d, phi_d = ((2.5 / 90) ** 2 * np.pi / 2, 30.5 / 90 * np.pi / 2, 100.5 / 180 * np.pi)
    wi, wo = directions(*(np.array([angle]) for angle in (theta_h, theta_d, phi_d)))
    read = read_brdf(path)
    np.testing.assert_allclose(read.evaluate(wi, wo)[0], [1.0, 2.3, 1.66], rtol=1e-9)
    np.testing.assert_allclose(read.evaluate(wo, wi)[0], [1.0, 2.3, 1.66], rtol=1e-9)
    mirrored = directions(*(np.array([angle]) for angle in (theta_h, theta_d, np.pi - phi_d)))
    assert (read.evaluate(*mirrored) == 0).all()
    np.testing.assert_allclose(MERL_SCALE * 1500, [1.0, 1.15, 1.66])


def test_negative_cells_of_a_merl_file_are_unknown(tmp_path: Path) -> None:
    planes = np.full((3, *MERL), 1500.0)
    planes[:, 40:, 60:] = -1.0
    path = tmp_path / "holes.binary"
    path.write_bytes(HEADER + planes.tobytes())
    np.testing.assert_allclose(read_brdf(path).evaluate(*([random_directions(500, 1)] * 2)), [[1, 1.15, 1.66]] * 500)
    path.write_bytes(HEADER + np.full_like(planes, -1.0).tobytes())
    with pytest.raises(LightsphereError, match=r"holes\.binary.*no value at all"):
        read_brdf(path)


@pytest.mark.parametrize("brdf", [ISOTROPIC, BRUSHED, LOBE, random_table(1), random_table(5)])
def test_an_npz_comes_back_whole(brdf: Brdf, tmp_path: Path) -> None:
    write_npz(tmp_path / "a.npz", brdf)
    read = read_brdf(tmp_path / "a.npz")
    assert type(read) is type(brdf)
    wi, wo = random_directions(50, 9), random_directions(50, 10)
    for field in dataclasses.fields(brdf):
        np.testing.assert_array_equal(getattr(read, field.name), getattr(brdf, field.name))
    # numpy 1.26's arctan2 has other last bits where its arrays lie close to each other in memory
    np.testing.assert_allclose(read.evaluate(wi, wo), brdf.evaluate(wi, wo), rtol=1e-13)


def test_a_bivariate_table_needs_neither_model_nor_phi(tmp_path: Path) -> None:
    brdf = random_table(1)
    arrays = {"table": brdf.table[:, :, 0], "theta_h": brdf.theta_h, "theta_d": brdf.theta_d, "by": "a note"}
    path = written(tmp_path / "a.npz", **arrays).rename(tmp_path / "A.NPZ")
    wi, wo = random_directions(50, 9), random_directions(50, 10)
    np.testing.assert_array_equal(read_brdf(path).evaluate(wi, wo), brdf.evaluate(wi, wo))


NODES = {"theta_h": np.array([0.1, 0.5]), "theta_d": np.array([0.2, 0.9])}
WARD = {"model": "ward", "diffuse": RED, "specular": GREY, "alpha_x": 0.1, "alpha_y": 0.2}
BAD: dict[str, tuple[Any, str]] = {
    "no file": (None, "is missing"),
    "no key": ({"table": np.ones((2, 2, 3))}, "theta_h, theta_d is missing"),
    "shape": ({"table": np.ones((3, 2, 3)), **NODES}, "has the shape"),
    "flat": ({"table": np.ones((2, 2)), **NODES}, "has the shape"),
    "one node": ({"table": np.ones((1, 2, 3)), **NODES, "theta_h": 0.1}, r"theta_h has the shape \(\)"),
    "order": ({"table": np.ones((2, 2, 3)), **NODES, "theta_h": np.array([0.5, 0.1])}, "must ascend"),
    "degrees": ({"table": np.ones((2, 2, 3)), **NODES, "theta_h": np.array([5.0, 50.0])}, "radians"),
    "nothing": ({"table": np.full((2, 2, 3), np.nan), **NODES}, "no value at all"),
    "model": ({"model": "phong"}, "unknown"),
    "ward": ({**WARD, "alpha_y": 2.0}, "alpha_y is 2"),
    "two widths": ({**WARD, "alpha_y": np.array([0.1, 0.2])}, "alpha_y is"),
    "colour": ({**WARD, "diffuse": -RED}, "diffuse is"),
    "words": ({"table": np.array([["a"]]), **NODES}, "no numbers"),
    "complex": ({"table": np.ones((2, 2, 3)) * 1j, **NODES}, "no numbers"),
    "pickled": ({"table": np.array([{}]), **NODES}, "damaged"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_npz_says_what_is_wrong(case: str, tmp_path: Path) -> None:
    arrays, message = BAD[case]
    path = tmp_path / "bad.npz"
    if arrays is not None:
        written(path, **arrays)
    with pytest.raises(LightsphereError, match=rf"bad\.npz.*{message}"):
        read_brdf(path)


def test_an_npz_with_any_byte_changed_is_read_or_refused(tmp_path: Path) -> None:
    """What zip and numpy raise on damage is of many kinds; none may reach the user."""
    data = io.BytesIO()
    np.savez_compressed(data, **WARD)
    rng, refused = np.random.default_rng(0), 0
    for place in range(0, len(data.getvalue()), 3):
        damaged = bytearray(data.getvalue())
        damaged[place] ^= int(rng.integers(1, 256))
        (tmp_path / "a.npz").write_bytes(damaged)
        try:
            read_brdf(tmp_path / "a.npz")
        except LightsphereError:
            refused += 1
    assert refused > 100


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "no MERL table"),
        (struct.pack("<3i", 90, 90, 360), "no MERL table"),
        (struct.pack(">3i", *MERL), "no MERL table"),
        (HEADER + bytes(80), "copy it again"),
    ],
)
def test_a_bad_binary_says_what_is_wrong(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "bad.binary").write_bytes(data)
    with pytest.raises(LightsphereError, match=rf"bad\.binary.*{message}"):
        read_brdf(tmp_path / "bad.binary")


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(b"x")
    with pytest.raises(LightsphereError, match="no BRDF file"):
        read_brdf(tmp_path / "a.exr")
    single = io.BytesIO()
    np.save(single, np.ones(3))
    for data in (b"", b"x", single.getvalue()):
        (tmp_path / "a.npz").write_bytes(data)
        with pytest.raises(LightsphereError, match=r"a\.npz.*no \.npz"):
            read_brdf(tmp_path / "a.npz")


def test_what_has_no_form_in_a_file_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(LightsphereError, match="isotropic"):
        write_merl(tmp_path / "b.binary", BRUSHED)
    with pytest.raises(LightsphereError, match="cannot be written"):
        write_npz(tmp_path / "no folder" / "b.npz", BRUSHED)
    assert not list(tmp_path.iterdir())
