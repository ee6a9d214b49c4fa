"""`lightsphere material`: a recovered reflectance, or a BRDF file, as a node material in a .blend that renders."""

from __future__ import annotations

import dataclasses
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..core import images
from ..core.brdf import Brdf
from ..core.errors import LightsphereError
from ..core.material import MaterialSettings
from ..core.material.principled import Principled
from ..core.material.surface import Surface, bases_of, surface, uniform
from ..core.progress import Work
from ..core.reflectance import FILE as REFLECTANCE_FILE
from ..core.reflectance import Reflectance, ReflectanceSettings
from ..core.reflectance.bivariate import Bivariate, open_reflectance, read_notes
from ..core.shape import FILE as SHAPE_FILE
from ..core.shape import Shape
from ..core.tradeoff.goal import Goal
from .device import Device, render_on
from .reflectance import capture_of
from .stage import Budget, DryRun, Figures, JsonFile, Target, run_with_bar, settings_options

OF_MIXTURE = (
    *("lobes", "material_rel_rms", "cube_root_rel_rms", "reciprocity_error", "albedo", "error_by_view"),
    *("error_by_lobes", "rendered_rel_rms", "rendered_table_rel_rms", "render_cost", "texels_lowered", "condition"),
)
OF_ONE_LOBE = ("material_rel_rms", "material_rel_rms_median", "roughness")
Recovered = Reflectance | Bivariate | Brdf
Opened = tuple[Shape | None, Path, Recovered]  # no shape for a BRDF file; the folder that paths of notes start from


@settings_options(MaterialSettings)
def material(
    source: Annotated[
        Path, typer.Argument(help="folder of a shape or of a reflectance, or a BRDF file: MERL .binary, .npz")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="the .blend to write; its report goes beside it")],
    settings: MaterialSettings,
    gltf: Annotated[Path | None, typer.Option(help="export as glTF 2.0, a .glb", metavar="FILE")] = None,
    usd: Annotated[Path | None, typer.Option(help="export as USD with MaterialX", metavar="FILE")] = None,
    pbr: Annotated[Path | None, typer.Option(help="write plain PBR textures into a folder", metavar="DIR")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace an existing file")] = False,
    budget: Budget = None,
    target: Target = None,
    dry_run: DryRun = False,
    device: Device = "auto",
    json: JsonFile = None,
) -> None:
    """Write asset.blend: mesh with UVs, a node material of Cycles' own closures, camera, lights and sky.

    The mesh is the one that the shape was taken from, or a relief through the shape's pixels; the material of a BRDF
    file comes on a ball. The material carries its own errors, and a page beside it, asset.html, shows them: against
    what was recovered, against Cycles' own picture of it, and what each closure more costs to render; asset_bases.png
    shows each basis on balls and over angles. Exports for other programs are of the nearest Principled BSDF, whose
    error is stated beside.

    --budget and --target choose how many closures there are, by the error of the fit.
    """
    from ..blender import exports

    goal = Goal(budget, target)
    if output.suffix != ".blend":
        raise LightsphereError(f"{output} is no .blend file; name the asset like asset.blend")
    exports.check_names(gltf, usd)
    for path in (output, output.with_suffix(".html"), bases_file(output), gltf, usd, pbr):
        if path is not None and path.exists() and not overwrite:
            raise LightsphereError(f"{path} exists; choose another name, or replace it with --overwrite")
    with Figures("material", json) as figures:
        figures.values["device"] = render_on(device)
        given = run_with_bar(opened(source))
        shape, _, found = given
        if goal or dry_run:
            from ..blender import material_goal

            if isinstance(found, Reflectance):
                raise LightsphereError(
                    f"{source} holds a lobe per pixel, which is Cycles' own closure: there is nothing to choose; leave "
                    "--budget, --target and --dry-run out"
                )
            promise = run_with_bar(material_goal.promised(partial(closures, found), goal))
            if dry_run:
                figures.foreseen(promise)
                return
            figures.promise = promise
            settings = dataclasses.replace(settings, **promise.expected.settings)
        output.parent.mkdir(parents=True, exist_ok=True)
        wanted = settings.principled or any((gltf, usd, pbr))
        name = source.stem if shape is None else "Recovered"
        figures.values.update(run_with_bar(made(given, name, output, settings, wanted, pbr)))
        if gltf or usd:
            exports.run(output, gltf, usd)
        figures.summary = f"{summary(figures.values)}; in {output}"
        if goal:
            figures.obtained({"material_rel_rms": float(np.mean(figures.values["material_rel_rms"]))})


