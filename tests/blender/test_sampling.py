"""Captures of as many samples as a goal needs: the noise that is stated is the noise that is there."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import numpy as np
import pytest

from pipeline.blender import capture, cycles, sampling, views
from pipeline.blender import scene as scenes
from pipeline.core.capture import Capture
from pipeline.core.capture_settings import CaptureSettings
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from pipeline.core.tradeoff.goal import Goal, stated

SMALL = CaptureSettings(inner=12, outer=6, resolution=24, effects="full", workers=1)
SCENE = "teapot-plastic"
TARGET = 6.0
FACTOR = 1.5  # between what is promised and obtained


def made(folder: Path, goal: Goal | None, settings: CaptureSettings = SMALL) -> Capture:
    return finish(capture.capture(scenes.load(SCENE), SCENE, folder, settings, goal))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    there = tmp_path_factory.mktemp("sampling") / "capture"
    made(there, Goal(None, TARGET))
    return there


def test_error_is_what_was_promised_and_what_is_there(folder: Path) -> None:
    """There is: against pictures with so many samples that their noise does not count."""
    found = Capture.open(folder)
    kept = found.notes["promise"]
    assert kept["promised"]["value"] <= TARGET
    assert 1 / FACTOR < kept["obtained"]["value"] / kept["promised"]["value"] < FACTOR
    transport = cycles.Transport(**found.notes["transport"])
    assert found.notes["settings"]["samples"] == transport.samples == kept["settings"]["samples"] > 1
    clean = dataclasses.replace(transport, samples=1024)
    lights = np.arange(0, len(found), 3)
    scene = scenes.load(SCENE)
    true = finish(views.under_lights(scene, found.camera, found.lights.select(lights), clean, seed=5))
    mask = found.mask()
    seen = np.stack([found.image(int(light)) for light in lights])
    error = abs(seen - true)[:, mask].sum() / true[:, mask].sum()
    assert 1 / FACTOR < 100 * error / kept["obtained"]["value"] < FACTOR


def test_what_is_continued_keeps_its_samples(folder: Path) -> None:
    before = {path.name: path.read_bytes() for path in folder.glob("light_*.exr")}
    (folder / "light_0003.exr").unlink()
    found = made(folder, Goal(None, 3 * TARGET))
    assert {path.name: path.read_bytes() for path in folder.glob("light_*.exr")} == before
    assert found.notes["settings"]["error"] == TARGET
    with pytest.raises(LightsphereError, match=r"holds a capture with .*samples"):
        made(folder, None, dataclasses.replace(SMALL, error=TARGET))


@pytest.mark.parametrize(("target", "samples"), [(40.0, 1), (10.0, 16), (5.0, 64), (2.5, 256)])
def test_noise_falls_with_the_root_of_the_samples(folder: Path, target: float, samples: int) -> None:
    cost = sampling.Cost(noise=0.4, fall=0.5, start=0.1, sample=0.01)
    found = sampling.promise(cost, Capture.open(folder), Goal(None, target + 1e-9), 2, 0.0)
    assert found.expected.settings == {"samples": samples}
    checked = 18 * (0.1 + 0.01 * sampling.BETTER * samples / 16)
    assert found.expected.seconds == pytest.approx(18 * (0.05 + 0.01 * samples) + checked)
    assert stated(found.expected) == pytest.approx(target)


def test_what_is_missing_no_sample_brings_back(folder: Path) -> None:
    cost = sampling.Cost(noise=0.4, fall=0.5, start=0.1, sample=0.01)
    found = sampling.promise(cost, Capture.open(folder), Goal(None, 2.0), 2, missing=0.03)
    assert "no settings are expected to reach 2 %" in found.lacks
    assert stated(found.expected) == pytest.approx(3.0, rel=0.03)


def test_a_dry_run_tells_every_doubling_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    found = finish(capture.foresee(scenes.load(SCENE), SCENE, SMALL, Goal(None, TARGET)))
    assert [trial.settings["samples"] for trial in found.trials] == [2**k for k in range(13)]
    assert all(np.diff([stated(trial) for trial in found.trials]) < 0)
    assert all(np.diff([trial.seconds for trial in found.trials]) >= 0)  # so small that samples may cost nothing
    assert stated(found.expected) <= TARGET
    assert not list(tmp_path.iterdir())


def test_direct_light_takes_one_sample(tmp_path: Path) -> None:
    direct = dataclasses.replace(SMALL, effects="direct", inner=40)
    kept = made(tmp_path, Goal(60.0, None), direct).notes["promise"]
    assert kept["settings"] == {"samples": 1}
    assert kept["promised"]["value"] == kept["obtained"]["value"] == 0
    assert not kept["lacks"]
