"""`lightsphere reflectance`: basis BRDFs and weight maps, or a lobe per pixel, on a known shape."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Annotated, Any

import typer

from ..core.capture import Capture
from ..core.errors import LightsphereError
from ..core.reflectance import Reflectance, ReflectanceSettings, recovered_pixels
from ..core.reflectance.bivariate import Bivariate
from ..core.shape import Shape
from ..core.tradeoff import Variant
from ..core.tradeoff.forecast import foretold
from ..core.tradeoff.goal import Goal, Promise
from .stage import Budget, DryRun, Figures, JsonFile, Target, run_with_bar, settings_options


def capture_of(folder: Path, shape: Shape) -> Capture:
    """Open the capture that a shape folder says it was made from."""
    if not shape.notes.get("capture"):
        raise LightsphereError(f"{folder} does not say which capture it was made from; run lightsphere shape again")
    return Capture.open((folder / shape.notes["capture"]).resolve())


def promised(shape: Shape, capture: Capture, settings: ReflectanceSettings, goal: Goal) -> Promise:
    """Choose the settings of a fit for a goal, with a bar."""
    from ..core.tradeoff.reflectance import variants

    def choices(part: Capture) -> list[Variant]:
        return variants(shape.within(part.mask()), part, settings)

    return run_with_bar(foretold(choices, capture, recovered_pixels(shape, capture), goal))


def fitted(shape: Shape, capture: Capture, settings: ReflectanceSettings) -> Reflectance | Bivariate:
    """Fit the reflectance of a capture, with a bar."""
    from ..core.reflectance import fit, tables

    if settings.model == "bivariate":
        return run_with_bar(tables.fit(shape, capture, settings))
    return run_with_bar(fit.fit(shape, capture, settings))


def summary(notes: dict[str, Any]) -> str:
    """Say in one line what was found and how good it is."""
    roughness = ", ".join(f"{value:.3g}" for value in notes.get("roughness", ()))
    found = f"roughness {roughness}" if roughness else f"basis BRDFs {notes['bases']}"
    return f"{found}; material_rel_rms {notes['material_rel_rms']:.3g} on lights held out"


@settings_options(ReflectanceSettings)
def reflectance(
    shape: Annotated[Path, typer.Argument(help="folder of a shape; it names its capture")],
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of the reflectance")],
    settings: ReflectanceSettings,
    budget: Budget = None,
    target: Target = None,
    dry_run: DryRun = False,
    json: JsonFile = None,
) -> None:
    """Fit basis BRDFs and weight maps, or a lobe per pixel, on a known shape; state the error on lights held out.

    --budget and --target choose the model and its bases or clusters by that error.
    """
    goal = Goal(budget, target)
    with Figures("reflectance", json) as figures:
        opened = Shape.open(shape)
        capture = capture_of(shape, opened)
        if goal or dry_run:
            promise = promised(opened, capture, settings, goal)
            if dry_run:
                figures.foreseen(promise)
                return
            figures.promise = promise
            settings = dataclasses.replace(settings, **promise.expected.settings)
        found = fitted(opened, capture, settings)
        found = dataclasses.replace(found, notes={**found.notes, "shape": os.path.relpath(shape, output)})
        found.save(output)
        wanted = ("material_rel_rms", "material_rel_rms_median", "bases", "nodes_seen", "condition")
        figures.values.update({key: found.notes[key] for key in wanted if key in found.notes})
        figures.summary = f"{summary(found.notes)}; in {output}"
        figures.obtained({"material_rel_rms": found.notes["material_rel_rms"]})
