"""The bases of a material: each alone on a ball, and where an asset shows most of each."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Vector
from numpy.typing import NDArray

from pipeline.blender import bases, truth, views
from pipeline.blender.asset import mark
from pipeline.blender.ball import ball_camera, ball_scene, dress
from pipeline.blender.camera import add_camera
from pipeline.blender.geometry import BACKDROP
from pipeline.blender.mixtures import basis_material, group_of, mixture_material, weight_maps
from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights
from pipeline.core.material import STOPS, Mixture
from pipeline.core.material.closures import Lobe
from pipeline.core.material.surface import Surface
from pipeline.core.progress import finish
from tests.blender import small_scenes
from tests.blender.test_compare import ALBEDO, asset, compared, folder

__all__ = ["folder"]  # a fixture
SUN = Lights("distant", np.array([[0.5, -0.8, 0.33]]), np.ones((1, 3)), np.zeros(1, int))


def mixture(bases: int, seed: int = 3) -> Mixture:
    curves = np.random.default_rng(seed).uniform(0.1, 0.5, (bases, 2, len(STOPS), 3))
    return Mixture((Lobe("diffuse"), Lobe("ggx", 0.3)), curves)


def halves(left: int, bases: int, sets: int = 1) -> NDArray[np.float32]:
    """Weights of a map whose left half is one basis, and whose right half is the last."""
    weights = np.full((16, 64, bases, sets), 0.1, np.float32)
    weights[:, :32, left] = 1.0
    weights[:, 32:, -1] = 1.0
    return weights


def picture(material: bpy.types.Material) -> NDArray[np.float32]:
    scene, item = ball_scene()
    again = material()
    dress(item, again)
    return finish(views.under_lights(scene, ball_camera(32), SUN))[0]


@pytest.mark.parametrize("sets", [1, 3])
def test_a_basis_alone_is_what_its_mixture_makes_of_it(sets: int) -> None:
    made = mixture(3)
    tint = np.array([1.0, 0.5, 0.25], np.float32)[:sets]

    def whole() -> bpy.types.Material:
        material = mixture_material("Asset", Surface(made, halves(0, 3, sets) * tint))
        group_of(material).inputs["Specular Scale"].default_value = 0.5
        return material

    def alone(number: int, scale: float = 0.5) -> bpy.types.Material:
        weights = np.zeros((1, 1, 3, sets), np.float32)
        weights[..., number - 1, :] = tint
        material = mixture_material("Alone", Surface(made, weights))
        group_of(material).inputs["Specular Scale"].default_value = scale
        return material

    shown = picture(lambda: basis_material("Basis 2", whole(), 2))
    np.testing.assert_allclose(shown, picture(lambda: alone(2)), rtol=1e-5)
    for other in (lambda: alone(1), lambda: alone(2, 1.0)):  # another basis, and sliders as they were at first
        assert not np.allclose(shown, picture(other), rtol=0.05)


@pytest.mark.parametrize(("count", "sets"), [(1, 1), (2, 1), (3, 1), (4, 1), (2, 3)])
def test_weight_maps_are_read_from_the_material(count: int, sets: int) -> None:
    weights = np.random.default_rng(5).uniform(0, 1, (4, 6, count, sets)).astype(np.float32)
    found = weight_maps(group_of(mixture_material("Asset", Surface(mixture(count), weights))))
    assert len(found) == count
    for k, one in enumerate(found):
        np.testing.assert_array_equal(one, np.broadcast_to(weights[:, :, k], (4, 6, 3)))
    even = weight_maps(group_of(mixture_material("Even", Surface(mixture(count), weights[:1, :1]))))
    np.testing.assert_allclose([one[0, 0, 0] for one in even], weights[0, 0, :, 0])


def test_every_pixel_shows_most_of_the_basis_of_its_place() -> None:
    scene, item = ball_scene()
    dress(item, mixture_material("Asset", Surface(mixture(3), halves(0, 3))))
    mark(scene, item)
    camera = ball_camera(40)
    add_camera(scene, camera)
    found, hits = bases.shown(scene, camera), truth.first_hits(scene, camera)
    assert list(found) == ["basis 1", "basis 2", "basis 3"]
    assert not found["basis 2"].any()
    around = np.arctan2(hits.position[..., 1], hits.position[..., 0]) % (2 * np.pi)  # of the left half below pi
    clear = hits.is_object & (np.abs(np.sin(around)) > 0.1)
    np.testing.assert_array_equal(found["basis 1"][clear], around[clear] < np.pi)
    np.testing.assert_array_equal(found["basis 1"] | found["basis 3"], hits.is_object)
    item.pop(bases.MARK)
    assert bases.shown(scene, camera) == {}  # it is no asset


def test_an_error_is_told_of_the_basis_that_has_it(folder: Path, tmp_path: Path) -> None:
    scene = small_scenes.lambert(ALBEDO)
    item = next(item for item in scene.objects if item.type == "MESH")
    curves = np.full((2, 1, len(STOPS), 3), ALBEDO)
    curves[1] *= 1.1
    weights = np.where(np.arange(64)[:, None] < 32, [1.0, 0.0], [0.0, 1.0]).astype(np.float32)
    surface = Surface(Mixture((Lobe("diffuse"),), curves), np.broadcast_to(weights[None, :, :, None], (16, 64, 2, 1)))
    dress(item, mixture_material("Asset", surface))
    mark(scene, item)
    path = tmp_path / "halves.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    for one in compared(path, folder, "--bounces=0").values():
        told: Any = one["bases"]
        assert told["basis 2"] == pytest.approx(0.1, rel=0.1)
        assert told["basis 1"] < one["relight_rel_rmse"] < told["basis 2"]
        assert told["basis 1"] < 0.02  # of pixels at its border alone
    assert "Which material errs" in (tmp_path / "halves-comparison" / "comparison.html").read_text()


def test_balls_stand_beside_the_asset_and_are_replaced() -> None:
    scene, item = ball_scene()
    dress(item, mixture_material("Asset", Surface(mixture(3), halves(0, 3))))
    mark(scene, item)
    item.location = (3.0, 1.0, 2.0)
    add_camera(scene, ball_camera(40))
    scene.view_layers[0].update()
    bases.add_balls(scene, item)
    balls = bases.add_balls(scene, item)
    assert [one for one in scene.objects if one.get(bases.OF) == item.name] == balls
    assert len({one.active_material for one in balls}) == 3 and all(one[BACKDROP] for one in balls)
    scene.view_layers[0].update()
    places = [(scene.camera.matrix_world.inverted() @ one.matrix_world.translation) for one in [item, *balls]]
    radius = max((one.matrix_world @ Vector(one.bound_box[0]) - one.location).length for one in balls)
    assert all(place.x > places[0].x + 1 + 0.1 for place in places[1:])  # right of the unit ball
    assert all(a.y - b.y > radius for a, b in pairwise(places[1:]))  # from above
    dress(item, bpy.data.materials.new("Plain"))
    with pytest.raises(LightsphereError, match="no bases"):
        bases.add_balls(scene, item)


def test_an_asset_of_one_material_has_no_table_of_bases(folder: Path, tmp_path: Path) -> None:
    found = compared(asset(tmp_path / "plain.blend", ALBEDO), folder, "--bounces=0")
    assert all(one["bases"] == {} for one in found.values())
    assert "Which material errs" not in (tmp_path / "plain-comparison" / "comparison.html").read_text()
