"""`lightsphere tradeoff`: error against time of any stage, as table, CSV and plot."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from ..core import images
from ..core.capture import FILE as CAPTURE_FILE
from ..core.capture import Capture
from ..core.errors import LightsphereError
from ..core.inverse import InverseSettings
from ..core.progress import Work
from ..core.reflectance import FILE as REFLECTANCE_FILE
from ..core.reflectance import ReflectanceSettings
from ..core.relight import RelightSettings
from ..core.shape import FILE as SHAPE_FILE
from ..core.shape import Shape
from ..core.tradeoff import STAGES, Trial, as_row, dominated, measure
from .reflectance import capture_of
from .stage import Figures, JsonFile, print_trials, run_with_bar

#: What is timed, in the words of a plot's axis.
TIMED = {
    "capture": "seconds to render four small pictures",
    "shape": "seconds to solve the shape",
    "reflectance": "seconds to fit the reflectance",
    "material": "seconds to render a sphere",
    "relight": "seconds to relight twelve pictures",
    "inverse": "seconds to search",
}
TABLE, PLOT = "tradeoff.csv", "tradeoff.png"
BESIDE = ("recovered_pct",)  # the error to judge by


def tradeoff(
    source: Annotated[
        str,
        typer.Argument(help="a scene (capture; inverse with --photograph), or the folder that the stage starts from"),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of tradeoff.csv and tradeoff.png")],
    stage: Annotated[
        str,
        typer.Option(
            help=f"{', '.join(STAGES)}; auto: what follows on the source: capture for a scene, shape for a capture, "
            "reflectance for a shape, material for a reflectance or a BRDF file"
        ),
    ] = "auto",
    photograph: Annotated[
        Path | None, typer.Option(help="the picture of a known scene, for inverse", metavar="FILE")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace an earlier table")] = False,
    json: JsonFile = None,
) -> None:
    """Do a stage with several settings; state the error and time of each, and which are beaten by others.

    The error is against truth where the source has it, else on lights held out; of capture against pictures with far
    more samples, of inverse against the photograph. What is varied: bounces and samples (capture), lights, method and
    bases (shape), model and bases (reflectance), closures (material), lights and interpolation (relight), size, time
    and levels (inverse). Writes tradeoff.csv and tradeoff.png; Ctrl-C writes them with the settings done by then.
    """
    chosen = chosen_stage(source, stage, photograph)
    if (output / TABLE).exists() and not overwrite:
        raise LightsphereError(f"{output / TABLE} exists; choose another folder, or replace it with --overwrite")
    with Figures("tradeoff", json) as figures:
        output.mkdir(parents=True, exist_ok=True)
        trials, stopped = tried(chosen, source, photograph)
        beaten = dominated(trials)
        _print(trials, beaten)
        rows = [as_row(trial, better) for trial, better in zip(trials, beaten, strict=True)]
        write(output, chosen, trials, rows)
        figures.values |= {"stage": chosen, "trials": rows}
        front = [trial.label for trial, better in zip(trials, beaten, strict=True) if not better]
        figures.summary = f"{chosen}: best for their time: {'; '.join(front)}; {TABLE} and {PLOT} in {output}"
    if stopped:
        raise KeyboardInterrupt


def chosen_stage(source: str, stage: str, photograph: Path | None) -> str:
    """Return the stage that is asked for, or that follows on the source."""
    if stage not in ("auto", *STAGES):
        raise LightsphereError(f"stage is {stage!r}; choose one of auto, {', '.join(STAGES)}")
    if photograph is not None and stage in ("auto", "inverse"):
        return "inverse"
    if photograph is not None or stage == "inverse":
        raise LightsphereError("a photograph belongs to inverse, and inverse needs one; give --photograph and no other")
    if stage != "auto":
        return stage
    folder = Path(source)
    files = {REFLECTANCE_FILE: "material", SHAPE_FILE: "reflectance", CAPTURE_FILE: "shape"}
    found = next((follows for name, follows in files.items() if (folder / name).is_file()), None)
    if found is None and folder.is_dir():
        raise LightsphereError(f"{source} is no capture, shape or reflectance; give what an earlier stage wrote")
    return found or ("material" if folder.suffix in (".binary", ".npz") else "capture")


def tried(stage: str, source: str, photograph: Path | None) -> tuple[list[Trial], bool]:
    """Measure a stage's variants with a bar; return those that were done, and whether it was interrupted.

    Raises
    ------
    KeyboardInterrupt
        Where none was done yet.
    """
    if stage == "material":
        return run_with_bar(_material(Path(source))), False
    if stage == "capture":
        from ..blender import tradeoff as blender

        variants = run_with_bar(blender.of_capture(source))
    elif stage == "inverse":
        from ..blender import tradeoff as blender
        from ..blender.pictures import read

        assert photograph is not None
        variants = blender.of_inverse(source, read(photograph), InverseSettings())
    elif stage == "shape":
        from ..core.tradeoff import shape as shapes

        variants = shapes.variants(Capture.open(Path(source)))
    else:
        from ..core.tradeoff import reflectance, relight

        shape = Shape.open(Path(source))
        capture = capture_of(Path(source), shape)
        if stage == "reflectance":
            variants = reflectance.variants(shape, capture, ReflectanceSettings())
        else:
            variants = relight.variants(shape, capture, RelightSettings())
    found: list[tuple[Trial, Any]] = []
    stopped = False
    try:
        run_with_bar(measure(variants, stage != "inverse", found))
    except KeyboardInterrupt:
        if not found:
            raise
        stopped = True
    return [trial for trial, _ in found], stopped


def _material(source: Path) -> Work[list[Trial]]:
    from ..blender import tradeoff as blender
    from ..core.brdf.files import read_brdf
    from ..core.reflectance.bivariate import Bivariate, open_reflectance

    if source.is_file():
        return blender.of_material([read_brdf(source)], True)
    found = open_reflectance(source)
    if not isinstance(found, Bivariate):
        raise LightsphereError(f"{source} holds a lobe per pixel, which is Cycles' own closure; give one of tables")
    return blender.of_material([found.basis(k) for k in range(found.table.shape[2])], found.weights.shape[3] == 1)


def write(folder: Path, stage: str, trials: Sequence[Trial], rows: Sequence[dict[str, object]]) -> None:
    """Write the table and the plot."""
    from ..report.figures import tradeoff_plot

    sink = io.StringIO()
    writer = csv.DictWriter(sink, list(dict.fromkeys(name for row in rows for name in row)), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    images.write_text(folder / TABLE, sink.getvalue())
    images.write_bytes(folder / PLOT, tradeoff_plot(trials, TIMED[stage]))


def _print(trials: Sequence[Trial], beaten: Sequence[str]) -> None:
    names = [trials[0].error, *(name for name in BESIDE if name in trials[0].errors)]
    print_trials(trials, beaten, {name: lambda trial, name=name: trial.errors[name] for name in names})
