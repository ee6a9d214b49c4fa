"""`lightsphere capture`: render an OLAT capture of a built-in scene or a .blend."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.rig import CaptureSettings
from .stage import Figures, JsonFile, run_with_bar, settings_options


@settings_options(CaptureSettings)
def capture(
    scene: Annotated[str, typer.Argument(help="a built-in scene (see lightsphere scenes) or a .blend file")],
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of the capture")],
    settings: CaptureSettings,
    json: JsonFile = None,
) -> None:
    """Render one picture per light of a scene with Cycles; run it again to continue an interrupted one."""
    from ..blender import capture as blender
    from ..blender import scene as scenes

    with Figures("capture", json) as figures:
        made = run_with_bar(blender.capture(scenes.load(scene), scene, output, settings))
        figures.values["pictures"] = len(made)
        figures.summary = f"{len(made)} pictures of {scene} in {output}"
