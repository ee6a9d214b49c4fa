"""`lightsphere compare`: an asset, a shape or a picture beside what it should be: figures and error maps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from ..core import images
from ..core.capture import FILE as CAPTURE_FILE
from ..core.capture import Capture
from ..core.compare import CompareSettings
from ..core.compare.pictures import picture_error, relative_rmse
from ..core.compare.shapes import depth_error_pct, normal_error_deg, shape_errors
from ..core.errors import LightsphereError
from ..core.shape import FILE as SHAPE_FILE
from ..core.shape import Shape
from .device import Device, render_on
from .stage import Figures, JsonFile, run_with_bar, settings_options

PAGE = "comparison.html"
PICTURES = "pictures"


@settings_options(CompareSettings)
def compare(
    first: Annotated[Path, typer.Argument(help="the .blend of an asset, the folder of a shape, or an EXR picture")],
    second: Annotated[Path, typer.Argument(help="the reference: the folder of a capture, or an EXR picture")],
    settings: CompareSettings,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            help="the folder of an asset's comparison, else the error map, a PNG",
            show_default="FIRST-comparison or FIRST-error.png",
        ),
    ] = None,
    scene: Annotated[
        Path | None,
        typer.Option(help="the .blend that was captured, where it does not lie in the capture's folder or beside it"),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace an earlier comparison")] = False,
    device: Device = "auto",
    json: JsonFile = None,
) -> None:
    """Compare an asset with its capture, a picture with another, or a recovered shape with the truth of its capture.

    Cycles renders the asset under some of the captured lights, beside the captured pictures. Where the captured scene
    is at hand, it is rendered, too, under lights that the capture did not have, direct and with global illumination,
    and from a view that it did not have, with the asset in place of the object. The options on lights, view and bounces
    are of this alone. Every kind of picture gets its relative RMSE, FLIP, SSIM and an error map; a page shows them,
    and the pictures themselves are in the folder pictures.
    """
    with Figures("compare", json) as figures:
        if first.suffix == ".blend" and (second / CAPTURE_FILE).is_file():
            folder = output or first.with_name(f"{first.stem}-comparison")
            if (folder / PAGE).exists() and not overwrite:
                raise LightsphereError(f"{folder / PAGE} exists; choose another folder, or replace it with --overwrite")
            figures.values["device"] = render_on(device)
            figures.values.update(asset_with_capture(first, Capture.open(second), scene, settings, folder))
            found = figures.values["comparisons"]
            words = ", ".join(f"{name} {one['relight_rel_rmse']:.4g}" for name, one in found.items())
            figures.summary = f"relight_rel_rmse: {words}; look at {folder / PAGE}"
            return
        if (first / SHAPE_FILE).is_file() and (second / CAPTURE_FILE).is_file():
            values, error, label = shape_with_truth(first, second)
        elif first.is_file() and second.is_file():
            values, error, label = pictures(first, second)
        else:
            raise LightsphereError(
                f"{first} and {second} cannot be compared; give an asset's .blend or a shape's folder with the folder "
                "of its capture, or two EXR pictures"
            )
        from ..report.figures import heat

        path = output or first.with_name(f"{first.resolve().stem}-error.png")
        images.write_bytes(path, heat(error, label))
        figures.values.update(values)
        figures.summary = ", ".join(f"{name} {value:.4g}" for name, value in values.items()) + f"; map in {path}"


def asset_with_capture(
    path: Path, capture: Capture, scene: Path | None, settings: CompareSettings, folder: Path
) -> dict[str, Any]:
    """Render an asset beside its capture; write a page and error maps into a folder, and return the figures."""
    from ..blender import compare as blender
    from ..report.compare import figures_of, heat_map, report

    true = blender.true_scene(capture, scene)
    found = run_with_bar(blender.compare(path, capture, true, settings))
    values = [figures_of(one) for one in found]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / PICTURES).mkdir(exist_ok=True)
    for one in found:
        images.write_bytes(folder / f"{one.name}_error.png", heat_map(one))
        for light, (picture, reference) in enumerate(zip(one.pictures, one.references, strict=True)):
            images.write_rgb(folder / PICTURES / f"{one.name}_{light:04d}.exr", picture)
            images.write_rgb(folder / PICTURES / f"{one.name}_{light:04d}_reference.exr", reference)
    page = report(path.stem, capture.folder.resolve().name, found, values, true is not None)
    images.write_text(folder / PAGE, page)
    names = [one.name for one in found]
    return {"scene": true, "comparisons": dict(zip(names, values, strict=True))}


def pictures(first: Path, second: Path) -> tuple[dict[str, Any], NDArray[np.float64], str]:
    """Return the figures, the error map and its label of two pictures."""
    from ..report.compare import looks_of

    a, b = images.read_rgb(first), images.read_rgb(second)
    values = {"relight_rel_rmse": relative_rmse(a, b), "largest_difference": float(np.abs(a - b).max())}
    seen, alike = looks_of(a, b, np.ones(a.shape[:2], bool))
    return values | {"flip": seen, "ssim": alike}, picture_error(a, b), "difference over the reference's RMS"


def shape_with_truth(first: Path, second: Path) -> tuple[dict[str, Any], NDArray[np.float64], str]:
    """Return the figures, the error map and its label of a shape and the truth."""
    shape, capture = Shape.open(first), Capture.open(second)
    truth, mask = capture.truth(), capture.mask()
    if truth is None:
        raise LightsphereError(
            f"{second} has no truth.exr; only captures of rendered or scanned things can be compared with truth"
        )
    values = shape_errors(shape, truth, mask)
    if "depth_median_pct" in values:
        error, label = depth_error_pct(shape, truth), "depth error, % of the object's size"
    else:
        error, label = normal_error_deg(shape, truth), "angle between the normals, degrees"
    return values, np.where(mask, error, np.nan), label
