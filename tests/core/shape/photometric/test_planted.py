"""Tables planted under alternating least squares come back, and what was drawn otherwise does not pass."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.rig import hemisphere
from pipeline.core.shape.photometric.acls import Decomposition, Options, decompose
from pipeline.core.shape.photometric.recover import as_reflectance, recover
from pipeline.core.shape.photometric.sight import Sight
from pipeline.core.shape.settings import ShapeSettings
from tests import oracles, synthetic, tolerances
from tests.drawn import Drawn

Array = NDArray[Any]
LIGHTS = hemisphere(70)
VIEW = np.array([0.0, 0.0, 1.0])
BALL = synthetic.ball(synthetic.camera(26, "orthographic"))
MASK = BALL.confidence > 0
NORMALS = BALL.normal[MASK].astype(np.float64)
SHARE = 0.5 + 0.5 * np.sin(4 * NORMALS[:, 0] + 2 * NORMALS[:, 1])  # of the first of two materials
MATERIALS = ((np.array([0.6, 0.2, 0.1]), 0.0, 0.5), (np.array([0.05, 0.1, 0.3]), 0.25, 0.5))


def reflected(normal: Array, wi: Array, wo: Array, material: int) -> Array:
    """f cos(theta_i) of a matt and a glossy material."""
    albedo, specular, roughness = MATERIALS[material]
    glossy = oracles.ggx_cosine(normal, wi, wo, roughness)[..., None]
    return albedo * oracles.lambert_cosine(normal, wi, 1.0)[..., None] + specular * glossy


def seen(stated: Array = LIGHTS, strength: Array | float = 1.0, swapped: bool = False) -> Sight:
    """What the ball's pixels see of the lights, which may be stated in other places and of another strength."""
    normal = NORMALS[:, None]
    wi = np.broadcast_to(LIGHTS, (len(NORMALS), *LIGHTS.shape))
    pair = (np.broadcast_to(VIEW, wi.shape), wi) if swapped else (wi, np.broadcast_to(VIEW, wi.shape))
    values = sum(s[:, None, None] * reflected(normal, *pair, k) for k, s in enumerate((SHARE, 1 - SHARE)))
    lit = (oracles.dot(normal, wi) > 0)[..., None]
    values = (np.where(lit, values, 0) * np.broadcast_to(strength, len(LIGHTS))[:, None]).astype(np.float32)
    nowhere = np.zeros(NORMALS.shape)
    return Sight(values, np.ones(values.shape[:2], np.float32), stated, False, nowhere, nowhere + VIEW)


def solved(sight: Sight) -> Decomposition:
    return finish(decompose(sight, Options(bases=2)))


def angles(found: Decomposition) -> Array:
    return np.degrees(np.arccos(np.clip(oracles.dot(found.normals, NORMALS), -1, 1)))


@pytest.fixture(scope="module")
def found() -> Decomposition:
    return solved(seen())


def test_planted_normals_come_back(found: Decomposition) -> None:
    assert np.median(angles(found)) < tolerances.PLANTED_NORMAL
    assert np.quantile(angles(found), 0.95) < 10 * tolerances.PLANTED_NORMAL


def test_planted_tables_come_back(found: Decomposition) -> None:
    """Relative RMS of f cos where the pictures reached the tables, each at the scale that fits best."""
    reflectance = as_reflectance(MASK, found)
    wi = np.broadcast_to(LIGHTS[:, None], (len(LIGHTS), len(NORMALS), 3)).reshape(-1, 3)
    normal = np.tile(NORMALS, (len(LIGHTS), 1))
    wo = np.broadcast_to(VIEW, normal.shape)
    cosine = np.maximum(oracles.dot(normal, wi), 0)[:, None]
    errors = np.ones((2, 2))
    for material in range(2):
        true = reflected(normal, wi, wo, material) * (cosine > 0)
        for basis in range(2):
            weights = np.broadcast_to(np.eye(2)[basis, :, None], (len(normal), 2, 1))
            f, known = reflectance.evaluate(weights, normal, wi, wo)
            guess, wanted = (f * cosine)[known], true[known]
            guess = guess * (guess * wanted).sum() / (guess**2).sum()
            errors[material, basis] = np.sqrt(((guess - wanted) ** 2).sum() / (wanted**2).sum())
    assert min(np.diag(errors).max(), np.diag(errors[::-1]).max()) < tolerances.PLANTED_TABLE
    assert max(np.diag(errors).min(), np.diag(errors[::-1]).min()) > 3 * tolerances.PLANTED_TABLE  # not all alike


def test_light_and_viewer_are_not_alike() -> None:
    """Pictures of f cos(theta_o) are no pictures of f cos(theta_i)."""
    assert np.median(angles(solved(seen(swapped=True)))) > 20 * tolerances.PLANTED_NORMAL


@pytest.mark.parametrize("wrong", ["direction", "strength"])
def test_lights_five_per_cent_wrong_are_noticed(found: Decomposition, wrong: str) -> None:
    moved = oracles.unit(LIGHTS + np.array([0.05, 0, 0]))
    uneven = 1 + 0.05 * (np.arange(len(LIGHTS)) % 2)
    spoilt = solved(seen(moved) if wrong == "direction" else seen(strength=uneven))
    assert np.median(angles(spoilt)) > tolerances.PLANTED_NORMAL
    assert spoilt.objective[-1] > 2 * found.objective[-1]


def test_scale_of_the_pictures_does_not_matter(found: Decomposition) -> None:
    sight = seen()
    bright = solved(dataclasses.replace(sight, values=sight.values * 1024))
    assert np.quantile(np.abs(bright.normals - found.normals), 0.95) < 1e-3


def test_highlight_puts_no_other_light_in_shadow() -> None:
    """A mirror's highlight is a thousand times what the other lights give; they are lit, and the usual value theirs."""
    sight = seen()
    values = np.ones_like(sight.values)
    values[:, :3] = 1000
    bright = dataclasses.replace(sight, values=values)
    assert bright.lit().all()
    assert (bright.scale() == 1).all()
    values[:, 40:] = 0.01
    assert not bright.lit()[:, 40:].any()


def test_capture_keeps_its_mask() -> None:
    """A pixel that no light reaches is left out of the result, not out of the capture."""
    pictures = np.zeros((len(LIGHTS), *MASK.shape, 3), np.float32)
    pictures[:, MASK] = seen().values.transpose(1, 0, 2)
    dark = np.argwhere(MASK)[0]
    pictures[:, dark[0], dark[1]] = 0
    lights = Lights("distant", LIGHTS, np.ones_like(LIGHTS), np.full(len(LIGHTS), 2))
    names = tuple(f"{i}.exr" for i in range(len(LIGHTS)))
    capture = Drawn(Path("drawn"), BALL.camera, lights, names, ("",) * len(names), {}, pictures, MASK.copy())
    shape = finish(recover(capture, ShapeSettings(method="lambertian"))).shape
    assert np.isnan(shape.normal[tuple(dark)]).all()
    assert (capture.mask() == MASK).all()
