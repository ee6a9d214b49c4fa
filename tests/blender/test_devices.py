"""Renders run on the device that was chosen, and a GPU, where there is one, agrees with the processor."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from pipeline.blender import cycles, devices, views
from pipeline.blender.camera import camera_of
from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from tests import tolerances
from tests.blender import small_scenes

PLACES = np.array([[0.5, -2.5, 1.0], [-1.5, -2.0, 1.5], [1.0, -1.0, 2.5]])
LIGHTS = Lights("near", PLACES, np.ones((3, 3)), np.full(3, 2))
HAS_GPU = devices.choose("gpu").kind != "CPU"
devices.choose("cpu")
needs_gpu = pytest.mark.skipif(not HAS_GPU, reason="Blender knows no GPU here")


@pytest.fixture(autouse=True)
def processor_afterwards() -> Iterator[None]:
    """Leave the tests that follow on the processor."""
    yield
    devices.choose("cpu")


def pictures(device: str, transport: cycles.Transport, seed: int) -> np.ndarray:
    devices.choose(device)
    scene = small_scenes.lambert(0.5)
    small_scenes.ground(scene, -1.0)
    return finish(views.under_lights(scene, camera_of(scene, 48), LIGHTS, transport, seed)).astype(np.float64)


def relative(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(((a - b) ** 2).mean() / (b**2).mean()))


def test_another_word_is_refused() -> None:
    with pytest.raises(LightsphereError, match="device is 'tpu'; choose one of auto, cpu, gpu"):
        devices.choose("tpu")


def test_scenes_are_rendered_on_the_chosen_device_and_keep_their_own() -> None:
    scene = small_scenes.lambert(0.5)
    scene.cycles.device = "GPU"
    devices.choose("cpu")
    with cycles.measuring(scene, camera_of(scene, 8), cycles.DIRECT):
        assert scene.cycles.device == "CPU"
    assert scene.cycles.device == "GPU"


@pytest.mark.skipif(HAS_GPU, reason="Blender knows a GPU here")
@pytest.mark.parametrize("wanted", ["auto", "gpu"])
def test_without_a_gpu_the_processor_renders_and_only_who_asked_for_one_is_told(wanted: str) -> None:
    found = devices.choose(wanted)
    assert found == devices.chosen()
    assert (found.kind, found.missing) == ("CPU", wanted == "gpu")


@needs_gpu
def test_a_gpu_gives_the_direct_light_of_the_processor() -> None:
    ours, other = pictures("gpu", cycles.DIRECT, 0), pictures("cpu", cycles.DIRECT, 0)
    assert relative(ours, other) < tolerances.GPU_DIRECT
    assert relative(ours[:, ::-1], other) > 100 * tolerances.GPU_DIRECT


@needs_gpu
def test_a_gpu_gives_the_bounced_light_of_the_processor_within_render_noise() -> None:
    transport = cycles.Transport(bounces=3, samples=64)
    ours = pictures("gpu", transport, 1)
    first, second = pictures("cpu", transport, 2), pictures("cpu", transport, 3)
    noise = relative(first, second)
    assert relative(ours, first) < 1.5 * noise
    assert abs(ours.sum() / first.sum() - 1) < 0.01
