"""`lightsphere demo`: the whole path on a built-in scene, from nothing to an asset and a report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from ..core.settings import setting
from .device import Device, render_on
from .stage import Figures, JsonFile, run_with_bar, settings_options


@dataclass(frozen=True)
class DemoSettings:
    """What the demo can be told; a folder is continued with the same settings only."""

    scene: str = setting("teapot-plastic", "a built-in scene, see lightsphere scenes")
    resolution: int = setting(128, "width and height of the pictures", unit="px", low=32, high=1024)
    inner: int = setting(320, "lights on the inner sphere", low=32, high=10_000)
    outer: int = setting(80, "lights on the outer sphere", low=32, high=10_000)
    effects: str = setting(
        "direct",
        "light transport of the capture; what the others would add is measured and reported: "
        "direct (no noise, seconds) or",
        choices=("direct", "auto", "full"),
    )


@settings_options(DemoSettings)
def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of the results")],
    settings: DemoSettings,
    device: Device = "auto",
    json: JsonFile = None,
) -> None:
    """Capture a scene, recover shape and material, and write asset.blend, report.html, metrics.json and teaser.png.

    Run it again to continue an interrupted one.
    """
    from .demo_stages import Demo

    with Figures("demo", json) as figures:
        figures.values["device"] = render_on(device)
        run = Demo(output, settings)
        run_with_bar(run.work(), one_bar=True)
        figures.values.update(run.metrics())
        errors = (("depth", "depth_median_pct", "%"), ("normals", "normal_mae_deg", "degrees"))
        words = [f"{word} {figures.values[name]:.2g} {unit}" for word, name, unit in errors if figures.values[name]]
        figures.summary = f"{', '.join(words)}; open {output / 'report.html'} and {output / 'asset.blend'}"
