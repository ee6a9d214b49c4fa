"""Samples of a dataset: rendered as drawn, the same wherever they are made, readable in every layout."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import cli
from pipeline.blender import scene as scenes
from pipeline.blender.dataset import made_by, sample
from pipeline.core import images
from pipeline.core.brdf.files import write_npz
from pipeline.core.brdf.parametric import TorranceSparrow
from pipeline.core.capture import Capture
from pipeline.core.dataset import folder as dataset
from pipeline.core.dataset.draw import draw, sample_name
from pipeline.core.dataset.recipe import SHAPES, Recipe
from pipeline.core.errors import LightsphereError
from tests import tolerances

ALBEDO = np.array([0.6, 0.3, 0.1])
SMALL: dict[str, Any] = {"count": 3, "camera": {"resolution": 40}, "lights": {"count": 4}, "render": {"samples": 4}}


def recipe_of(**values: Any) -> Recipe:
    return Recipe.of(
        {name: {**SMALL.get(name, {}), **value} for name, value in values.items()}
        | {name: value for name, value in SMALL.items() if name not in values}
    )


def made(folder: Path, recipe: Recipe, *indices: int) -> list[Capture]:
    """Make samples and return their captures."""
    if not (folder / dataset.RECIPE).is_file():
        dataset.begin(folder, recipe, made_by())
    for index in indices:
        sample.make(recipe, folder, index, 1)
    return [Capture.open(folder / "capture" / sample_name(index)) for index in indices]


def imported(source: Path, folder: Path) -> Capture:
    assert cli.main(["import", str(source), "-o", str(folder)]) == 0
    return Capture.open(folder)


@pytest.fixture(scope="module")
def matt(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A BRDF file of a Lambertian material."""
    path = tmp_path_factory.mktemp("brdf") / "matt.npz"
    write_npz(path, TorranceSparrow(ALBEDO, np.zeros(3), 0.2))
    return str(path)


def cosines(capture: Capture) -> np.ndarray:
    """Return the true cosine of every light at every pixel of the object, (L, P)."""
    truth = capture.truth()
    assert truth is not None
    normal = capture.camera.normals_to_world(truth.normal[capture.mask()])
    return np.maximum(capture.lights.position @ normal.T, 0)


def test_shapes_are_those_that_recipes_name() -> None:
    assert tuple(scenes.part("shapes").SHAPES) == SHAPES


def test_a_sample_does_not_depend_on_those_before_it(tmp_path: Path) -> None:
    recipe = recipe_of(sensor={"bits": 8, "full_well": 1000}, truth={"direct": True}, output={"formats": ["capture"]})
    made(tmp_path / "all", recipe, 0, 1, 2)
    made(tmp_path / "alone", recipe, 2)
    one, other = (dataset.finished_list(tmp_path / name, 2).read_text() for name in ("all", "alone"))
    assert one == other and len(one.splitlines()) == 4 + 4 + 4
    assert one != dataset.finished_list(tmp_path / "all", 1).read_text()
    assert not list((tmp_path / "all").glob(f".*{dataset.PART}"))


def test_a_matt_ball_shines_as_its_normals_say(tmp_path: Path, matt: str) -> None:
    """L = rho / pi E cos(theta), E = pi."""
    recipe = recipe_of(
        shape={"source": "blob", "detail": 0}, material={"source": matt}, render={"bounces": 0, "pixel_type": "float"}
    )
    (capture,) = made(tmp_path, recipe, 0)
    mask = capture.mask()
    found = np.stack([capture.image(light)[mask] for light in range(4)])
    expected = cosines(capture)[..., None] * ALBEDO
    lit = expected[..., 0] > 0.05
    assert lit.sum() > 500
    ratio = found[lit] / expected[lit]
    assert np.abs(ratio - 1).max() < tolerances.NODES + 0.01  # a closure's share of white as the fit found it
    assert np.abs(ratio / 1.05 - 1).min() > 0.03
    assert np.abs(found[~(expected[..., 0] > 0)]).max() < 1e-3


