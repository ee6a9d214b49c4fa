"""`lightsphere shape`: depth, normals and confidence of every pixel from a capture."""

from __future__ import annotations

import dataclasses
import os
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from ..core import images
from ..core.capture import Capture, with_lights
from ..core.compare.shapes import light_errors, shape_errors
from ..core.errors import LightsphereError
from ..core.lights import Lights
from ..core.progress import Work
from ..core.reflectance import FILE as REFLECTANCE_FILE
from ..core.reflectance.bivariate import read_notes
from ..core.shape import Shape
from ..core.shape.double_sphere import recover
from ..core.shape.mesh import relief
from ..core.shape.photometric import recover as photometric
from ..core.shape.ply import write_ply
from ..core.shape.settings import ShapeSettings
from ..core.shape.uncalibrated import recover as uncalibrated
from ..core.tradeoff.goal import Goal
from ..core.tradeoff.shape import promised
from ..core.tradeoff.thinning import thinned_to
from .stage import Budget, DryRun, Figures, JsonFile, Target, run_with_bar, settings_options

MeshFile = Annotated[
    Path | None,
    typer.Option("--mesh", help="take the shape from a mesh: PLY, OBJ, glTF or USD", metavar="FILE"),
]
WITH_REFLECTANCE = ("acls", "uncalibrated")
OF_BASES = ("bases", "objective", "start_explains_better", "nodes_seen", "held_out")
PAGE = "report.html"
LEFT_OUT = ("saturated_values", "broken_values")
NOTED = (*LEFT_OUT, "condition")
NAMED = 5  # changed pictures that a warning names


@settings_options(ShapeSettings)
def shape(
    capture: Annotated[Path, typer.Argument(help="folder of a capture; uncalibrated needs no lights")],
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of the shape")],
    settings: ShapeSettings,
    mesh: MeshFile = None,
    mesh_unit: Annotated[float, typer.Option(help="length of the unit of --mesh or --proxy [m]", min=1e-9)] = 1.0,
    budget: Budget = None,
    target: Target = None,
    dry_run: DryRun = False,
    json: JsonFile = None,
) -> None:
    """Recover depth and normals of every pixel, for any BRDF; by acls and uncalibrated its reflectance, too.

    --budget and --target choose how many pictures are used, of acls also how many bases. The error that they promise is
    told without truth: of double-sphere the median of the error that depths are expected to have, per cent of the
    object; of acls and lambertian the median angle that normals are expected to be off, degrees.
    """
    goal = Goal(budget, target)
    if mesh and (goal or dry_run):
        raise LightsphereError("a mesh is taken as it is; leave --budget, --target and --dry-run out")
    if settings.interreflections and (mesh or settings.method not in WITH_REFLECTANCE):
        raise LightsphereError(f"--interreflections needs what the object reflects: {' or '.join(WITH_REFLECTANCE)}")
    if settings.interreflections and (goal or dry_run):
        raise LightsphereError(
            "the cost of --interreflections is not foreseen; leave --budget, --target, --dry-run out"
        )
    whole = Capture.open(capture)
    with Figures("shape", json) as figures:
        if goal or dry_run:
            promise, judged = run_with_bar(promised(whole, settings, goal))
            if dry_run:
                figures.foreseen(promise)
                return
            figures.promise = promise
            settings = dataclasses.replace(settings, **promise.expected.settings)
        opened = thinned_to(whole, settings.pictures)
        start = time.perf_counter()
        reflectance, source, given = None, capture, opened
        doubts: tuple[str, ...] = ()
        lights: Lights | None = None
        if mesh:
            found = _scanned(opened, mesh, mesh_unit, output)
        elif settings.method == "double-sphere":
            found = run_with_bar(recover(opened, settings))
        elif settings.method == "uncalibrated":
            proxy = _proxy(opened, settings, mesh_unit)
            every, given = run_with_bar(
                _without_interreflections(
                    opened, lambda one, before: uncalibrated.recover(one, settings, proxy, before), settings, output
                )
            )
            found, reflectance, doubts, lights = every.shape, every.reflectance, every.doubts, every.lights
            source = output / "capture"
            with_lights(opened, lights, source)
            figures.values["lights"] = found.notes["lights"]
            figures.values["light_deviation_deg"] = float(every.deviation.mean())
        else:
            both, given = run_with_bar(
                _without_interreflections(
                    opened, lambda one, before: photometric.recover(one, settings), settings, output
                )
            )
            found, reflectance = both.shape, both.reflectance
        figures.values["solve_seconds"] = time.perf_counter() - start
        found.notes["settings"] = dataclasses.asdict(settings)
        found.notes["capture"] = os.path.relpath(source, output)
        if not (found.confidence > 0).any():
            raise LightsphereError(
                f"{capture}: no pixel is lit by {settings.min_lit} lights or more; "
                "look at the pictures, or lower --min-lit"
            )
        truth = opened.truth()
        errors: dict[str, Any] = shape_errors(found, truth, opened.mask()) if truth is not None else {}
        if lights is not None:
            errors.update(light_errors(lights, opened.lights, found, truth))
        found.notes["errors"] = errors
        found.save(output)
        if reflectance is not None:
            notes = {**reflectance.notes, "shape": "..", "capture": os.path.relpath(source, output / "reflectance")}
            dataclasses.replace(reflectance, notes=notes).save(output / "reflectance")
            figures.values.update({key: reflectance.notes[key] for key in OF_BASES if key in reflectance.notes})
        write_ply(output / "mesh.ply", relief(found))
        if reflectance is None:
            _forget_reflectance(output)
        if lights is not None:
            from ..report import uncalibrated as page

            shown = dataclasses.replace(given, lights=lights)
            results = page.Results(output.name, shown, found, reflectance, figures.values["solve_seconds"])
            images.write_text(output / PAGE, page.report(results))
        left_out = {name: found.notes[name] for name in LEFT_OUT if name in found.notes}
        figures.values.update(errors, **{name: found.notes[name] for name in NOTED if name in found.notes})
        if mesh:
            figures.values["silhouette_overlap_pct"] = found.notes["silhouette_overlap_pct"]
        words = ", ".join(f"{name} {value:.4g}" for name, value in errors.items())
        words = words or f"depth of {int((found.confidence > 0).sum())} pixels in {output}"
        words += "".join(f", {name} {count}" for name, count in left_out.items() if count)
        words += ", a matte surface explains all but noise" if found.notes.get("matte") else ""
        figures.summary = words + (
            f", silhouette_overlap_pct {found.notes['silhouette_overlap_pct']:.3g}" if mesh else ""
        )
        if goal:
            figures.obtained(judged(found))
    for doubt in doubts:
        print(f"lightsphere: {capture}: {doubt}", file=sys.stderr)
    _warn_of_changes(opened)


