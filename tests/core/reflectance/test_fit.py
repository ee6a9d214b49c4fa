"""A first reflectance: planted materials come back, and its error on lights held out tells when they do not."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pipeline.core import images
from pipeline.core.capture import Capture
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from pipeline.core.reflectance import Reflectance, ReflectanceSettings, lobes
from pipeline.core.reflectance.fit import fit
from pipeline.core.shape import Shape
from tests import oracles, synthetic, tolerances

ALBEDO = np.array([0.6, 0.35, 0.1])
SPECULAR = np.array([0.2, 0.25, 0.3])
ROUGHNESS = 0.42


@pytest.fixture(scope="module")
def shape() -> Shape:
    return synthetic.ball(synthetic.camera(24))


@pytest.fixture(scope="module")
def glossy(shape: Shape, tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return synthetic.write_capture(tmp_path_factory.mktemp("glossy"), shape, ALBEDO, SPECULAR, ROUGHNESS)


def fitted(shape: Shape, capture: Capture, **settings: float) -> Reflectance:
    return finish(fit(shape, capture, ReflectanceSettings(**settings)))


def test_columns_are_the_closed_forms() -> None:
    rng = np.random.default_rng(3)
    normal, view, light = (oracles.unit(rng.normal(size=(200, 3))) for _ in range(3))
    got = np.array([lobes.lobe_columns(n, wo, wi, ROUGHNESS**2) for n, wo, wi in zip(normal, view, light, strict=True)])
    seen = (oracles.dot(normal, view) > 0) & (oracles.dot(normal, light) > 0)
    assert 20 < seen.sum() < 180
    np.testing.assert_allclose(got[seen, 0], oracles.lambert_cosine(normal, light, 1.0)[seen], rtol=1e-9)
    np.testing.assert_allclose(got[seen, 1], oracles.ggx_cosine(normal, light, view, ROUGHNESS)[seen], rtol=1e-9)
    assert (got[~seen] == 0).all()
    swapped = oracles.ggx_cosine(normal, view, light, ROUGHNESS)[seen]
    assert not np.allclose(got[seen, 1], swapped, rtol=0.05)  # f cos_i: light and view are not alike


def test_a_planted_material_comes_back(shape: Shape, glossy: Capture) -> None:
    found = fitted(shape, glossy)
    front = shape.normal[..., 2] > 0.5
    assert np.abs(found.albedo[front] - ALBEDO).max() < tolerances.PLANTED_ALBEDO
    assert np.abs(found.specular[front] - SPECULAR).max() < tolerances.PLANTED_SPECULAR
    assert np.abs(found.roughness[front] - ROUGHNESS).max() < tolerances.PLANTED_ROUGHNESS
    assert found.notes["material_rel_rms"] < tolerances.HELD_OUT
    assert found.notes["held_out_lights"] == 10
    unknown = ~np.isfinite(shape.depth)
    assert np.isnan(found.albedo[unknown]).all() and np.isnan(found.roughness[unknown]).all()


def test_a_wrong_material_is_told_by_the_lights_held_out(
    shape: Shape, glossy: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def brighter(*arguments: object) -> np.ndarray:
        return 1.05 * right(*arguments)

    right = lobes.non_negative
    monkeypatch.setattr(lobes, "non_negative", brighter)
    assert fitted(shape, glossy).notes["material_rel_rms"] > 2 * tolerances.HELD_OUT


def test_a_wrong_shape_is_told_by_the_lights_held_out(shape: Shape, glossy: Capture) -> None:
    flipped = dataclasses.replace(shape, normal=shape.normal * np.float32([-1, 1, 1]))
    assert fitted(flipped, glossy).notes["material_rel_rms"] > 0.2


def test_a_lambertian_surface_gets_no_highlight(shape: Shape, tmp_path: Path) -> None:
    capture = synthetic.write_capture(tmp_path, shape, ALBEDO, np.zeros(3), 0.5)
    found = fitted(shape, capture)
    known = np.isfinite(shape.depth)
    np.testing.assert_allclose(found.albedo[known], np.broadcast_to(ALBEDO, (known.sum(), 3)), atol=2e-3)
    assert np.abs(found.specular[known]).max() < 2e-3


def test_colour_varies_from_pixel_to_pixel(shape: Shape, tmp_path: Path) -> None:
    stripes = np.where(np.arange(24)[:, None, None] % 6 < 3, ALBEDO, ALBEDO[::-1]) * np.ones((24, 24, 1))
    capture = synthetic.write_capture(tmp_path, shape, stripes, SPECULAR, ROUGHNESS)
    found = fitted(shape, capture)
    front = shape.normal[..., 2] > 0.5
    assert np.abs(found.albedo - stripes)[front].max() < tolerances.PLANTED_ALBEDO
    assert np.abs(found.albedo[::-1] - stripes)[front].max() > 10 * tolerances.PLANTED_ALBEDO


def test_two_materials_get_two_roughnesses(shape: Shape, tmp_path_factory: pytest.TempPathFactory) -> None:
    folders = [tmp_path_factory.mktemp(name) for name in ("dull", "shiny")]
    dull, shiny = (
        synthetic.write_capture(folder, shape, ALBEDO, SPECULAR, r)
        for folder, r in zip(folders, (0.6, 0.3), strict=True)
    )
    for name in dull.files:
        left, right = dull.image(dull.files.index(name)), shiny.image(shiny.files.index(name))
        images.write_rgb(dull.folder / name, np.concatenate([left[:, :12], right[:, 12:]], axis=1))
    found = fitted(shape, dull)
    front = shape.normal[..., 2] > 0.6
    half = np.arange(24) < 12
    assert np.median(found.roughness[front & half]) == pytest.approx(0.6, abs=0.03)
    assert np.median(found.roughness[front & ~half]) == pytest.approx(0.3, abs=0.03)
    assert len(np.unique(fitted(shape, dull, clusters=1).roughness[front])) == 1


def test_shadows_and_saturated_values_are_left_out(shape: Shape, tmp_path: Path) -> None:
    shadow = np.random.default_rng(5).uniform(size=(80, 24, 24)) < 0.3
    capture = synthetic.write_capture(tmp_path, shape, ALBEDO, SPECULAR, ROUGHNESS, shadow)
    front = shape.normal[..., 2] > 0.5
    found = fitted(shape, capture)
    assert np.abs(found.albedo[front] - ALBEDO).max() < tolerances.PLANTED_ALBEDO
    limit = float(np.percentile(np.stack([capture.image(i)[front] for i in range(80)]), 90))
    for i, name in enumerate(capture.files):
        images.write_rgb(tmp_path / name, np.minimum(capture.image(i), np.float32(limit)))
    clipped = dataclasses.replace(capture, notes={"saturation": float(np.float32(limit))})
    told, untold = fitted(shape, clipped), fitted(shape, capture)
    assert np.median(np.abs(told.albedo[front] - ALBEDO)) < tolerances.PLANTED_ALBEDO
    assert np.median(np.abs(untold.albedo[front] - ALBEDO)) > tolerances.PLANTED_ALBEDO


def test_tiles_change_nothing(shape: Shape, glossy: Capture) -> None:
    whole, tiled = fitted(shape, glossy), fitted(shape, glossy, memory=1.0)
    np.testing.assert_array_equal(whole.albedo, tiled.albedo)
    assert whole.notes["material_rel_rms"] == tiled.notes["material_rel_rms"]


def test_it_is_written_and_read(shape: Shape, glossy: Capture, tmp_path: Path) -> None:
    found = fitted(shape, glossy)
    found.save(tmp_path / "r")
    again = Reflectance.open(tmp_path / "r")
    for name in ("albedo", "specular", "edge", "roughness", "error"):
        np.testing.assert_array_equal(getattr(found, name), getattr(again, name))
    assert again.notes == found.notes
    (tmp_path / "r" / "reflectance.json").write_text("{}")
    with pytest.raises(LightsphereError, match="damaged"):
        Reflectance.open(tmp_path / "r")
    with pytest.raises(LightsphereError, match="not a reflectance"):
        Reflectance.open(tmp_path)


def test_wrong_input_is_named(shape: Shape, glossy: Capture) -> None:
    distant = dataclasses.replace(glossy, lights=dataclasses.replace(glossy.lights, kind="distant"))
    with pytest.raises(LightsphereError, match="near lights"):
        fitted(shape, distant)
    with pytest.raises(LightsphereError, match="resolution"):
        fitted(synthetic.ball(synthetic.camera(20)), glossy)
    lost = dataclasses.replace(shape, confidence=np.zeros_like(shape.confidence))
    with pytest.raises(LightsphereError, match="no recovered pixel"):
        fitted(lost, glossy)
