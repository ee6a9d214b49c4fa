"""Planted lights come back from spheres drawn in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.core.errors import LightsphereError
from pipeline.core.photographs import outlines, spheres
from pipeline.core.photographs.outlines import Circle
from tests import photographed as drawn

LIGHTS = drawn.directions()
BALL = Circle(drawn.X, drawn.Y, drawn.RADIUS)
ASKED = 0.5  # [degrees]


MIRROR = Circle(drawn.MIRROR["x"], drawn.MIRROR["y"], drawn.MIRROR["radius"])


def mask(**ball: Any) -> np.ndarray:
    return np.isfinite(drawn.normals(**ball)[..., 0])


def test_a_mirror_gives_the_planted_directions() -> None:
    pictures = np.clip(drawn.mirror(LIGHTS), 0, 1)  # the lamps are saturated
    found, doubtful = spheres.mirrored(drawn.colours(pictures), outlines.outline(mask(**drawn.MIRROR)))
    assert drawn.angles(found, LIGHTS).max() < ASKED
    assert not doubtful.any()


@pytest.mark.parametrize("axis", [1, 2])
def test_a_flipped_picture_does_not(axis: int) -> None:
    pictures = np.flip(drawn.mirror(LIGHTS), axis)
    found, _ = spheres.mirrored(drawn.colours(pictures), outlines.outline(np.flip(mask(**drawn.MIRROR), axis - 1)))
    assert drawn.angles(found, LIGHTS).mean() > 20 * ASKED


def test_a_sphere_of_which_a_part_is_out_of_the_picture_or_hidden_is_enough() -> None:
    pictures, cut = drawn.mirror(LIGHTS)[:, :140, 40:], mask(**drawn.MIRROR)[:140, 40:].copy()
    cut[120:, 50:80] = False  # a stand before it
    circle = outlines.outline(cut)
    assert np.hypot(circle.x + 40 - MIRROR.x, circle.y - MIRROR.y) < 0.2
    seen = [i for i, picture in enumerate(pictures) if picture.max() > 2]
    assert len(seen) > 8
    found, _ = spheres.mirrored(drawn.colours(pictures[seen]), circle)
    assert drawn.angles(found, LIGHTS[seen]).max() < ASKED


def test_a_second_highlight_as_large_is_called_doubtful() -> None:
    both = drawn.mirror(LIGHTS) + drawn.mirror(LIGHTS * [-1, -1, 1])
    assert spheres.mirrored(drawn.colours(both), MIRROR)[1].sum() >= len(LIGHTS) - 1


def test_a_mirror_without_highlight_is_told() -> None:
    pictures = drawn.mirror(LIGHTS)
    pictures[3] = np.median(pictures, axis=0)
    with pytest.raises(LightsphereError, match="picture 4 of the mirror sphere shows no highlight"):
        spheres.mirrored(drawn.colours(pictures), MIRROR)


def test_a_gray_sphere_gives_directions_and_irradiances() -> None:
    rng = np.random.default_rng(2)
    power = rng.uniform(0.5, 1.5, (len(LIGHTS), 3))
    pictures = 0.9 * drawn.colours(drawn.lambert(LIGHTS)) * power[:, None, None].astype(np.float32)
    pictures = np.clip(pictures + rng.normal(0, 0.01, pictures.shape), 0, 1).astype(np.float32)  # clipped, too
    found = spheres.shaded(pictures, BALL, 1.0)
    assert drawn.angles(found, LIGHTS).max() < ASKED
    irradiance, error = spheres.irradiance(pictures, BALL, found, 1.0)
    assert irradiance.mean() == pytest.approx(np.pi)
    np.testing.assert_allclose(irradiance / power, np.mean(irradiance / power), rtol=0.01)
    assert error < 3


def test_wrong_directions_predict_a_gray_sphere_worse() -> None:
    pictures = drawn.colours(drawn.lambert(LIGHTS))
    turn = np.radians(5)
    wrong = LIGHTS @ np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    right, off = (spheres.irradiance(pictures, BALL, d, 1.0)[1] for d in (LIGHTS, wrong))
    assert right < 0.01 and off > 3


@pytest.mark.parametrize("picture", [np.zeros, np.ones])
def test_a_gray_sphere_that_shows_nothing_is_told(picture: object) -> None:
    pictures = drawn.colours(drawn.lambert(LIGHTS))
    pictures[2] = picture(pictures.shape[1:])  # type: ignore[operator]
    with pytest.raises(LightsphereError, match="picture 3 of the gray sphere is black or saturated"):
        spheres.shaded(pictures, BALL, 1.0)


def test_the_outline_of_a_mask_is_found_within_a_tenth_of_a_pixel() -> None:
    found = outlines.outline(mask())
    assert np.abs([found.x - drawn.X, found.y - drawn.Y, found.radius - drawn.RADIUS]).max() < 0.1


def test_a_mask_that_is_no_disk_is_refused() -> None:
    square = np.zeros((60, 60), np.bool_)
    square[10:50, 5:55] = True
    with pytest.raises(LightsphereError, match="not a circle"):
        outlines.outline(square)
    with pytest.raises(LightsphereError, match="empty or too small"):
        outlines.outline(np.zeros((60, 60), np.bool_))


def test_a_sphere_is_found_without_a_mask() -> None:
    rng = np.random.default_rng(4)
    picture = drawn.lambert(LIGHTS).max(axis=0) + rng.uniform(0, 0.05, (drawn.SIZE, drawn.SIZE))
    picture[70:, 5:30] += 0.5  # something else beside it
    found = outlines.sought(picture)
    assert np.abs([found.x - drawn.X, found.y - drawn.Y, found.radius - drawn.RADIUS]).max() < 1
    with pytest.raises(LightsphereError, match="no sphere stands out"):
        outlines.sought(rng.uniform(0, 1, picture.shape))
