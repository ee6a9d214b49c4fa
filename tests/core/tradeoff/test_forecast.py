"""Trials on a part of the pixels foretell what the whole costs and gives, without truth."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.core.capture import Capture
from pipeline.core.compare.shapes import angles_deg
from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights
from pipeline.core.progress import Progress, Work, finish
from pipeline.core.reflectance import ReflectanceSettings
from pipeline.core.reflectance.fit import fit
from pipeline.core.rig import sphere
from pipeline.core.shape.photometric.recover import recover as photometric_stereo
from pipeline.core.shape.settings import ShapeSettings
from pipeline.core.tradeoff import Variant, reflectance
from pipeline.core.tradeoff.excerpt import AROUND, SINGLE, Size, blocks, excerpt
from pipeline.core.tradeoff.forecast import foretold, linear
from pipeline.core.tradeoff.goal import Goal, stated
from pipeline.core.tradeoff.normals import reference
from pipeline.core.tradeoff.shape import blind_errors
from pipeline.core.tradeoff.shape import promised as shape_promised
from tests import oracles, synthetic
from tests.drawn import Drawn, draw, ggx, lambert, solved, two_spheres

BALL = synthetic.ball(synthetic.camera(48))


@pytest.fixture(scope="module")
def capture() -> Drawn:
    return draw(BALL, two_spheres(), ggx)


@pytest.fixture(scope="module")
def noisy(capture: Drawn) -> Drawn:
    """The capture with noise, which errors come from."""
    assert capture.pictures is not None
    noise = np.random.default_rng(1).normal(1.0, 0.03, capture.pictures.shape)
    return dataclasses.replace(capture, pictures=capture.pictures * noise.astype(np.float32))


@pytest.mark.parametrize("size", [SINGLE, AROUND])
def test_an_excerpt_shows_some_pixels_as_they_are_and_no_truth(capture: Drawn, size: Size) -> None:
    found, _ = finish(excerpt(capture, capture.mask(), size))
    shown = found.mask()
    count, total = int(shown.sum()), int(capture.mask().sum())
    assert min(size.fewest, total) <= count < min(size.fewest + size.block**2, total + 1)
    assert not (shown & ~capture.mask()).any()
    for light in (0, 99):
        np.testing.assert_array_equal(found.image(light)[shown], capture.image(light)[shown])
        assert not found.image(light)[~shown].any()
    assert found.truth() is None
    chosen = np.array([3, 70, 99])
    np.testing.assert_array_equal(found.select(chosen).image(1), found.image(70))
    assert found.reads == [0, 0, 99, 99, 1, 70]  # whatever was made from it opens its pictures, too
    smaller = found.smaller()
    assert 0 < smaller.mask().sum() <= count / 4 + size.block**2
    assert not (smaller.mask() & ~shown).any()
    np.testing.assert_array_equal(smaller.image(5)[smaller.mask()], capture.image(5)[smaller.mask()])


def test_blocks_are_spread_over_all_pixels() -> None:
    pixels = np.ones((60, 90), bool)
    found = blocks(pixels, 600, 6)
    quarters = [found[i : i + 30, j : j + 45].sum() for i in (0, 30) for j in (0, 45)]
    assert 600 <= found.sum() < 636
    assert min(quarters) > 0.5 * 600 / 4
    assert blocks(pixels, pixels.size, 6).all()
    assert blocks(np.eye(40, dtype=bool), 10, 6).sum() >= 10


def test_time_is_linear_in_pixels() -> None:
    assert linear((2.0, 3.0), (100, 200), 1000) == pytest.approx(11.0)
    assert linear((2.0, 3.0), (100, 200), 200) == pytest.approx(3.0)
    assert linear((3.0, 2.0), (100, 200), 1000) == pytest.approx(2.0)  # noise of the clock
    assert linear((3.0, 3.0), (100, 100), 100) == pytest.approx(3.0)


def pretended(errors: dict[float, float], done: list[float], opened: int = 0) -> Callable[[Capture], list[Variant]]:
    """Return settings by weight, whose errors are known; those of an infinite error raise."""

    def variants(part: Capture) -> list[Variant]:
        def work(weight: float) -> Work[float]:
            done.append(weight)
            for light in range(opened):
                part.image(light)
            if np.isinf(errors[weight]):
                raise LightsphereError(f"{weight:g} does not work")
            yield Progress("", 1, 1)
            return errors[weight]

        def judge(error: float) -> dict[str, float]:
            return {"relight_rel_rmse": error}

        return [Variant(f"{w:g}", {"samples": w}, w, partial(work, w), judge) for w in errors]

    return variants


def promised(capture: Drawn, errors: dict[float, float], goal: Goal) -> tuple[str, NDArray[np.float64]]:
    done: list[float] = []
    found = finish(foretold(pretended(errors, done), capture, capture.mask(), goal))
    return found.expected.label, np.array(done)


def test_the_lightest_are_tried_first_and_no_more_than_needed(capture: Drawn) -> None:
    label, done = promised(capture, {30.0: 0.01, 1.0: 0.5, 10.0: 0.04}, Goal(None, 5.0))
    assert label == "10"
    assert done.tolist() == [1, 1, 1, 10, 10]  # the first once more, uncounted
    label, done = promised(capture, {30.0: 0.01, 1.0: 0.5, 10.0: 0.04}, Goal(1000.0, None))
    assert label == "30"


def test_settings_that_do_not_work_are_passed_over(capture: Drawn) -> None:
    assert promised(capture, {1.0: np.inf, 10.0: 0.04}, Goal(None, 5.0))[0] == "10"
    with pytest.raises(LightsphereError, match="10 does not work"):
        promised(capture, {1.0: np.inf, 10.0: np.inf}, Goal(None, 5.0))


def test_shape_gives_about_the_error_that_was_promised(noisy: Drawn) -> None:
    """Of pixels that were not tried, and without truth."""
    settings = ShapeSettings()
    found, judged = finish(shape_promised(noisy, settings, Goal(None, 1e-9)))
    assert found.expected.settings["pictures"] == 100
    assert "no settings are expected to reach" in found.lacks
    obtained = judged(solved(noisy))["depth_expected_pct"]
    assert obtained == blind_errors(solved(noisy), noisy)["depth_expected_pct"]
    assert 1 / 1.5 < stated(found.expected) / obtained < 1.5


def test_reflectance_gives_about_the_error_that_was_promised(noisy: Drawn) -> None:
    settings = ReflectanceSettings()

    def variants(part: Capture) -> list[Variant]:
        return reflectance.variants(BALL.within(part.mask()), part, settings)

    found = finish(foretold(variants, noisy, noisy.mask(), Goal(None, 50.0)))
    assert found.expected.settings == {"model": "ggx", "clusters": 1}
    whole = finish(fit(BALL, noisy, ReflectanceSettings(model="ggx", clusters=1)))
    assert whole.notes["material_rel_rms"] > 0.01
    assert 1 / 1.5 < stated(found.expected) / (100 * whole.notes["material_rel_rms"]) < 1.5


@pytest.fixture(scope="module")
def distant() -> Drawn:
    """A glossy ball under distant lights, with noise."""
    towards = sphere(60)
    towards = towards[towards[:, 1] < -0.2]
    lights = Lights("distant", towards, np.ones((len(towards), 3)), np.zeros(len(towards), int))
    drawn = draw(BALL, lights, ggx)
    assert drawn.pictures is not None
    noise = np.random.default_rng(2).normal(1.0, 0.01, drawn.pictures.shape)
    return dataclasses.replace(drawn, pictures=drawn.pictures * noise.astype(np.float32))


@pytest.mark.parametrize("method", [pytest.param("acls", marks=pytest.mark.slow), "lambertian"])
def test_normals_are_about_as_far_off_as_was_promised(distant: Drawn, method: str) -> None:
    """By angles to the richest settings, which know nothing of the truth; a Lambertian fit of a glossy ball is off."""
    settings = ShapeSettings(method=method)
    found, judged = finish(shape_promised(distant, settings, Goal(None, 1e-9)))
    assert found.expected.error == "normal_expected_deg"
    assert found.expected.settings["pictures"] == len(distant)
    chosen = {name: found.expected.settings[name] for name in ("pictures", "bases") if name in found.expected.settings}
    whole = finish(photometric_stereo(distant, dataclasses.replace(settings, **chosen))).shape
    obtained = judged(whole)["normal_expected_deg"]
    assert 1 / 1.5 < stated(found.expected) / obtained < 1.5
    mask = whole.confidence > 0
    true = float(np.median(angles_deg(whole.normal[mask].astype(np.float64), BALL.normal[mask].astype(np.float64))))
    assert 1 / 3 < obtained / true < 3
    assert (true > 1) == (method == "lambertian")


def test_a_tilt_of_all_normals_is_expected_where_it_is(distant: Drawn) -> None:
    large, _ = finish(excerpt(distant, distant.mask(), SINGLE))
    best = finish(reference(large))
    turned = Rotation.from_rotvec([0.0, 0.0, np.radians(20)]).as_matrix()
    tilted = dataclasses.replace(BALL, normal=(BALL.normal.astype(np.float64) @ turned.T).astype(np.float32))
    straight, off = (best.errors(one)["normal_expected_deg"] for one in (BALL, tilted))
    assert straight < 1
    assert 10 < off < 20  # less near the axis


def test_unknown_lights_are_refused(capture: Drawn) -> None:
    with pytest.raises(LightsphereError, match="do not serve the method uncalibrated"):
        finish(shape_promised(capture, ShapeSettings(method="uncalibrated"), Goal(None, 1.0)))


@pytest.mark.slow
def test_normals_under_distant_lights_are_judged_by_lights_held_out() -> None:
    """Without truth: those of the ball explain pictures that no fit saw, those of a wrong ball do not."""
    directions = oracles.unit(np.array([[np.cos(a) * r, np.sin(a) * r, 1.0] for r in (0.4, 0.9) for a in range(12)]))
    lights = Lights("distant", directions, np.full((24, 3), np.pi), np.full(24, 2))
    small = synthetic.ball(synthetic.camera(14))
    drawn = draw(small, lights, lambert)
    right = blind_errors(small, drawn)
    wrong = blind_errors(dataclasses.replace(small, normal=small.normal[:, ::-1]), drawn)
    assert right["recovered_pct"] == wrong["recovered_pct"] == 100
    assert right["material_rel_rms"] < 0.05 < 4 * right["material_rel_rms"] + 0.1 < wrong["material_rel_rms"]
