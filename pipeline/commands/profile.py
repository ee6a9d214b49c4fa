"""`lightsphere profile`: the objective of one pixel against its depth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core import images
from ..core.capture import Capture
from ..core.shape.profile import profile as fitted
from ..core.shape.settings import ShapeSettings
from .stage import Figures, JsonFile, run_with_bar


def profile(
    capture: Annotated[Path, typer.Argument(help="folder of a capture with lights on two surfaces")],
    row: Annotated[int, typer.Option(help="row of the pixel, the topmost is 0 [px]")],
    column: Annotated[int, typer.Option(help="column of the pixel, the leftmost is 0 [px]")],
    output: Annotated[Path, typer.Option("--output", "-o", help="the plot, a PNG")] = Path("profile.png"),
    json: JsonFile = None,
) -> None:
    """Plot what a pixel's pictures say about its depth: why it is what it is, and what else it might have been.

    A sharp, deep valley is a sure depth. A flat one, or several, is a guess: too few lights reach the pixel, or they
    see it from too similar directions.
    """
    with Figures("profile", json) as figures:
        found = run_with_bar(fitted(Capture.open(capture), row, column, ShapeSettings()))
        from ..report.profile import plot

        images.write_bytes(output, plot(found, row, column))
        figures.values.update(
            {
                "depth": found.depth,
                "deviation": found.deviation,
                "lit": found.lit,
                "depths": found.depths.tolist(),
                "joint_pct": found.joint.tolist(),
                "source_pct": found.source.tolist(),
            }
        )
        figures.summary = f"{found.depth:.5g} m ± {found.deviation:.2g} m, {found.lit} lights; look at {output}"
