"""A tabulated reflectance is read between its nodes, from any view, and says where it was never seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.errors import LightsphereError
from pipeline.core.reflectance.angles import difference_angles, half_angles
from pipeline.core.reflectance.bivariate import Bivariate
from tests import oracles

NODES = (90, 31)


def lobe(theta_h: NDArray[Any], theta_d: NDArray[Any]) -> NDArray[Any]:
    return 0.1 + np.exp(-((theta_h / 0.3) ** 2)) * (1 + 0.5 * theta_d)


def tabulated(sets: int = 1) -> Bivariate:
    """A matt and a glossy basis; the glossy one is unseen from 1 rad of theta_d on."""
    h, d = half_angles(NODES[0])[:, None], difference_angles(NODES[1])[None]
    bases = np.stack([np.ones(NODES), lobe(h, d)], axis=-1)[..., None]
    seen = np.ones((*NODES, 2))
    seen[:, d[0] >= 1, 1] = 0
    colours = np.array([1.0, 0.5, 0.25]) if sets == 1 else np.ones(1)
    weights = np.random.default_rng(0).uniform(size=(4, 5, 2, sets)).astype(np.float32)
    return Bivariate(bases * colours, seen, weights, np.zeros((4, 5), np.float32), {"model": "bivariate"})


def directions(count: int = 500) -> list[NDArray[Any]]:
    rng = np.random.default_rng(2)
    normal, wi, wo = (oracles.unit(rng.normal(size=(count, 3))) for _ in range(3))
    above = (oracles.dot(normal, wi) > 0.1) & (oracles.dot(normal, wo) > 0.1)
    return [normal[above], wi[above], wo[above]]


def angles(normal: NDArray[Any], wi: NDArray[Any], wo: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    half = oracles.unit(wi + wo)
    return np.arccos(oracles.dot(normal, half)), np.arccos(oracles.dot(wi, half))


def only(basis: int, count: int, sets: int = 1) -> NDArray[Any]:
    return np.broadcast_to(np.eye(2)[basis, :, None], (count, 2, sets))


def test_reads_the_function_that_was_tabulated() -> None:
    frame = directions()
    f, _ = tabulated().evaluate(only(1, len(frame[0])), *frame)
    np.testing.assert_allclose(f, lobe(*angles(*frame))[:, None] * [1, 0.5, 0.25], rtol=5e-3)
    shifted, _ = tabulated().evaluate(only(1, len(frame[0])), frame[0], frame[1], oracles.unit(frame[2] + [0.05, 0, 0]))
    assert not np.allclose(f, shifted, rtol=5e-3)


def test_is_reciprocal_and_linear() -> None:
    normal, wi, wo = directions()
    found, mixed = tabulated(), np.random.default_rng(1).uniform(size=(len(normal), 2, 1))
    np.testing.assert_allclose(found.evaluate(mixed, normal, wi, wo)[0], found.evaluate(mixed, normal, wo, wi)[0])
    parts = [found.evaluate(only(k, len(normal)), normal, wi, wo)[0] * mixed[:, k] for k in range(2)]
    np.testing.assert_allclose(found.evaluate(mixed, normal, wi, wo)[0], parts[0] + parts[1], rtol=1e-12)


def test_unseen_angles_are_marked_where_a_basis_needs_them() -> None:
    frame = directions()
    _, theta_d = angles(*frame)
    matt, glossy = (tabulated().evaluate(only(k, len(frame[0])), *frame)[1] for k in range(2))
    assert matt.all()
    assert glossy[theta_d < 0.9].all() and not glossy[theta_d > 1.0].any()


def test_weights_may_carry_the_colour() -> None:
    frame = directions()
    coloured = only(0, len(frame[0]), 3) * np.array([0.2, 0.4, 0.6])
    f, _ = tabulated(sets=3).evaluate(coloured, *frame)
    np.testing.assert_allclose(f, np.broadcast_to([0.2, 0.4, 0.6], f.shape))


def test_no_directions_give_no_values() -> None:
    nothing = np.empty((0, 3))
    f, seen = tabulated().evaluate(np.empty((0, 2, 1)), nothing, nothing, nothing)
    assert f.shape == (0, 3) and seen.shape == (0,)


@pytest.mark.parametrize("sets", [1, 3])
def test_round_trip(tmp_path: Path, sets: int) -> None:
    first = tabulated(sets)
    first.save(tmp_path)
    again = Bivariate.open(tmp_path)
    for name in ("table", "seen", "weights", "error"):
        np.testing.assert_array_equal(getattr(again, name), getattr(first, name))


def test_other_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LightsphereError, match="not a reflectance"):
        Bivariate.open(tmp_path)
    tabulated().save(tmp_path)
    (tmp_path / "bases.npz").write_bytes(b"no archive")
    with pytest.raises(LightsphereError, match="damaged"):
        Bivariate.open(tmp_path)


def test_damage_anywhere_in_a_file_is_said(tmp_path: Path) -> None:
    """Cut short or overwritten at every 97th byte: read as it was, or refused by its name."""
    whole = tabulated()
    whole.save(tmp_path)
    path = tmp_path / "bases.npz"
    data = path.read_bytes()
    refused = 0
    for at in range(0, len(data), 97):
        for broken in (data[:at], data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :]):
            path.write_bytes(broken)
            try:
                again = Bivariate.open(tmp_path)
            except LightsphereError as error:
                assert "is damaged" in str(error)
                refused += 1
            else:  # a byte that no reader looks at
                np.testing.assert_array_equal(again.table, whole.table)
    assert refused >= len(data) // 97
