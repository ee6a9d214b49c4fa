"""Tables on a known shape: planted bivariate materials come back, and lights held out tell when they do not."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core import images
from pipeline.core.capture import Capture
from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.reflectance import ReflectanceSettings, tables
from pipeline.core.reflectance import fit as lobe
from pipeline.core.reflectance.angles import difference_angles
from pipeline.core.reflectance.bivariate import Bivariate
from pipeline.core.rig import hemisphere
from pipeline.core.shape import Shape
from pipeline.core.shape.photometric.known_normals import LEAST_COSINE, Tables
from tests import oracles, synthetic, tolerances

Array = NDArray[Any]
Brdf = Callable[[Array, Array, Array], Array]
MATT = np.array([0.3, 0.1, 0.05])
SIZE = 24
LEFT = np.arange(SIZE) < SIZE // 2
ROUGH = 0.1  # of unit normals


def bivariate(matt: Array, lobes: Sequence[tuple[float, float]], edge: float = 0.0) -> Brdf:
    """f of a matt part and lobes that grow towards grazing light, ``strength D(theta_h) / (4 cos(theta_d)^2 + .2)``.

    ``edge`` is how far Schlick's Fresnel factor rises above 1.
    """

    def f(normal: Array, wi: Array, wo: Array) -> Array:
        half = oracles.unit(wi + wo)
        cos_h, cos_d = oracles.dot(normal, half), oracles.dot(wi, half)
        gloss = sum(s * a**2 / (np.pi * (cos_h**2 * (a**2 - 1) + 1) ** 2) for s, a in lobes)
        return matt / np.pi + (gloss * (1 + edge * (1 - cos_d) ** 5) / (4 * cos_d**2 + 0.2))[..., None]

    return f


COATED = bivariate(MATT, ((0.1, 0.2), (0.25, 0.5)), edge=4.0)  # two lobes and a rise towards grazing light
DULL = bivariate(np.array([0.05, 0.2, 0.4]), ((0.1, 0.4),))


def draw(folder: Path, shape: Shape, brdf: Brdf, lamps: Lights, shadow: Array | None = None) -> Capture:
    """Write pictures of a surface under lights, black where ``shadow`` (L, H, W) says so."""
    points, known = np.nan_to_num(shape.points()), np.isfinite(shape.depth)
    normal = shape.camera.normals_to_world(np.nan_to_num(shape.normal))
    names = []
    for i, place in enumerate(lamps.position):
        reach = place - points if lamps.kind == "near" else np.broadcast_to(place, points.shape)
        to_light = oracles.unit(reach)
        cosine = np.maximum(oracles.dot(normal, to_light), 0)
        received = cosine / (oracles.dot(reach, reach) if lamps.kind == "near" else 1.0)
        picture = brdf(normal, to_light, -shape.camera.rays()[1]) * received[..., None] * lamps.intensity[i]
        lit = known if shadow is None else known & ~shadow[i]
        names.append(f"light_{i:04d}.exr")
        images.write_rgb(folder / names[-1], np.where(lit[..., None], picture, 0).astype(np.float32))
    images.write_channels(folder / "mask.exr", {"mask.V": known.astype(np.float32)})
    return Capture(folder, shape.camera, lamps, tuple(names), ("",) * len(names), {})


def fitted(shape: Shape, capture: Capture, bases: int = 1, **settings: Any) -> Bivariate:
    return finish(tables.fit(shape, capture, ReflectanceSettings(bases=bases, **settings)))


@pytest.fixture(scope="module")
def shape() -> Shape:
    return synthetic.ball(synthetic.camera(SIZE))


@pytest.fixture(scope="module")
def coated(shape: Shape, tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return draw(tmp_path_factory.mktemp("coated"), shape, COATED, synthetic.lights())


@pytest.fixture(scope="module")
def found(shape: Shape, coated: Capture) -> Bivariate:
    return fitted(shape, coated, bases=2)


def test_a_planted_material_comes_back_as_one_basis(shape: Shape, coated: Capture, found: Bivariate) -> None:
    assert found.table.shape[2] == 1
    assert found.notes["held_out_lights"] == 10
    assert found.notes["material_rel_rms"] < tolerances.TABLES_HELD_OUT
    lobes = finish(lobe.fit(shape, coated, ReflectanceSettings()))
    assert lobes.notes["material_rel_rms"] > 3 * tolerances.TABLES_HELD_OUT  # one lobe is no model of it


def test_its_brdf_is_the_planted_one_where_it_was_seen(found: Bivariate) -> None:
    """Any scale may lie in the weights: compared is f / f at one pair of directions."""
    rng = np.random.default_rng(2)
    wi, wo = (oracles.unit(np.abs(rng.normal(size=(4000, 3))) + np.array([0, 0, 0.3])) for _ in range(2))
    up = np.broadcast_to([0.0, 0.0, 1.0], wi.shape)
    value, seen = found.evaluate(np.ones((len(wi), 1, 1)), up, wi, wo)
    assert seen.mean() > 0.5
    value, wanted = value[seen], COATED(up, wi, wo)[seen]
    scale = np.median(wanted / value)
    assert np.quantile(np.abs(scale * value / wanted - 1), 0.9) < tolerances.TABLES_BRDF
    other = DULL(up, wi, wo)[seen]
    assert np.quantile(np.abs(np.median(other / value) * value / other - 1), 0.9) > 3 * tolerances.TABLES_BRDF


def test_the_objective_never_rises_and_tables_keep_the_constraints(found: Bivariate) -> None:
    objective = np.array(found.notes["objective"])
    assert len(objective) > 1 and (np.diff(objective) <= 1e-9 * objective[:-1]).all()
    assert found.table.min() >= 0 and found.weights[np.isfinite(found.weights)].min() >= 0
    assert (np.diff(found.table, axis=0) <= 1e-12 * found.table.max()).all()


def test_two_materials_get_two_bases(shape: Shape, tmp_path: Path) -> None:
    def halves(normal: Array, wi: Array, wo: Array) -> Array:
        return np.where(LEFT[:, None], COATED(normal, wi, wo), DULL(normal, wi, wo))

    capture = draw(tmp_path, shape, halves, synthetic.lights())
    both = fitted(shape, capture, bases=2)
    assert both.table.shape[2] == 2
    assert both.notes["material_rel_rms"] < 2 * tolerances.TABLES_HELD_OUT
    front = shape.normal[..., 2] > 0.5
    leader = np.argmax(np.nan_to_num(both.weights[..., 0]) * both.table.mean(axis=(0, 1, 3)), axis=-1)
    assert set(leader[front & LEFT]).isdisjoint(leader[front & ~LEFT])
    assert fitted(shape, capture).notes["material_rel_rms"] > 2 * both.notes["material_rel_rms"]


def test_a_material_of_few_pixels_keeps_a_basis_on_a_rough_shape(shape: Shape, tmp_path: Path) -> None:
    """What no basis explains, as the normals are off, must not hide what a second one does."""
    spot = (shape.normal[..., 0] > 0.4) & (shape.normal[..., 2] > 0.3)
    assert 0.1 < spot.sum() / np.isfinite(shape.depth).sum() < 0.3

    def spotted(normal: Array, wi: Array, wo: Array) -> Array:
        return np.where(spot[:, :, None], COATED(normal, wi, wo), DULL(normal, wi, wo))

    capture = draw(tmp_path, shape, spotted, synthetic.lights())
    off = np.random.default_rng(7).normal(0, ROUGH, shape.normal.shape)
    rough = dataclasses.replace(shape, normal=oracles.unit(shape.normal + off).astype(np.float32))
    assert fitted(rough, capture, bases=2).table.shape[2] == 2


def test_distant_lights_do_as_well(tmp_path: Path) -> None:
    shape = synthetic.ball(synthetic.camera(SIZE, "orthographic"))
    lamps = Lights("distant", hemisphere(80), np.full((80, 3), 2.0), np.zeros(80, np.int64))
    distant = fitted(shape, draw(tmp_path, shape, COATED, lamps))
    assert distant.notes["material_rel_rms"] < tolerances.TABLES_HELD_OUT


def test_shadows_are_left_out(shape: Shape, tmp_path: Path) -> None:
    shadow = np.random.default_rng(5).uniform(size=(80, SIZE, SIZE)) < 0.2
    shadowed = fitted(shape, draw(tmp_path, shape, COATED, synthetic.lights(), shadow))
    assert shadowed.notes["material_rel_rms"] < 2 * tolerances.TABLES_HELD_OUT


def test_a_wrong_shape_is_told_by_the_lights_held_out(shape: Shape, coated: Capture) -> None:
    flipped = dataclasses.replace(shape, normal=shape.normal * np.float32([-1, 1, 1]))
    assert fitted(flipped, coated).notes["material_rel_rms"] > 5 * tolerances.TABLES_HELD_OUT


def test_light_and_viewer_are_not_alike(shape: Shape, tmp_path: Path) -> None:
    """Pictures of f cos(theta_o) are no pictures of f cos(theta_i)."""

    def swapped(normal: Array, wi: Array, wo: Array) -> Array:
        cosine = np.maximum(oracles.dot(normal, wi), 1e-6)
        return COATED(normal, wi, wo) * (oracles.dot(normal, wo) / cosine)[..., None]

    capture = draw(tmp_path, shape, swapped, synthetic.lights())
    assert fitted(shape, capture).notes["material_rel_rms"] > 2 * tolerances.TABLES_HELD_OUT


def test_brighter_lights_held_out_are_noticed(shape: Shape, coated: Capture, found: Bivariate) -> None:
    """The fit never sees them: 10 % more light in their pictures changes the error and nothing else."""
    intensity = coated.lights.intensity.copy()
    intensity[4::8] /= 1.1
    other = fitted(shape, dataclasses.replace(coated, lights=dataclasses.replace(coated.lights, intensity=intensity)))
    np.testing.assert_array_equal(other.table, found.table)
    assert other.notes["material_rel_rms"] > 0.09 - tolerances.TABLES_HELD_OUT


def test_tiles_take_the_tables_of_some_pixels(shape: Shape, coated: Capture, found: Bivariate) -> None:
    tiled = fitted(shape, coated, memory=1.0)
    assert not np.array_equal(tiled.table, found.table)
    np.testing.assert_array_equal(np.isfinite(tiled.weights), np.isfinite(found.weights))
    assert tiled.notes["material_rel_rms_median"] < tolerances.TABLES_HELD_OUT


@pytest.mark.parametrize("most", [0.5, 7.0, 100.0])
def test_groups_share_out_the_pixels(most: float) -> None:
    known = np.random.default_rng(1).uniform(size=(7, 9)) < 0.6
    groups = tables.interleaved(known, most)
    np.testing.assert_array_equal(np.sum(groups, axis=0), known)  # each once, no other
    assert max(group.sum() for group in groups) <= max(most, 1.0)


def test_fine_tables_are_the_level_ones() -> None:
    rng = np.random.default_rng(4)
    level, seen = rng.uniform(1, 2, (5, 7, 2, 3)), np.ones((5, 7, 2))
    seen[2, 3, 0] = 0
    table, reached = Tables(level, seen, ()).fine()
    cosine = np.maximum(np.cos(difference_angles(table.shape[1])), LEAST_COSINE)
    step = (table.shape[1] - 1) // 6
    np.testing.assert_allclose((table * cosine[:, None, None] ** 2)[:, ::step], level, rtol=1e-12)
    half = (table * cosine[:, None, None] ** 2)[:, step // 2 :: step]
    np.testing.assert_allclose(half, (level[:, 1:] + level[:, :-1]) / 2, rtol=1e-12)
    unseen = np.zeros(reached.shape, bool)
    unseen[2, 2 * step + 1 : 4 * step, 0] = True
    np.testing.assert_array_equal(reached == 0, unseen)


def test_it_is_written_and_read(found: Bivariate, tmp_path: Path) -> None:
    found.save(tmp_path)
    again = Bivariate.open(tmp_path)
    for name in ("table", "seen", "weights", "error"):
        np.testing.assert_array_equal(getattr(again, name), getattr(found, name))
    assert again.notes["material_rel_rms"] == found.notes["material_rel_rms"]


def test_wrong_input_is_named(shape: Shape, coated: Capture) -> None:
    unknown = dataclasses.replace(coated, lights=dataclasses.replace(coated.lights, kind="unknown"))
    with pytest.raises(LightsphereError, match="lights are unknown"):
        fitted(shape, unknown)
    with pytest.raises(LightsphereError, match="resolution"):
        fitted(synthetic.ball(synthetic.camera(20)), coated)
    with pytest.raises(LightsphereError, match="no recovered pixel"):
        fitted(dataclasses.replace(shape, confidence=np.zeros_like(shape.confidence)), coated)
    with pytest.raises(LightsphereError, match="too few to hold some out"):
        fitted(shape, coated, held_out=1000)
