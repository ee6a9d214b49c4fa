"""Two pictures in one: which is where, and that their difference is told in per cent."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.report import beside

GENERATOR = np.random.default_rng(5)
REFERENCE = GENERATOR.uniform(0.1, 0.8, (20, 30, 3)).astype(np.float32)
PICTURE = (1.1 * REFERENCE).astype(np.float32)


def test_the_line_parts_reference_and_picture() -> None:
    alone, whole = beside.split(PICTURE, REFERENCE, 0.0), beside.split(PICTURE, REFERENCE, 1.0)
    assert not np.allclose(alone, whole)
    both = beside.split(PICTURE, REFERENCE, 0.5)
    np.testing.assert_array_equal(both[:, :15], whole[:, :15])
    np.testing.assert_array_equal(both[:, 16:], alone[:, 16:])
    assert (both[:, 15] == 1).all()
    assert (alone >= whole).all()  # one exposure for both: the picture is the brighter one


def test_side_by_side_holds_both_whole() -> None:
    both = beside.side_by_side(PICTURE, REFERENCE)
    np.testing.assert_array_equal(both[:, :30], beside.split(PICTURE, REFERENCE, 1.0))
    np.testing.assert_array_equal(both[:, -30:], beside.split(PICTURE, REFERENCE, 0.0))


def test_the_difference_is_in_per_cent_of_the_reference() -> None:
    grey = np.full((4, 4, 3), 0.5, np.float32)
    grey[0, 0] = 0.0
    wrong = grey.copy()
    wrong[2, 2] *= 1.2
    found = beside.percent(wrong, grey)
    assert np.isnan(found[0, 0])
    rms = 0.5 * np.sqrt(15 / 16)
    assert found[2, 2] == pytest.approx(100 * 0.1 / rms, rel=1e-5)
    assert found[1, 1] == 0


def test_its_map_is_a_picture_with_a_scale() -> None:
    drawn = beside.difference(PICTURE, REFERENCE)
    assert drawn.shape[2] == 3 and drawn.shape[0] > 200
    assert drawn.min() >= 0 and drawn.max() <= 1 and drawn.std() > 0.05