def test_intensities_follow_the_sensors_white(tmp_path: Path, matt: str) -> None:
    recipe = recipe_of(
        shape={"source": "blob", "detail": 0},
        material={"source": matt},
        lights={"strength": [0.5, 2.0]},
        render={"bounces": 0},
        sensor={"bits": 12, "white": 95},
        truth={"direct": True},
    )
    (capture,) = made(tmp_path, recipe, 1)
    mask = capture.mask()
    found = np.stack([capture.image(light)[mask] for light in range(4)])
    expected = cosines(capture)[..., None] * ALBEDO / np.pi * capture.lights.intensity[:, None]
    assert found.max() == 1 and 0.005 < (found == 1).mean() < 0.05
    steps = found.astype(np.float64) * (2**12 - 1)
    assert np.abs(steps - np.round(steps)).max() < 1e-3
    direct = images.read_rgb(capture.folder / "direct_0000.exr")[mask]
    assert np.allclose(np.minimum(direct, 1), found[0], atol=1 / 2**11)  # no light bounces: all of it is direct
    clear = (found[..., 0] < 1) & (expected[..., 0] > 0.1)
    assert np.abs(found[clear] / expected[clear] - 1).max() < 0.03
    assert capture.notes["saturation"] == 1 and capture.notes["bit_depth"] == 12
    simulated = {row["effect"]: row["simulated"] for row in capture.notes["effects"]}
    assert simulated["saturation"] and not simulated["sensor noise"]


def test_layers_tell_what_was_drawn(tmp_path: Path) -> None:
    recipe = recipe_of(material={"count": 1, "metal": 0}, camera={"resolution": 48})
    (capture,) = made(tmp_path, recipe, 2)
    (inputs,) = draw(recipe, 2).principled
    mask = capture.mask()
    layers = images.read_channels(capture.folder / "layers.exr")
    assert np.allclose(layers["roughness.V"][mask], inputs.roughness, rtol=1e-5)
    assert np.allclose(layers["share.1"][mask], 1) and not layers["share.2"].any()
    # A Principled BSDF lowers its diffuse part by what its gloss takes, alike in all colours.
    ratio = np.stack([layers[f"diffuse.{c}"][mask] for c in "RGB"], axis=-1) / inputs.base_color
    assert np.allclose(ratio, ratio[:, :1], rtol=1e-4) and (ratio > 0.6).all() and (ratio <= 1).all()
    assert not layers["roughness.V"][~mask].any()


def test_mixed_materials_share_the_surface(tmp_path: Path) -> None:
    recipe = recipe_of(material={"count": 3, "patches": 0.2}, camera={"resolution": 64})
    (capture,) = made(tmp_path, recipe, 0)
    drawn, mask = draw(recipe, 0), capture.mask()
    layers = images.read_channels(capture.folder / "layers.exr")
    shares = np.stack([layers[f"share.{k}"][mask] for k in (1, 2, 3)], axis=-1)
    assert np.allclose(shares.sum(axis=-1), 1, atol=1e-5) and (shares >= 0).all()
    assert (shares > 0.9).any(axis=0).all() and (shares < 0.1).any(axis=0).all()
    mean = shares @ [inputs.roughness for inputs in drawn.principled]
    assert np.allclose(layers["roughness.V"][mask], mean, rtol=1e-4)


def test_direct_light_is_the_part_that_does_not_bounce(tmp_path: Path) -> None:
    values = {"shape": {"source": "steps"}, "material": {"source": "own"}, "truth": {"direct": True}}
    (capture,) = made(tmp_path / "both", recipe_of(**values, render={"bounces": 3, "samples": 64}), 0)
    (alone,) = made(tmp_path / "alone", recipe_of(**values, render={"bounces": 0}), 0)
    mask = capture.mask()
    for light, name in enumerate(capture.files):
        direct = images.read_rgb(capture.folder / name.replace("light_", "direct_"))
        assert np.allclose(direct, alone.image(light), atol=2e-3)
        assert capture.image(light)[mask].mean() > 1.003 * direct[mask].mean()
    for name in alone.files:  # without bounces all light is direct
        same = alone.folder / name.replace("light_", "direct_")
        assert same.read_bytes() == (alone.folder / name).read_bytes()


def test_the_object_fills_the_picture_and_stays_inside(tmp_path: Path) -> None:
    recipe = recipe_of(camera={"margin": [1.05, 1.1]}, lights={"layout": "near"}, shape={"extent": 300.0})
    for capture in made(tmp_path, recipe, 0, 1, 2):
        mask = capture.mask()
        assert not (mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any())
        assert max(np.ptp(np.nonzero(mask)[0]), np.ptp(np.nonzero(mask)[1])) > 0.55 * len(mask)
        assert capture.notes["diameter"] == pytest.approx(300, rel=1e-5)


