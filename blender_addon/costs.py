"""What stages took and are expected to take and give: kept with the scene, shown before a button is pressed."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any

import bpy

from ..pipeline.core.errors import LightsphereError
from .stages import Stage

#: How the errors that presets promise are called where artists read them.
WORDS = {
    "picture_rel_mae": "noise",
    "depth_expected_pct": "depth error",
    "normal_expected_deg": "normal error",
    "material_rel_rms": "reflectance error",
    "relight_rel_rmse": "picture error",
    "reflectance_expected_pct": "reflectance error",
}


def signature(stage: Stage, scene: bpy.types.Scene) -> str:
    """Return what an estimate holds for: what the stage opens, and the settings that no preset of it varies."""
    chosen = dataclasses.asdict(stage.chosen(scene))
    own = {name: value for name, value in chosen.items() if name not in stage.varied}
    return json.dumps([stage.opened(scene), own], sort_keys=True)


def remember_presets(scene: bpy.types.Scene, name: str, made_for: str, found: Mapping[str, Any]) -> None:
    """Keep the presets that trials found for a stage."""
    _keep(scene, "presets", name, {"for": made_for, "found": found})


def presets(stage: Stage, scene: bpy.types.Scene) -> Mapping[str, Any]:
    """Return a stage's presets, see :func:`pipeline.core.tradeoff.presets.presets`; none where they are outdated."""
    kept = _kept(scene, "presets").get(stage.name)
    try:
        if kept is None or kept["for"] != signature(stage, scene):
            return {}
    except LightsphereError:  # a setting that cannot be: the stage's button says so
        return {}
    found: Mapping[str, Any] = kept["found"]
    return found


def apply(stage: Stage, scene: bpy.types.Scene, preset: str) -> None:
    """Set a stage's settings to those of a preset."""
    shown = getattr(scene.lightsphere, stage.name)
    for name, value in _varied(stage, presets(stage, scene)[preset]).items():
        setattr(shown, name, value)


def is_set(stage: Stage, scene: bpy.types.Scene, preset: Mapping[str, Any]) -> bool:
    """Return whether the stage's settings are those of a preset."""
    chosen = stage.chosen(scene)
    return all(getattr(chosen, name) == value for name, value in _varied(stage, preset).items())


def remember_time(scene: bpy.types.Scene, name: str, seconds: float) -> None:
    """Keep how long a stage took."""
    _keep(scene, "seconds", name, seconds)


def last_time(scene: bpy.types.Scene, name: str) -> float | None:
    """Return how long a stage took last in this file [s], None where it was not done."""
    seconds: float | None = _kept(scene, "seconds").get(name)
    return seconds


def told(preset: Mapping[str, Any]) -> str:
    """Say what a preset takes and gives."""
    error, unit = preset["value"], preset["unit"].replace("degrees", "°")
    word = bpy.app.translations.pgettext_iface(WORDS.get(preset["error"], "error"))
    return duration(preset["seconds"]) + ("" if error is None else f", {word} {error:.2g} {unit}")


def duration(seconds: float) -> str:
    """Say a time as people do.

    >>> duration(3.2), duration(75), duration(4000)
    ('3 s', '1 min 15 s', '1 h 7 min')
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def _varied(stage: Stage, preset: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in preset["settings"].items() if name in stage.varied}


def _kept(scene: bpy.types.Scene, kind: str) -> dict[str, Any]:
    noted = scene.lightsphere.costs
    kept: dict[str, Any] = json.loads(noted).get(kind, {}) if noted else {}
    return kept


def _keep(scene: bpy.types.Scene, kind: str, name: str, value: Any) -> None:
    shown = scene.lightsphere
    noted = json.loads(shown.costs) if shown.costs else {}
    noted.setdefault(kind, {})[name] = value
    shown.costs = json.dumps(noted)
