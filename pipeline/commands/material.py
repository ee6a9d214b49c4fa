"""`lightsphere material`: the recovered mesh with a node material, in a .blend that renders as it is opened."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import LightsphereError
from ..core.reflectance import ReflectanceSettings
from .reflectance import fitted, summary
from .stage import Figures, JsonFile, settings_options


@settings_options(ReflectanceSettings)
def material(
    shape: Annotated[Path, typer.Argument(help="folder of a shape; it names its capture")],
    output: Annotated[Path, typer.Option("--output", "-o", help="the .blend to write")],
    settings: ReflectanceSettings,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace an existing file")] = False,
    json: JsonFile = None,
) -> None:
    """Write asset.blend: mesh with UVs, packed textures in a node material, camera, lights and sky.

    The mesh is the one that the shape was taken from, or a relief through the shape's pixels.
    """
    from ..core.shape.mesh import relief

    if output.suffix != ".blend":
        raise LightsphereError(f"{output} is no .blend file; name the asset like asset.blend")
    if output.exists() and not overwrite:
        raise LightsphereError(f"{output} exists; choose another name, or replace it with --overwrite")
    with Figures("material", json) as figures:
        opened, found = fitted(shape, settings)
        from ..blender import asset, scanned_asset

        if scan := opened.notes.get("mesh"):
            made = scanned_asset.write(output, opened, (shape / scan).resolve(), found, overwrite)
        else:
            mesh = relief(opened)
            asset.write(output, opened, mesh, found, "Recovered", overwrite)
            made = {"vertices": len(mesh.vertices), "triangles": len(mesh.faces)}
        figures.values.update({key: found.notes[key] for key in ("material_rel_rms", "material_rel_rms_median")})
        figures.values.update(made)
        figures.summary = f"{made['triangles']} triangles, {summary(found)}; in {output}"