def test_meshes_and_scenes_keep_their_own_material(tmp_path: Path) -> None:
    import bpy

    scene = scenes.empty()
    scenes.part("stage").add_object(
        scene, "Ball", scenes.part("shapes").blob(0.0, np.random.default_rng(0)), bpy.data.materials.new("Ball")
    )
    bpy.ops.wm.ply_export(filepath=str(tmp_path / "ball.ply"))
    (tmp_path / "recipe.toml").write_text(
        'shape = {source = ["ball.ply", "gourd"], extent = 3.0}\nmaterial.source = "own"\n'
        "camera.resolution = 40\nlights.count = 2\nrender.bounces = 0\n"
    )
    recipe = Recipe.read(tmp_path / "recipe.toml")
    drawn = {Path(draw(recipe, index).shape).name: index for index in range(8)}
    ball, gourd = made(tmp_path / "made", recipe, drawn["ball.ply"], drawn["gourd"])
    assert ball.notes["diameter"] == pytest.approx(3, rel=1e-4)
    assert gourd.notes["diameter"] == pytest.approx(2.2, rel=1e-4)
    truth = ball.truth()
    assert truth is not None
    assert np.allclose(np.linalg.norm(truth.position[ball.mask()], axis=-1), 1.5, rtol=2e-3)
    colours = images.read_channels(gourd.folder / "layers.exr")
    assert "roughness.V" not in colours and colours["diffuse.R"][gourd.mask()].max() > 0.3


def test_diligent_layout_is_read_back(tmp_path: Path) -> None:
    recipe = recipe_of(output={"formats": ["capture", "diligent"]}, lights={"count": 12, "strength": [0.7, 1.3]})
    (capture,) = made(tmp_path, recipe, 0)
    name = sample_name(0)
    read = imported(tmp_path / "diligent" / f"{name}PNG", tmp_path / "read")
    truth, again = capture.truth(), read.truth()
    assert truth is not None and again is not None
    mask = capture.mask()
    assert (read.mask() == mask).all()
    assert np.allclose(again.normal[mask], truth.normal[mask], atol=1e-6)
    assert np.allclose(read.lights.position, capture.camera.normals_to_camera(capture.lights.position), atol=1e-8)
    scale = (read.lights.intensity / capture.lights.intensity).mean()
    assert np.allclose(read.lights.intensity, scale * capture.lights.intensity, rtol=1e-8)
    for light in range(12):
        assert np.allclose(read.image(light), scale * capture.image(light), atol=1 / 65535)


def test_near_layout_is_read_back(tmp_path: Path) -> None:
    recipe = recipe_of(output={"formats": ["near"]}, lights={"count": 5, "layout": "near"})
    kept = recipe_of(output={"formats": ["capture"]}, lights={"count": 5, "layout": "near"})
    dataset.begin(tmp_path / "near", recipe, made_by())
    sample.make(recipe, tmp_path / "near", 1, 1)
    (capture,) = made(tmp_path / "kept", kept, 1)
    assert not (tmp_path / "near" / "capture").exists()
    read = imported(tmp_path / "near" / "near" / sample_name(1), tmp_path / "read")
    camera = capture.camera
    assert np.allclose(read.camera.focal, camera.focal) and np.allclose(read.camera.centre, camera.centre)
    seen = (capture.lights.position - camera.to_world[:3, 3]) @ camera.to_world[:3, :3]
    assert np.allclose(read.lights.position, seen, atol=1e-7)
    scale = (read.lights.intensity / capture.lights.intensity).mean()
    for light in range(5):
        assert np.allclose(read.image(light), scale * capture.image(light), atol=1 / 65535)


def test_hdf5_holds_the_keys_of_blenderproc(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    (capture,) = made(tmp_path, recipe_of(output={"formats": ["capture", "hdf5"]}), 0)
    truth, mask = capture.truth(), capture.mask()
    assert truth is not None
    with h5py.File(tmp_path / "hdf5" / f"{sample_name(0)}.hdf5") as file:
        found = {name: np.array(values) for name, values in file.items()}
    assert found["colors"].shape == (4, 40, 40, 3) and found["colors"].dtype == np.uint8
    assert np.array_equal(found["radiance"][2], capture.image(2))
    assert np.allclose(2 * found["normals"][mask] - 1, truth.normal[mask], atol=1e-6)
    to_object = truth.position[mask] - capture.camera.to_world[:3, 3]
    assert np.allclose(found["depth"][mask], to_object @ -capture.camera.to_world[:3, 2], rtol=1e-5)
    assert (found["depth"][~mask] > 1e9).all()
    assert np.array_equal(found["category_id_segmaps"], truth.material)
    assert json.loads(found["capture"].item())["format"] == "lightsphere-capture"


def test_what_a_sample_cannot_be_made_of_is_said(tmp_path: Path) -> None:
    (tmp_path / "broken.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 3\nend_header\n")
    recipe = dataclasses.replace(
        recipe_of(), shape=Recipe.of({"shape": {"source": str(tmp_path / "broken.ply")}}).shape
    )
    dataset.begin(tmp_path / "made", recipe, made_by())
    with pytest.raises(LightsphereError, match=r"broken\.ply"):
        sample.make(recipe, tmp_path / "made", 0, 1)
    assert not list((tmp_path / "made").glob(f".*{dataset.PART}"))
