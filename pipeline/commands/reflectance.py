"""`lightsphere reflectance`: albedo and one glossy lobe of every pixel on a known shape."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Annotated

import typer

from ..core.capture import Capture
from ..core.errors import LightsphereError
from ..core.reflectance import Reflectance, ReflectanceSettings
from ..core.shape import Shape
from .stage import Figures, JsonFile, run_with_bar, settings_options


def capture_of(folder: Path, shape: Shape) -> Capture:
    """Open the capture that a shape folder says it was made from."""
    if not shape.notes.get("capture"):
        raise LightsphereError(f"{folder} does not say which capture it was made from; run lightsphere shape again")
    return Capture.open((folder / shape.notes["capture"]).resolve())


def fitted(folder: Path, settings: ReflectanceSettings) -> tuple[Shape, Reflectance]:
    """Open a shape folder and fit the reflectance of its capture, with a bar."""
    from ..core.reflectance.fit import fit

    shape = Shape.open(folder)
    return shape, run_with_bar(fit(shape, capture_of(folder, shape), settings))


def summary(reflectance: Reflectance) -> str:
    """Say in one line what was found and how good it is."""
    notes = reflectance.notes
    roughness = ", ".join(f"{value:.3g}" for value in notes["roughness"])
    return f"roughness {roughness}; material_rel_rms {notes['material_rel_rms']:.3g} on lights held out"


@settings_options(ReflectanceSettings)
def reflectance(
    shape: Annotated[Path, typer.Argument(help="folder of a shape; it names its capture")],
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of the reflectance")],
    settings: ReflectanceSettings,
    json: JsonFile = None,
) -> None:
    """Fit albedo and one glossy lobe per pixel on a known shape, and state the error on lights held out."""
    with Figures("reflectance", json) as figures:
        _, found = fitted(shape, settings)
        found = dataclasses.replace(found, notes={**found.notes, "shape": os.path.relpath(shape, output)})
        found.save(output)
        figures.values.update({key: found.notes[key] for key in ("material_rel_rms", "material_rel_rms_median")})
        figures.summary = f"{summary(found)}; in {output}"