def _without_interreflections(
    capture: Capture, solve: Callable[[Capture, Any], Work[Any]], settings: ShapeSettings, output: Path
) -> Work[tuple[Any, Capture]]:
    """Return what is found, and the pictures in which it is."""
    if not settings.interreflections:
        return (yield from solve(capture, None)), capture
    from ..blender.interreflections import taken_out

    return (yield from taken_out(capture, solve, settings.interreflections, output / "direct"))


def _forget_reflectance(shape: Path) -> None:
    """Remove a reflectance that an earlier run left beside the shape that was there: material would take it."""
    folder = shape / "reflectance"
    if (folder / REFLECTANCE_FILE).is_file() and read_notes(folder).get("shape") == "..":
        shutil.rmtree(folder)


def mesh_worker(mesh: Annotated[Path, typer.Argument(help="the file")]) -> None:
    """Read a mesh where its importer may die."""
    from ..blender.scans import bring

    bring(mesh)


def _proxy(capture: Capture, settings: ShapeSettings, unit: float) -> Shape | None:
    """Return what the camera sees of the rough mesh, if there is one."""
    if not settings.proxy:
        return None
    from ..blender.scans import shape_of

    return shape_of(capture, Path(settings.proxy), unit)


def _scanned(capture: Capture, mesh: Path, unit: float, output: Path) -> Shape:
    """Return what the camera sees of a mesh, with where its file is from the shape's folder."""
    from ..blender.scans import shape_of

    found = shape_of(capture, mesh, unit)
    found.notes["mesh"] = os.path.relpath(mesh, output)
    return found


def _warn_of_changes(capture: Capture) -> None:
    """Say on stderr which pictures are not those recorded; one that was replaced on purpose may well be used."""
    changed = [name for name in capture.changed() if (capture.folder / name).is_file()]
    if changed:
        names = ", ".join(changed[:NAMED]) + (f" and {len(changed) - NAMED} more" if len(changed) > NAMED else "")
        print(
            f"lightsphere: {capture.folder}: {names} changed after being recorded; "
            "if that was not meant, delete them and run lightsphere capture again",
            file=sys.stderr,
        )
