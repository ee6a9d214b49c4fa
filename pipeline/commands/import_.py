"""`lightsphere import`: make a capture from photographs."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ..core.errors import LightsphereError
from ..core.photographs.photographs import Photographs
from ..core.photographs.settings import ImportSettings
from .stage import Figures, JsonFile, run_with_bar, settings_options


@settings_options(ImportSettings)
def import_photographs(
    path: Annotated[Path, typer.Argument(help="folder of photographs, RTI .lp list, or .npz stack")],
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of the capture")],
    settings: ImportSettings,
    json: JsonFile = None,
) -> None:
    """Make a capture from photographs: DiLiGenT, RTI, any folder with a list of lights, spheres, or lights unknown."""
    from ..blender import pictures
    from ..core.photographs.calibration import calibrated
    from ..core.photographs.develop import develop
    from ..core.photographs.formats import find

    if output.resolve() == (path if path.is_dir() else path.parent).resolve():
        raise LightsphereError(f"{output} is the folder of the photographs; give the capture a folder of its own")
    with Figures("import", json) as figures:
        found = find(path, settings, pictures.read)
        if settings.checkerboard:
            found, settings = _by_checkerboard(found, settings)
        if settings.chrome or settings.gray:
            found, settings = run_with_bar(calibrated(found, settings, pictures.read))
        made = run_with_bar(develop(found, path, output, settings))
        figures.values.update(made.notes["found"])
        figures.summary = summary(made.notes["found"], output)
    for warning in made.notes["found"]["warnings"]:
        print(f"lightsphere: {path}: {warning}", file=sys.stderr)


def _by_checkerboard(found: Photographs, settings: ImportSettings) -> tuple[Photographs, ImportSettings]:
    """Return the same with the focal length that photographs of a checkerboard tell."""
    from ..blender.checkerboard import lens

    if settings.focal or found.camera is not None:
        raise LightsphereError("the lens is stated already; leave --checkerboard out, or --focal")
    told = run_with_bar(lens(Path(settings.checkerboard), settings.corners))
    pixels = found.shots[0][0].read().pixels
    if max(told.size) * min(pixels.shape[:2]) != min(told.size) * max(pixels.shape[:2]):
        raise LightsphereError(
            f"the checkerboard's photographs are {told.size[0]}x{told.size[1]} pixels, the object's "
            f"{pixels.shape[1]}x{pixels.shape[0]}; take all by one camera and crop none"
        )
    measured = {"focal_deviation_mm": told.deviation, "checkerboards": told.seen}
    notes = {**found.notes, "calibration": {**found.notes.get("calibration", {}), **measured}}
    return dataclasses.replace(found, notes=notes), dataclasses.replace(settings, focal=told.focal)


def summary(found: dict[str, Any], output: Path) -> str:
    """Return in one line what was found, measured and assumed."""
    width, height = found["size"]
    exposures = f" of {found['exposures']} exposures" if found["exposures"] > 1 else ""
    bits = "floats" if found["bit_depth"] == 32 else f"{found['bit_depth']} bits"
    words = [
        f"{found['lights']} {found['light_kind']} lights{exposures}",
        f"{width}x{height} pixels of {bits}, response {found['response']}",
        f"format {found['format']}",
    ]
    if "directions" in found:
        words.append(f"directions of the {found['directions']}")
    if "checkerboards" in found:
        words.append(f"a lens of {found['focal_mm']:.4g} +- {found['focal_deviation_mm']:.2g} mm by the checkerboard")
    words += [f"light_mae_deg {found['light_mae_deg']:.3g}"] if "light_mae_deg" in found else []
    words += [f"gray_error_pct {name} {error:.3g}" for name, error in found.get("gray_error_pct", {}).items()]
    words += [f"assumed: {'; '.join(found['assumed'])}"] if found["assumed"] else []
    return f"{', '.join(words)}; in {output}"
