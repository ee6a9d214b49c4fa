"""The source's alternation: no step raises its sum, and each finds what it looks for where all else is true."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.brdf.parametric import TorranceSparrow
from pipeline.core.compare.shapes import angles_deg
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from pipeline.core.shape.settings import ShapeSettings
from pipeline.core.shape.uncalibrated.pictures import Pictures
from pipeline.core.shape.uncalibrated.recover import Recovered, recover
from pipeline.core.shape.uncalibrated.source.lights import strengthen, turn
from pipeline.core.shape.uncalibrated.source.lobe import tables
from pipeline.core.shape.uncalibrated.source.materials import fit, project, split
from pipeline.core.shape.uncalibrated.source.solve import ANGLES, alternate, turn_normals
from pipeline.core.shape.uncalibrated.source.state import State
from pipeline.core.shape.uncalibrated.source.surface import triangulated
from tests import oracles, synthetic, tolerances
from tests.core.shape.test_uncalibrated import COUNT, lamps, photographed, view

Array = NDArray[Any]
LOBES = {0.12: [0.5, 0.3, 0.1], 0.35: [0.2, 0.3, 0.5]}  # width [rad] and tint of each half of the ball


def in_frames(normals: Array, vectors: Array) -> Array:
    """Directions (N, 3) in frames whose z axis are the normals."""
    across = oracles.unit(np.cross([0.1, 1.0, 0.2], normals))
    return np.stack([oracles.dot(v, vectors) for v in (across, np.cross(normals, across), normals)], axis=-1)


def true_state(model: str = "pinhole", lobes: int = 2) -> State:
    """A ball, brown and blue in turn, each with its lobe, as it is, with what it shows by the parametric model."""
    camera = synthetic.camera(40, model)
    ball = synthetic.ball(camera)
    mask = np.isfinite(ball.depth)
    normals = ball.normal[mask].astype(np.float64)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    unlit = Pictures(mask, camera, np.zeros((len(normals), COUNT, 3)), np.ones((len(normals), COUNT)), 1e-3)
    half, lobe = np.arange(len(normals)) % 2, np.arange(len(normals)) % lobes
    albedo = np.array([[0.5, 0.3, 0.2], [0.1, 0.2, 0.4]])[half]
    values = np.zeros_like(unlit.values)
    lights, strengths = lamps(), 1 + 0.2 * np.cos(1.7 * np.arange(COUNT))
    strengths /= np.exp(np.log(strengths).mean())
    for k, direction in enumerate(lights.position):
        wi = in_frames(normals, np.broadcast_to(direction, normals.shape))
        wo = in_frames(normals, unlit.views)
        for number, (width, tint) in enumerate(LOBES.items()):
            f = TorranceSparrow(np.zeros(3), np.array(tint), width).evaluate(wi, wo)
            shown = (albedo + f) * np.maximum(wi[:, 2:], 0.0) * strengths[k]
            values[:, k] = np.where((lobe == number)[:, None], shown, values[:, k])
    pictures = dataclasses.replace(unlit, values=values)
    depth = ball.depth[mask].astype(np.float64)
    return State(
        pictures=pictures,
        surface=triangulated(pictures, 0.0),
        highlights=np.zeros((len(normals), COUNT)),
        scatter=0.2,
        held=np.zeros(COUNT, bool),
        normals=normals,
        albedo=albedo,
        unknown=np.log(depth) if model == "pinhole" else depth,
        directions=lights.position,
        strengths=strengths,
        weights=np.eye(lobes)[lobe],
        tints=np.array(list(LOBES.values()))[:lobes],
        widths=np.array(list(LOBES))[:lobes],
    )


@pytest.fixture(scope="module")
def found() -> Recovered:
    settings = ShapeSettings(method="uncalibrated", objective="source")
    return finish(recover(photographed(view(40, 30), lamps()), settings))


def test_no_step_raises_the_sum() -> None:
    """From lights and normals that are off, and no material; a sum that is pushed up in between is seen to rise."""
    state = true_state()
    state.directions = oracles.unit(state.directions + 0.1 * np.sin(np.arange(3 * COUNT)).reshape(COUNT, 3))
    state.normals = oracles.unit(state.normals + 0.1 * np.cos(np.arange(state.normals.size)).reshape(-1, 3))
    state.weights, state.tints, state.widths = np.zeros((len(state.normals), 0)), np.zeros((0, 3)), np.zeros(0)
    work = alternate(state, 2)
    for _ in range(4):
        next(work)
    sums = np.array([after for _, after in state.course])
    assert {step for step, _ in state.course} == {"start", "surface", "normals", "albedo", "lights", "materials"}
    assert (np.diff(sums) <= 1e-9 * sums[:-1]).all()
    assert sums[-1] < 0.2 * sums[0]
    state.strengths = 1.1 * state.strengths
    state.noted("pushed")
    assert state.course[-1][1] > sums[-1]


@pytest.mark.slow
def test_its_lights_are_as_far_off_as_stated_and_farther_than_those_of_all_at_once(found: Recovered) -> None:
    off = angles_deg(found.lights.position, lamps().position).mean()
    assert tolerances.UNKNOWN_LIGHTS < off < 2 * found.deviation.mean()
    assert found.doubts
    assert all(fall >= 0 for fall in found.shape.notes["steps"].values())


def test_the_truth_shows_the_pictures() -> None:
    """The kernel's lobe is that of the parametric model; another width is not."""
    state = true_state()
    assert np.abs(state.shown(*state.parts()) - state.pictures.values).max() < tolerances.CLOSED_FORM
    wider = dataclasses.replace(state, widths=1.1 * state.widths)
    assert np.abs(wider.shown(*wider.parts()) - state.pictures.values).max() > 100 * tolerances.CLOSED_FORM


