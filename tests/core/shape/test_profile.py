"""The objective of a pixel against its depth: least where the surface is, by both objectives."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.capture import Capture
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from pipeline.core.shape.profile import Profile, profile
from pipeline.core.shape.settings import ShapeSettings
from tests import synthetic

ROW, COLUMN = 9, 6
BALL = synthetic.ball(synthetic.camera(18))


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    shades = np.full(3, 0.5)
    return synthetic.write_capture(tmp_path_factory.mktemp("ball"), BALL, shades, 0.2 * shades, 0.4)


@pytest.fixture(scope="module")
def found(capture: Capture) -> Profile:
    return finish(profile(capture, ROW, COLUMN, ShapeSettings()))


def test_it_is_least_at_the_true_depth(found: Profile) -> None:
    true = float(BALL.depth[ROW, COLUMN])
    assert found.depth == pytest.approx(true, rel=1e-4)
    assert found.depths[np.argmin(found.joint)] == pytest.approx(true, rel=1e-4)
    beside = abs(found.depths - true) > 0.02
    assert found.joint[beside].min() > 10 * found.joint.min()


def test_the_source_s_objective_is_coarser(found: Profile) -> None:
    at = int(np.argmin(abs(found.depths - found.depth)))
    assert found.source[at] > 100 * found.joint[at]  # it interpolates between 60 lights


def test_it_covers_the_ray_in_order(found: Profile) -> None:
    assert (np.diff(found.depths) > 0).all()
    assert np.isfinite(found.joint).all()
    assert found.lit >= ShapeSettings().min_lit


def test_a_pixel_beside_the_object_is_refused(capture: Capture) -> None:
    for row, column in ((0, 0), (-1, 5), (10_000, 3)):
        with pytest.raises(LightsphereError, match="does not show the object"):
            finish(profile(capture, row, column, ShapeSettings()))


def test_too_few_lights_are_said(capture: Capture) -> None:
    with pytest.raises(LightsphereError, match="lights reach the pixel"):
        finish(profile(capture, ROW, COLUMN, ShapeSettings(min_lit=900)))
