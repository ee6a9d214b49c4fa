"""`lightsphere scenes`: list the built-in scenes with the effects that each contains."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from ..core.errors import LightsphereError
from .device import Device, render_on
from .stage import run_with_bar


def scenes(
    photograph: Annotated[
        str | None, typer.Option(help="render this room as it is, to have a picture for inverse", metavar="ROOM")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="the picture to write")] = Path("photograph.exr"),
    device: Device = "auto",
) -> None:
    """List the built-in scenes with the effects that each contains; photograph a room."""
    from ..blender.scene import library

    if photograph is not None:
        if photograph not in library() or not library()[photograph].room:
            rooms = [name for name, entry in library().items() if entry.room]
            raise LightsphereError(f"{photograph!r} is no room; photograph one of {', '.join(rooms)}")
        render_on(device)
        from ..blender.inverse.photograph import photographed

        run_with_bar(photographed(photograph, output))
        print(f"scenes: {photograph} in {output}")
        return

    table = Table("scene", "what it shows", "effects")
    for name, entry in library().items():
        table.add_row(name, entry.description, ", ".join(entry.effects))
    Console().print(table)
