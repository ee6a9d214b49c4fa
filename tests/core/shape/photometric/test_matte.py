"""Where a matte surface explains the pictures, its normals are kept, with a deviation that is their error."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.rig import hemisphere
from pipeline.core.shape.photometric import lambertian, matte
from pipeline.core.shape.photometric.sight import Sight, see
from tests import drawn, oracles, synthetic

BALL = synthetic.ball(synthetic.camera(24, "orthographic"))
MASK = np.isfinite(BALL.depth)
LIGHTS = Lights("distant", hemisphere(60)[:30], np.full((30, 3), np.pi), np.full(30, 2))


def seen(reflect: drawn.Reflect, noise: float, shadow: bool = False) -> Sight:
    capture = drawn.draw(BALL, LIGHTS, reflect)
    assert capture.pictures is not None
    pictures = capture.pictures
    if shadow:
        pictures[:8, 6:12, 6:18] = 0.0
    random = np.random.default_rng(0).standard_normal(pictures.shape)
    pictures += (noise * pictures.max() * random).astype(np.float32)
    return finish(see(capture, MASK))


@pytest.mark.parametrize("noise", [0.0, 1e-4, 0.01])
def test_noise_on_a_matte_surface_is_known_for_what_it_is(noise: float) -> None:
    sight = seen(drawn.lambert, noise)
    b = lambertian.robust(sight)
    found = matte.deviation(sight, b, MASK)
    assert found is not None
    if noise:
        off = np.linalg.norm(oracles.unit(b) - BALL.normal[MASK], axis=1)
        assert 0.8 < np.sqrt(np.mean(off**2) / np.mean(found**2)) < 1.25
        dimmed = np.sqrt(np.mean((off / 2) ** 2) / np.mean(found**2))
        assert not 0.8 < dimmed < 1.25


@pytest.mark.parametrize("noise", [0.0, 1e-4, 0.003])
def test_highlights_are_not_taken_for_noise(noise: float) -> None:
    sight = seen(drawn.ggx, noise)
    assert matte.deviation(sight, lambertian.robust(sight), MASK) is None


def test_cast_shadows_are_not_taken_for_noise() -> None:
    sight = seen(drawn.lambert, 0.003, shadow=True)
    assert matte.deviation(sight, lambertian.robust(sight), MASK) is None


def test_few_or_unknown_pixels_tell_nothing() -> None:
    sight = seen(drawn.lambert, 0.01)
    b = lambertian.robust(sight)
    single = np.zeros(MASK.shape, bool)
    single[12, 12] = True
    assert matte.deviation(sight.select(single[MASK]), b[single[MASK]], single) is None
    b[5] = np.nan
    assert matte.deviation(sight, b, MASK) is None


def test_neighbours_lie_beside_or_below_each_other() -> None:
    p, q = matte.neighbours(np.array([[True, True, False], [False, True, True]]))
    assert sorted(zip(p.tolist(), q.tolist(), strict=True)) == [(0, 1), (1, 2), (2, 3)]