def made(
    given: Opened, name: str, output: Path, settings: MaterialSettings, principled: bool, pbr: Path | None
) -> Work[dict[str, Any]]:
    """Make the asset of what was recovered, with a page beside it and PBR textures in a folder; return the figures."""
    from ..blender import asset, scanned_asset
    from ..core.material.principled import fit_principled

    shape, folder, recovered = given
    found: Reflectance | Surface
    if isinstance(recovered, Reflectance):
        found = recovered
    else:
        found = yield from closures(recovered, settings.lobes)
    nearest = fit_principled(*bases_of(found)) if principled else None
    shown: tuple[str, bytes] | None = None
    if isinstance(found, Surface):
        found, shown = yield from judged(found, nearest, output.stem)
    if shape is not None and (scan := shape.notes.get("mesh")):
        mesh = (folder / scan).resolve()
        figures = scanned_asset.write(output, shape, mesh, found, settings, nearest, pbr, overwrite=True)
    else:
        figures = asset.write(output, shape, found, name, settings, nearest, pbr, overwrite=True)
    if shown is not None:
        images.write_text(output.with_suffix(".html"), shown[0])
        images.write_bytes(bases_file(output), shown[1])
    wanted = OF_MIXTURE if isinstance(found, Surface) else OF_ONE_LOBE
    figures |= {key: found.notes[key] for key in wanted if key in found.notes}
    return figures | (nearest.notes if nearest is not None else {})


def closures(recovered: Bivariate | Brdf, most: int) -> Work[Surface]:
    """Return what was recovered as at most so many closures."""
    if isinstance(recovered, Bivariate):
        return surface(recovered, most)
    return uniform([recovered], most)


def opened(source: Path) -> Work[Opened]:
    """Return the shape of a source and its folder, and what its material is to show."""
    if source.is_file():
        from ..core.brdf.files import read_brdf

        return None, source.parent, read_brdf(source)
    folder, recovered = source, source / "reflectance"
    if (source / REFLECTANCE_FILE).is_file():
        recovered = source
        folder = source / read_notes(source).get("shape", "..")
    if not (folder / SHAPE_FILE).is_file():
        raise LightsphereError(f"{source} is no shape, reflectance or BRDF file; give what an earlier stage wrote")
    shape = Shape.open(folder)
    if (recovered / REFLECTANCE_FILE).is_file():
        return shape, folder, open_reflectance(recovered)
    from ..core.reflectance import tables

    return shape, folder, (yield from tables.fit(shape, capture_of(folder, shape), ReflectanceSettings()))


def bases_file(asset: Path) -> Path:
    """Return where the picture of an asset's bases lies."""
    return asset.with_name(f"{asset.stem}_bases.png")


def judged(found: Surface, nearest: Principled | None, name: str) -> Work[tuple[Surface, tuple[str, bytes]]]:
    """Render a surface's bases by Cycles; return the surface with what was found, its page and its bases' picture."""
    from ..blender.render_cost import relative_cost
    from ..blender.round_trip import round_trip
    from ..report.material import Results, bases_picture, report

    turn = yield from round_trip(found.mixture, found.bases)
    costs = yield from relative_cost(found.mixture)
    results = Results(name, found, turn.pictures, turn.against_table, costs, nearest)
    notes = {
        "rendered_rel_rms": turn.against_mixture.tolist(),
        "rendered_table_rel_rms": turn.against_table.tolist(),
        "render_cost": costs[-1],
    }
    return dataclasses.replace(found, notes=found.notes | notes), (report(results), bases_picture(results))


def summary(figures: dict[str, Any]) -> str:
    """Say in one line what was made and how good it is."""
    words = f"{figures['triangles']} triangles, "
    if "lobes" in figures:
        errors = ", ".join(f"{error:.3g}" for error in figures["material_rel_rms"])
        return words + f"{len(figures['lobes'])} closures, material_rel_rms {errors}"
    roughness = ", ".join(f"{value:.3g}" for value in figures["roughness"])
    return words + f"roughness {roughness}; material_rel_rms {figures['material_rel_rms']:.3g} on lights held out"