def test_the_tables_show_what_the_kernel_does() -> None:
    """From above under a light from above the lobe is a quarter, and the Lambertian basis 1 / pi."""
    table = tables(np.array([0.2]))
    assert np.abs(table[0, 0, :, 0] - [1 / np.pi, 0.25]).max() < tolerances.CLOSED_FORM


def test_materials_are_split_fitted_and_projected() -> None:
    state = true_state()
    state.weights, state.tints, state.widths = np.zeros((len(state.normals), 0)), np.zeros((0, 3)), np.zeros(0)
    state.albedo = np.full_like(state.albedo, 0.3)
    for _ in LOBES:
        split(state)
    for _ in range(20):
        fit(state)
        project(state)
        state.levelled()
    order = np.argsort(state.widths)
    assert np.abs(state.widths[order] / list(LOBES) - 1).max() < tolerances.SPLIT_WIDTHS
    owner = state.weights[:, order].argmax(axis=1)
    facing = oracles.dot(state.normals, state.pictures.views) > 0.5
    assert (owner == np.arange(len(owner)) % 2)[facing].mean() > tolerances.SPLIT_OWNED
    assert len(state.widths) == len(LOBES)


def test_a_single_material_is_not_split() -> None:
    state = true_state(lobes=1)
    split(state)
    assert len(state.widths) == 1


def test_lights_come_back_where_all_else_is_true() -> None:
    state = true_state()
    true, strengths = state.directions, state.strengths
    state.directions = oracles.unit(true + 0.08 * np.sin(np.arange(3 * COUNT)).reshape(COUNT, 3))
    state.strengths = np.ones(COUNT)
    state.held[0] = True
    before = state.directions
    for _ in range(20):
        turn(state)
        strengthen(state)
    assert angles_deg(state.directions[1:], true[1:]).max() < tolerances.TURNED_LIGHTS
    assert np.abs(state.strengths[1:] / strengths[1:] - 1).max() < tolerances.TURNED_STRENGTHS
    assert (state.directions[0] == before[0]).all()


def test_normals_come_back_where_all_else_is_true() -> None:
    state = true_state()
    true = state.normals
    state.normals = oracles.unit(true + 0.1 * np.sin(np.arange(true.size)).reshape(true.shape))
    facing = oracles.dot(true, state.pictures.views) > 0.3
    off = angles_deg(state.normals, true)[facing]
    for _ in range(3):
        for angle in ANGLES:
            turn_normals(state, angle)
    assert np.median(angles_deg(state.normals, true)[facing]) < tolerances.SEARCHED_NORMALS < np.median(off)


@pytest.mark.parametrize("model", ["pinhole", "orthographic"])
def test_the_surface_is_the_one_of_its_normals(model: str) -> None:
    state = true_state(model=model)
    true = state.unknown
    flat = np.full_like(true, true.mean())
    laid = flat
    for _ in range(10):
        laid = state.surface.fitted(laid, state.normals)
    unit = 1.0 if model == "orthographic" else 1.0 / 5.0
    off = (laid - laid.mean() - (true - true.mean())) / (synthetic.RADIUS * unit)
    assert np.sqrt((off**2).mean()) < tolerances.LAID_SURFACE
    assert np.sqrt(((true - true.mean()) ** 2).mean()) / (synthetic.RADIUS * unit) > 3 * tolerances.LAID_SURFACE


@pytest.mark.parametrize("other", [{"lamps": "near"}, {"cues": "outline"}])
def test_what_it_does_not_have_is_refused(other: dict[str, str]) -> None:
    settings = ShapeSettings(method="uncalibrated", objective="source", **other)  # type: ignore[arg-type]
    with pytest.raises(LightsphereError, match=f"--{next(iter(other))}"):
        finish(recover(photographed(view(40, 30), lamps()), settings))
