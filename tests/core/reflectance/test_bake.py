"""Baking on a sheet whose texture space is known: every texel finds its pixel, and nothing bleeds over depth edges."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.camera import Camera
from pipeline.core.errors import LightsphereError
from pipeline.core.reflectance.bake import bake, rasterise, texture_size
from pipeline.core.shape.scan import Scan
from tests import synthetic

SIZE = 32
UNIT = np.array([[[0.0, 0], [1, 0], [1, 1]], [[0.0, 0], [1, 1], [0, 1]]])


def sheet(low: float = -1.0, high: float = 1.0, z: float = 0.0, uv: NDArray[np.float64] = UNIT) -> Scan:
    """A square sheet across the view, x and y from low to high, whose UVs are its unit square."""
    corners = np.concatenate([low + (high - low) * UNIT, np.full((2, 3, 1), z)], axis=-1)
    return Scan(corners, np.broadcast_to([0.0, 0, 1], (2, 3, 3)).copy(), uv, np.zeros(2, np.int64))


def view() -> Camera:
    return synthetic.camera(SIZE, "orthographic")


def ramps() -> NDArray[np.float32]:
    """Maps that grow to the right and downwards, in units of the picture."""
    along = ((np.arange(SIZE) + 0.5) / SIZE).astype(np.float32)
    return np.stack(np.broadcast_arrays(along[None, :], along[:, None]), axis=-1)


def everything(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.ones(len(points), bool)


def test_two_triangles_cover_their_square_once() -> None:
    face, weights = rasterise(UNIT, 8)
    assert (face >= 0).all()
    np.testing.assert_allclose(weights.sum(axis=-1), 1)
    uv = (weights[..., None] * UNIT[face]).sum(axis=-2)
    centres = (np.arange(8) + 0.5) / 8
    np.testing.assert_allclose(uv[..., 0], np.broadcast_to(centres, (8, 8)))
    np.testing.assert_allclose(uv[..., 1], np.broadcast_to(1 - centres[:, None], (8, 8)))


def test_outside_the_unit_square_the_texture_repeats() -> None:
    face, weights = rasterise(UNIT, 8)
    for moved in (
        rasterise(UNIT + np.array([3, -2]), 8),
        rasterise(UNIT[:, ::-1], 8),
    ):  # another tile; seen from behind
        assert np.array_equal(moved[0] >= 0, face >= 0)
    np.testing.assert_allclose(rasterise(UNIT + np.array([3, -2]), 8)[1], weights, atol=1e-12)
    with pytest.raises(LightsphereError, match="repeat"):
        rasterise(3 * UNIT, 8)


def test_many_small_triangles_in_blocks_and_degenerate_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = np.stack(np.meshgrid(np.arange(6), np.arange(6)), axis=-1).reshape(-1, 1, 1, 2)
    small = ((UNIT[None] + grid) / 6).reshape(-1, 3, 2)
    whole = np.concatenate([np.zeros((3, 3, 2)), small, np.zeros((2, 3, 2))])
    expected = rasterise(whole, 50)
    assert (expected[0] >= 3).all() and (expected[0] < 75).all()
    monkeypatch.setattr("pipeline.core.reflectance.bake.CANDIDATES", 100)
    np.testing.assert_array_equal(rasterise(whole, 50)[0], expected[0])


def test_a_sheet_that_fills_the_view_is_its_picture() -> None:
    shape = synthetic.plane(view(), np.array([0.0, 0.0, 1.0]))
    texture, confidence = bake(ramps(), shape, sheet(), SIZE, everything)
    np.testing.assert_allclose(texture, ramps(), atol=1e-5)
    np.testing.assert_allclose(confidence, 1, atol=1e-5)
    finer, sure = bake(ramps(), shape, sheet(), 2 * SIZE, everything)
    inner = slice(1, -1)  # beyond the outermost pixel centres there is nothing to interpolate to
    np.testing.assert_allclose(
        finer[inner, inner, 0], np.broadcast_to(((np.arange(64) + 0.5) / 64)[inner], (62, 62)), atol=1e-5
    )
    assert sure[0, 0] < 1
    mirrored = sheet(uv=UNIT * [-1, 1] + [1, 0])
    texture, _ = bake(ramps(), shape, mirrored, SIZE, everything)
    np.testing.assert_allclose(texture, ramps()[:, ::-1], atol=1e-5)


def test_density_sets_the_size() -> None:
    scan = sheet()
    face = np.repeat([0, 1], 512)  # 32 x 32 pixels on the whole square
    assert texture_size(scan, face) == 64
    assert texture_size(sheet(uv=UNIT / 4), face) == 256
    assert texture_size(scan, face[:0]) == 16


def test_what_the_camera_does_not_see_is_marked_and_filled_from_beside() -> None:
    shape = synthetic.plane(view(), np.array([0.0, 0.0, 1.0]))
    left = lambda points: points[:, 0] < 0  # noqa: E731
    texture, confidence = bake(ramps(), shape, sheet(), SIZE, left)
    assert (confidence[:, : SIZE // 2] > 0.99).all() and (confidence[:, SIZE // 2 :] == 0).all()
    np.testing.assert_allclose(texture[:, SIZE // 2 :, 0], ramps()[0, SIZE // 2 - 1, 0], atol=1e-5)
    _, confidence = bake(ramps(), shape, sheet(0.0, 2.0), SIZE, lambda points: (points[:, :2] < 1).all(axis=-1))
    assert (confidence[: SIZE // 2] == 0).all() and (confidence[SIZE // 2 + 1 :, : SIZE // 2 - 1] > 0.99).all()
    with pytest.raises(LightsphereError, match="show nothing"):
        bake(ramps(), shape, sheet(), SIZE, lambda points: np.zeros(len(points), bool))


def test_pixels_of_another_surface_are_not_mixed_in() -> None:
    shape = synthetic.step(view(), 0.5)  # the right half is nearer
    maps = np.where(np.arange(SIZE)[None, :, None] < SIZE // 2, 0.2, 0.9) * np.ones((SIZE, SIZE, 1))
    texture, confidence = bake(maps.astype(np.float32), shape, sheet(), 4 * SIZE, lambda points: points[:, 0] < 0)
    seen = confidence > 0
    assert seen[:, : 2 * SIZE].all() and not seen[:, 2 * SIZE :].any()
    np.testing.assert_allclose(texture[seen], 0.2, rtol=1e-6)  # bilinear lookup alone would give up to 0.55


def test_unknown_pixels_lower_the_confidence() -> None:
    shape = synthetic.plane(view(), np.array([0.0, 0.0, 1.0]))
    maps = ramps()
    maps[10:14, 10:14] = np.nan
    texture, confidence = bake(maps, shape, sheet(), SIZE, everything)
    assert np.isfinite(texture).all() and (confidence[10:14, 10:14] < 1e-5).all() and confidence[8, 8] > 0.99
