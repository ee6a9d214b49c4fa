"""Captured radiance against closed forms: L = f cos(theta_i) I / d^2."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.blender import capture
from pipeline.core.capture import Capture
from pipeline.core.capture_settings import CaptureSettings
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from tests import oracles, tolerances
from tests.blender import small_scenes

ALBEDO = 0.6
ROUGHNESS = 0.45


def taken(scene: object, folder: Path, rig: str = "double-sphere", resolution: int = 48) -> Capture:
    settings = CaptureSettings(rig=rig, inner=6, outer=4, resolution=resolution, effects="direct", workers=1)
    return finish(capture.capture(scene, "test", folder, settings))


@pytest.fixture(scope="module")
def lambert(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    return taken(small_scenes.lambert(ALBEDO), tmp_path_factory.mktemp("lambert"))


@pytest.fixture(scope="module")
def metal(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    inputs = {"Color": (1, 1, 1, 1), "Roughness": ROUGHNESS}
    scene = small_scenes.ball("ShaderNodeBsdfAnisotropic", inputs, distribution="GGX")
    return taken(scene, tmp_path_factory.mktemp("metal"))


def deviation(made: Capture, closed_form: object, change: object = lambda image: image) -> float:
    """Return the largest deviation of any picture from its closed form, over the largest radiance.

    Left out are pixels next to a shadow's edge or silhouette, where one float decides between light and dark.
    """
    truth = made.truth()
    assert truth is not None
    normal = made.camera.normals_to_world(truth.normal)
    origins, _ = made.camera.rays()
    to_viewer = oracles.unit(origins - truth.position)
    worst = 0.0
    for i in range(len(made)):
        offset = made.lights.position[i] - truth.position
        distance = np.linalg.norm(offset, axis=-1, keepdims=True)
        to_light = offset / distance
        expected = closed_form(normal, to_light, to_viewer) * made.lights.intensity[i, 0] / distance[..., 0] ** 2
        sure = made.mask() & (abs(oracles.dot(normal, to_light)) > 0.02) & (oracles.dot(normal, to_viewer) > 0.3)
        image = change(made.image(i))
        scale = expected[sure].max()
        if scale > 0:
            worst = max(worst, float(abs(image - expected[..., None])[sure].max() / scale))
    return worst


def lambert_form(albedo: float = ALBEDO) -> object:
    return lambda normal, to_light, to_viewer: oracles.lambert_cosine(normal, to_light, albedo)


def ggx_form(normal: np.ndarray, to_light: np.ndarray, to_viewer: np.ndarray) -> np.ndarray:
    return oracles.ggx_cosine(normal, to_light, to_viewer, ROUGHNESS)


def test_lambert(lambert: Capture) -> None:
    assert deviation(lambert, lambert_form()) < tolerances.RADIANCE_LAMBERT


def test_ggx(metal: Capture) -> None:
    assert deviation(metal, ggx_form) < tolerances.RADIANCE_GGX


@pytest.mark.parametrize("change", [np.flipud, np.fliplr, lambda image: image.transpose(1, 0, 2)])
def test_turned_pictures_fail(lambert: Capture, metal: Capture, change: object) -> None:
    assert deviation(lambert, lambert_form(), change) > 10 * tolerances.RADIANCE_LAMBERT
    assert deviation(metal, ggx_form, change) > 10 * tolerances.RADIANCE_GGX


def test_swapped_directions_fail(lambert: Capture, metal: Capture) -> None:
    def swapped_lambert(normal: np.ndarray, to_light: np.ndarray, to_viewer: np.ndarray) -> np.ndarray:
        return oracles.lambert_cosine(normal, to_viewer, ALBEDO)

    def swapped_ggx(normal: np.ndarray, to_light: np.ndarray, to_viewer: np.ndarray) -> np.ndarray:
        return oracles.ggx_cosine(normal, to_viewer, to_light, ROUGHNESS)

    assert deviation(lambert, swapped_lambert) > 10 * tolerances.RADIANCE_LAMBERT
    assert deviation(metal, swapped_ggx) > 10 * tolerances.RADIANCE_GGX


def test_albedo_wrong_by_5_per_cent_fails(lambert: Capture) -> None:
    assert deviation(lambert, lambert_form(0.95 * ALBEDO)) > 10 * tolerances.RADIANCE_LAMBERT


def test_distant_lights_have_their_irradiance(tmp_path: Path) -> None:
    made = taken(small_scenes.lambert(ALBEDO), tmp_path, rig="distant")
    truth, mask = made.truth(), made.mask()
    assert truth is not None and made.lights.kind == "distant"
    normal = made.camera.normals_to_world(truth.normal)
    for i in range(len(made)):
        cosine = oracles.dot(normal, made.lights.position[i])
        expected = oracles.lambert_cosine(normal, made.lights.position[i], ALBEDO) * made.lights.intensity[i, 0]
        sure = mask & (abs(cosine) > 0.02)
        assert abs(made.image(i)[..., 0] - expected)[sure].max() < tolerances.RADIANCE_LAMBERT


def test_lights_behind_each_other_agree_in_squared_distance_times_radiance(lambert: Capture, tmp_path: Path) -> None:
    truth = lambert.truth()
    assert truth is not None
    row, column = 20, 22
    point = truth.position[row, column].astype(np.float64)
    towards = oracles.unit(np.array([0.4, -1.0, 0.7]))
    distance = np.array([0.8, 1.3, 2.9, 6.0])
    intensity = np.array([[5.0, 6.0, 7.0], [50, 60, 70], [1, 1, 1], [200, 100, 50]])
    lights = Lights("near", point + distance[:, None] * towards, intensity, np.array([0, 0, 1, 1]))
    made = taken(small_scenes.lambert(ALBEDO), tmp_path / "c", small_scenes.lights_file(tmp_path / "r.json", lights))
    apparent = np.stack([made.image(i) for i in range(4)]) * (distance**2)[:, None, None, None]
    apparent /= made.lights.intensity[:, None, None]
    assert np.ptp(apparent[:, row, column]) / apparent[:, row, column].mean() < tolerances.COLLINEAR
    beside = apparent[:, row, column + 8]  # not in line with the lights
    assert np.ptp(beside) / beside.mean() > 100 * tolerances.COLLINEAR


def test_truth_is_where_the_rays_hit(lambert: Capture) -> None:
    truth, mask = lambert.truth(), lambert.mask()
    assert truth is not None and truth.diameter == pytest.approx(2, abs=1e-3)
    origins, directions = lambert.camera.rays()
    hit = origins + truth.depth[..., None] * directions
    pixel = 7.3 / lambert.camera.focal[0]  # width of a pixel on the ball [m]
    assert abs(hit - truth.position)[mask].max() < tolerances.POSITION_PIXELS * pixel
    # Facets with edges of 0.04 m lie up to 5e-4 m inside the sphere that they approximate; rays meet them aslant.
    b = oracles.dot(origins, directions)
    analytic = -b - np.sqrt(np.maximum(b**2 - oracles.dot(origins, origins) + 1, 0))
    facing = mask & (truth.normal[..., 2] > 0.3)
    assert (abs(analytic - truth.depth) * truth.normal[..., 2])[facing].max() < 5e-4
    assert abs(oracles.dot(lambert.camera.normals_to_world(truth.normal), truth.position) - 1)[mask].max() < 1e-3
    assert np.isnan(truth.depth[~mask]).all() and (truth.material[~mask] == 0).all()
    assert (truth.material[mask] == 1).all()
    flipped = origins[::-1] + truth.depth[..., None] * directions[::-1]
    assert abs(flipped - truth.position)[mask].max() > 0.1


@pytest.mark.parametrize(
    "settings",
    [
        {"sensor_fit": "VERTICAL", "sensor_width": 50.0, "lens": 60.0},
        {"sensor_fit": "HORIZONTAL", "sensor_height": 50.0, "shift_x": 0.1, "shift_y": -0.2},
        {"type": "ORTHO", "ortho_scale": 2.5, "shift_x": 0.1},
    ],
)
def test_every_camera_has_its_rays(tmp_path: Path, settings: dict[str, object]) -> None:
    scene = small_scenes.lambert(ALBEDO)
    for name, value in settings.items():
        setattr(scene.camera.data, name, value)
    scene.camera.scale = (2, 2, 2)  # Blender's cameras do not scale
    made = taken(scene, tmp_path)
    truth, mask = made.truth(), made.mask()
    assert truth is not None and mask.sum() > 300
    origins, directions = made.camera.rays()
    hit = origins + truth.depth[..., None] * directions
    assert abs(hit - truth.position)[mask].max() < tolerances.POSITION_PIXELS * 7.3 / 100
