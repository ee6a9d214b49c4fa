"""`lightsphere plan`: which effects of light transport a scene calls for, and what each costs."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from rich.console import Console
from rich.table import Table

from ..core.capture_settings import CaptureSettings, PlanSettings
from .capture import Scene
from .device import Device, render_on
from .stage import Figures, JsonFile, run_with_bar, settings_options


@settings_options(PlanSettings)
def plan(scene: Scene, settings: PlanSettings, device: Device = "auto", json: JsonFile = None) -> None:
    """Measure what each effect adds to the pictures of a scene, what it costs, and which are worth simulating."""
    from ..blender import capture as blender
    from ..blender import plan as planning
    from ..blender import scene as scenes

    with Figures("plan", json) as figures:
        figures.values["device"] = render_on(device)
        loaded = scenes.load(scene)
        described = blender.describe(loaded, scene, Path(), CaptureSettings())
        found = run_with_bar(planning.decide(loaded, described, "auto", CaptureSettings().samples, settings))
        table = Table("effect", "adds", "costs", "simulate", "why")
        for effect in found.effects:
            share, cost = f"{effect.contribution_pct:.2f} %", f"{effect.cost:.1f} x"
            table.add_row(effect.effect, share, cost, "yes" if effect.simulated else "no", effect.reason)
        Console().print(table)
        figures.values |= dataclasses.asdict(found)
        bounces = found.transport.bounces
        figures.summary = f"{bounces} bounces" if bounces else "direct light is enough"
        if bounces:
            figures.summary += (
                "; light that bounces biases the depth of the double sphere, --effects direct leaves it out"
            )
