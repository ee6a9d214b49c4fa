"""`--device` of every command that renders with Cycles."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

Device = Annotated[
    str,
    typer.Option(
        "--device", help="what Cycles renders on: cpu, gpu, or auto, the GPU switched on in Blender's preferences"
    ),
]


def render_on(device: str) -> str:
    """Render on the processor or a GPU from here on; say so where a GPU is missing, and return the hardware's name."""
    from ..blender import devices

    found = devices.choose(device)
    if found.missing:
        print("lightsphere: Blender knows no GPU here; rendering on the processor", file=sys.stderr)
    return found.name
