"""`lightsphere tradeoff`: error against time of the shape stage, as table, CSV and plot."""

from __future__ import annotations

import csv
import dataclasses
import io
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from ..core import images
from ..core.capture import Capture
from ..core.shape.settings import ShapeSettings
from ..core.tradeoff import Trial, as_row, dominated, light_counts, try_variants
from .stage import Figures, JsonFile, run_with_bar

FRACTIONS = (0.125, 0.25, 0.5, 1.0)
SOURCE_FRACTIONS = (0.25, 1.0)


def tradeoff(
    capture: Annotated[Path, typer.Argument(help="folder of a capture under lights on two nested surfaces")],
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of tradeoff.csv and tradeoff.png")],
    json: JsonFile = None,
) -> None:
    """Solve the shape with fewer lights and with the source's objective; state error, seconds and what is beaten."""
    from ..report.figures import tradeoff_plot

    opened = Capture.open(capture)
    variants = light_counts(opened, FRACTIONS, ShapeSettings())
    source = dataclasses.replace(ShapeSettings(), objective="source")
    variants += light_counts(opened, SOURCE_FRACTIONS, source)
    with Figures("tradeoff", json) as figures:
        trials = [trial for trial, _ in run_with_bar(try_variants(opened, variants))]
        error = "depth_median_pct" if "depth_median_pct" in trials[0].errors else "material_rel_rms"
        beaten = dominated(trials, error)
        _print(trials, error, beaten)
        output.mkdir(parents=True, exist_ok=True)
        rows = [as_row(trial, better) for trial, better in zip(trials, beaten, strict=True)]
        sink = io.StringIO()
        writer = csv.DictWriter(sink, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        images.write_text(output / "tradeoff.csv", sink.getvalue())
        images.write_bytes(output / "tradeoff.png", tradeoff_plot(trials, error, WORDS[error]))
        figures.values["trials"] = rows
        front = [trial.label for trial, better in zip(trials, beaten, strict=True) if not better]
        figures.summary = f"best for their time: {', '.join(front)}; tradeoff.csv and tradeoff.png in {output}"


WORDS = {"depth_median_pct": "median depth error, % of the object", "material_rel_rms": "error on lights held out"}


def _print(trials: list[Trial], error: str, beaten: list[str]) -> None:
    names = [name for name in ("recovered_pct", error, "depth_p95_pct") if name in trials[0].errors]
    table = Table("lights", "seconds", *names, "beaten by")
    for trial, better in zip(trials, beaten, strict=True):
        table.add_row(trial.label, f"{trial.seconds:.2f}", *(f"{trial.errors[name]:.3g}" for name in names), better)
    Console().print(table)
