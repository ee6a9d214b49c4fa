"""The plan of a capture as a table: which effects of light it needs, and which of them the artist decides."""

from typing import Any

import bpy

from ..pipeline.blender.plan import effects
from ..pipeline.core.capture_settings import SWITCHES, CaptureSettings
from ..pipeline.core.errors import LightsphereError


def _decided(scene: bpy.types.Scene) -> dict[str, bool]:
    """Return which effects the capture's settings decide, and how; none where they are mistyped."""
    shown = scene.lightsphere.capture
    try:
        return CaptureSettings(simulate=shown.simulate, leave_out=shown.leave_out).overrides
    except LightsphereError:
        return {}


def _is_simulated(effect: bpy.types.PropertyGroup) -> bool:
    return _decided(effect.id_data).get(effect.switch, effect.planned)


def _decide(effect: bpy.types.PropertyGroup, simulated: bool) -> None:
    """Write what differs from the plan into the capture's settings, which capture and trials read."""
    decided = _decided(effect.id_data)
    decided.pop(effect.switch, None)
    if simulated != effect.planned:
        decided[effect.switch] = simulated
    shown = effect.id_data.lightsphere.capture
    shown.simulate, shown.leave_out = (
        ", ".join(switch for switch, on in decided.items() if on is wanted) for wanted in (True, False)
    )


class LIGHTSPHERE_PG_effect(bpy.types.PropertyGroup):
    """An effect of light: what it adds, what was planned, what is decided."""

    switch: bpy.props.StringProperty()  # empty where nothing is to decide
    adds: bpy.props.StringProperty()
    planned: bpy.props.BoolProperty()
    simulated: bpy.props.BoolProperty(
        name="Simulate",
        description="Whether the capture simulates this effect; what you decide is done, whatever it adds",
        get=_is_simulated,
        set=_decide,
    )


def bring(scene: bpy.types.Scene, planned: list[dict[str, Any]]) -> None:
    """Put a plan into a scene: rows as ``lightsphere plan`` writes them."""
    rows = scene.lightsphere.plan
    rows.clear()
    for found in planned:
        row = rows.add()
        row.name, row.planned = found["effect"], found["simulated"]
        switch = effects.SWITCHES.get(row.name, "")
        row.switch = switch if switch in SWITCHES and found["contribution_pct"] is not None else ""
        row.adds = _adds(found) or found["reason"]


def _adds(found: dict[str, Any]) -> str:
    """Return what an effect adds to the pictures and takes of the time, empty where that was not measured."""
    words = [] if found["contribution_pct"] is None else [f"{found['contribution_pct']:.2g} %"]
    if found["saves_pct"] is not None:
        words.append(bpy.app.translations.pgettext_iface("{} % of the time").format(round(max(found["saves_pct"], 0))))
    return ", ".join(words)


CLASSES = (LIGHTSPHERE_PG_effect,)
