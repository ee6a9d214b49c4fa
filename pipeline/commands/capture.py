"""`lightsphere capture`: render an OLAT capture of a built-in scene or a .blend."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ..core.capture_settings import CaptureSettings
from ..core.errors import LightsphereError
from ..core.tradeoff.goal import Goal, told
from ..core.workers import bound_to_few_cores
from .device import Device, render_on
from .stage import Budget, DryRun, Figures, JsonFile, Target, run_with_bar, settings_options

Scene = Annotated[str, typer.Argument(help="a built-in scene (see lightsphere scenes) or a .blend file")]


@settings_options(CaptureSettings)
def capture(
    scene: Scene,
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of the capture")],
    settings: CaptureSettings,
    device: Device = "auto",
    budget: Budget = None,
    target: Target = None,
    dry_run: DryRun = False,
    json: JsonFile = None,
) -> None:
    """Render one picture per light of a scene with Cycles; run it again to continue an interrupted one.

    --budget and --target choose how many samples a pixel gets; the error is the mean one of the object's pixels
    over their mean light: noise, and what effects that are left out would add.
    """
    goal = Goal(budget, target)
    from ..blender import capture as blender
    from ..blender import scene as scenes

    with Figures("capture", json) as figures:
        figures.values["device"] = render_on(device)
        if dry_run:
            promise = run_with_bar(blender.foresee(scenes.load(scene), scene, settings, goal))
            figures.foreseen(promise, settings.error)
            return
        made = run_with_bar(blender.capture(scenes.load(scene), scene, output, settings, goal if goal else None))
        figures.values["pictures"] = len(made)
        figures.values["effects"] = made.notes["effects"]
        simulated = [effect["effect"] for effect in made.notes["effects"] if effect["simulated"]]
        figures.summary = f"{len(made)} pictures of {scene} with {', '.join(simulated)} in {output}"
        figures.values["renderer"] = made.notes.get("renderer")
        if (renderer := made.notes.get("renderer", {})).get("name") == "closed form":
            figures.summary += f"; in closed form, {renderer['differs_pct']:.2g} % of the light other than by Cycles"
        if audit := made.notes.get("audit"):
            figures.values["audit"] = audit
            figures.summary += "; " + _audited(audit)
        if promise := made.notes.get("promise"):
            figures.values["promise"] = promise
            figures.summary += "; " + told(promise)


def _audited(audit: dict[str, Any]) -> str:
    """Say what the audit found."""
    figure = f"{audit['error_pct']:.1f} ± {audit['uncertainty_pct']:.1f} % of {audit['group']}'s light"
    if audit["held"]:
        return f"the audit with everything on finds {figure} missing, of {audit['asked_pct']:g} % allowed"
    return (
        f"WARNING: the audit with everything on finds {figure} missing, more than the {audit['asked_pct']:g} % "
        "allowed; capture again with --effects full or a smaller --error"
    )


def capture_worker(
    scene: Scene,
    folder: Annotated[Path, typer.Argument(help="folder of the capture, begun by another process")],
    threads: Annotated[int, typer.Option(help="threads that render")] = 1,
    device: Device = "cpu",
) -> None:
    """Render the pictures whose numbers arrive on standard input; answer each with its checksum."""
    with bound_to_few_cores(threads):
        from ..blender import olat
        from ..blender import scene as scenes
    from ..core import images
    from ..core.capture import Capture

    lights = (int(line) for line in sys.stdin)
    render_on(device)
    try:
        begun = Capture.open(folder)
        loaded = scenes.load(scene)
        print("ready", flush=True)
        for light in olat.render_lights(loaded, begun, lights, threads):
            print("picture", light, images.checksum(folder / begun.files[light]), flush=True)
    except LightsphereError as error:
        print("error", error, flush=True)
