"""`lightsphere compare`: figures and an error map between two pictures, or between a shape and the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from ..core import images
from ..core.capture import FILE as CAPTURE_FILE
from ..core.capture import Capture
from ..core.compare import depth_error_pct, normal_error_deg, picture_error, relative_rmse, shape_errors
from ..core.errors import LightsphereError
from ..core.shape import FILE as SHAPE_FILE
from ..core.shape import Shape
from .stage import Figures, JsonFile


def compare(
    first: Annotated[Path, typer.Argument(help="an EXR picture, or the folder of a shape")],
    second: Annotated[
        Path, typer.Argument(help="the reference: an EXR picture, or the folder of a capture with truth")
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="the error map, a PNG", show_default="FIRST-error.png")
    ] = None,
    json: JsonFile = None,
) -> None:
    """Compare a picture with another, or a recovered shape with the truth of its capture."""
    from ..report.figures import heat

    with Figures("compare", json) as figures:
        if (first / SHAPE_FILE).is_file() and (second / CAPTURE_FILE).is_file():
            values, error, label = shape_with_truth(first, second)
        elif first.is_file() and second.is_file():
            values, error, label = pictures(first, second)
        else:
            raise LightsphereError(
                f"{first} and {second} cannot be compared; give two EXR pictures, or a shape folder and its capture"
            )
        path = output or first.with_name(f"{first.resolve().stem}-error.png")
        images.write_bytes(path, heat(error, label))
        figures.values.update(values)
        figures.summary = ", ".join(f"{name} {value:.4g}" for name, value in values.items()) + f"; map in {path}"


def pictures(first: Path, second: Path) -> tuple[dict[str, Any], NDArray[np.float64], str]:
    """Return the figures, the error map and its label of two pictures."""
    a, b = images.read_rgb(first), images.read_rgb(second)
    values = {"relight_rel_rmse": relative_rmse(a, b), "largest_difference": float(np.abs(a - b).max())}
    return values, picture_error(a, b), "difference over the reference's RMS"


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
