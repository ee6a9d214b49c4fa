"""`lightsphere plan`: which effects of light transport a scene calls for, and what each costs."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from ..core.capture_settings import PlanSettings
from .capture import Scene
from .device import Device, render_on
from .stage import Figures, JsonFile, run_with_bar, settings_options

if TYPE_CHECKING:
    from ..blender.plan import Plan


@settings_options(PlanSettings)
def plan(scene: Scene, settings: PlanSettings, device: Device = "auto", json: JsonFile = None) -> None:
    """Find out which effects of light a scene calls for: what each adds, and what leaving it out saves.

    Takes the options of capture, and plans what that would render. A scene with light of its own is planned as it
    is lit, unless --lights rig is given.
    """
    from ..blender import capture as blender
    from ..blender import plan as planning
    from ..blender import scene as scenes

    with Figures("plan", json) as figures:
        figures.values["device"] = render_on(device)
        loaded = scenes.load(scene)
        own = settings.lights == "own" or (settings.lights == "auto" and planning.own_light(loaded))
        lights = None if own else blender.describe(loaded, scene, Path(), settings).lights
        found = run_with_bar(planning.decide(loaded, lights, settings))
        Console().print(_table(found))
        figures.values |= {"lights": "own" if own else "rig", **dataclasses.asdict(found)}
        figures.summary = _summary(found, "its own light" if lights is None else f"{len(lights)} lights")


def _table(found: Plan) -> Table:
    table = Table("effect", "adds", "most in", "time", "simulate", "why")
    for effect in found.effects:
        adds, time = "", ""
        if effect.contribution_pct is not None:
            adds = f"{effect.contribution_pct:.2f} ± {effect.uncertainty_pct:.2f} %"
        if effect.saves_pct is not None:
            time = f"{max(effect.saves_pct, 0):.0f} %"
        table.add_row(effect.effect, adds, effect.group, time, "yes" if effect.simulated else "no", effect.reason)
    return table


def _summary(found: Plan, lights: str) -> str:
    bounces = found.transport.bounces
    words = f"{bounces} bounces under {lights}" if bounces else f"direct light is enough under {lights}"
    if found.missing is not None:
        planned, everything = found.seconds["planned"], found.seconds["everything"]
        words += f", at most {found.missing.contribution_pct:.1f} % missing"
        words += f"; a picture takes about {planned:.2g} s, with everything {everything:.2g} s"
    if bounces and lights != "its own light":
        words += "; light that bounces biases the depth of the double sphere, --effects direct leaves it out"
    return words
