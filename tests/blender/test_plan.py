"""The plan switches on what contributes, and says so."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline import cli
from pipeline.blender import capture, plan
from pipeline.blender import scene as scenes
from pipeline.core.capture import Capture
from pipeline.core.capture_settings import CaptureSettings, PlanSettings
from pipeline.core.progress import finish
from tests.blender import small_scenes

QUICK = PlanSettings(probes=2, probe_resolution=24, probe_samples=16)
SMALL = CaptureSettings(inner=6, outer=4, resolution=16, samples=4, workers=1)


def planned(scene: object, name: str, settings: PlanSettings = QUICK, effects: str = "auto") -> plan.Plan:
    described = capture.describe(scene, name, Path(), SMALL)
    return finish(plan.decide(scene, described, effects, 32, settings))


def shares(found: plan.Plan) -> dict[str, float | None]:
    return {effect.effect: effect.contribution_pct for effect in found.effects}


def test_convex_lambert_needs_direct_light_only() -> None:
    found = planned(small_scenes.lambert(0.8), "test")
    assert found.transport.bounces == 0 and found.transport.samples == 1
    # With more than one sample the filter is another, by which pixels at shadow edges change.
    assert abs(shares(found)["diffuse interreflection"]) < 0.05


def test_lambert_teapot_needs_diffuse_bounces_alone() -> None:
    found = planned(scenes.load("teapot-lambert"), "teapot-lambert")
    share = shares(found)
    assert share["diffuse interreflection"] > 3 and share["cast shadows"] > 3
    assert share["glossy interreflection"] == share["caustics"] == share["transmission"] == 0
    transport = found.transport
    assert (transport.diffuse, transport.glossy, transport.transmission) == (True, False, False)
    assert 1 <= transport.bounces < plan.MOST_BOUNCES and transport.samples == 32


def test_metal_teapot_needs_glossy_bounces() -> None:
    found = planned(scenes.load("teapot-metal"), "teapot-metal")
    assert shares(found)["glossy interreflection"] > 3 and found.transport.glossy


def test_threshold_decides() -> None:
    scene = scenes.load("teapot-lambert")
    found = planned(scene, "teapot-lambert", PlanSettings(threshold=99, probes=1, probe_resolution=16, probe_samples=4))
    assert found.transport.bounces == 0
    assert [effect.simulated for effect in found.effects] == [True, False, False, False, False]
    assert "less than the threshold of 99 %" in found.effects[1].reason


def test_direct_is_not_probed_and_full_takes_everything() -> None:
    scene = small_scenes.lambert(0.8)
    direct = planned(scene, "test", effects="direct")
    assert direct.transport.bounces == 0 and set(shares(direct).values()) == {None}
    full = planned(scene, "test", effects="full")
    assert all(effect.simulated for effect in full.effects) and full.transport.bounces == 1


def test_capture_writes_down_what_it_simulated(tmp_path: Path) -> None:
    words = ["capture", "teapot-lambert", "--inner", "4", "--outer", "4", "--resolution", "24", "--samples", "8"]
    for effects in ("auto", "direct"):
        assert cli.main([*words, "-o", str(tmp_path / effects), "--effects", effects]) == 0
    auto, direct = Capture.open(tmp_path / "auto"), Capture.open(tmp_path / "direct")
    assert auto.notes["transport"]["diffuse"] and auto.notes["transport"]["samples"] == 8
    assert [e["effect"] for e in auto.notes["effects"] if e["simulated"]] == ["cast shadows", "diffuse interreflection"]
    assert direct.notes["transport"]["bounces"] == 0
    mask = auto.mask()
    light = [np.mean([c.image(i)[mask].mean() for i in range(len(c))]) for c in (auto, direct)]
    assert 1.02 < light[0] / light[1] < 1.5


def test_command_prints_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["plan", "thin", "--probes", "1", "--probe-resolution", "16", "--probe-samples", "4"]
    assert cli.main([*words, "--json", str(tmp_path / "plan.json")]) == 0
    out = capsys.readouterr().out
    assert "caustics" in out and "%" in out
    figures = json.loads((tmp_path / "plan.json").read_text())
    assert len(figures["effects"]) == 5 and figures["effects"][1]["cost"] > 0
