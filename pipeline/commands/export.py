"""What `lightsphere material` starts in a process of its own to export an asset: :mod:`pipeline.blender.exports`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def export_worker(
    blend: Annotated[Path, typer.Argument(help="the asset")],
    gltf: Annotated[Path | None, typer.Option(help="a .glb to write")] = None,
    usd: Annotated[Path | None, typer.Option(help="a USD file to write")] = None,
) -> None:
    """Export an asset's Principled version."""
    from ..blender.exports import export

    export(blend, gltf, usd)
