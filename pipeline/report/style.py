"""One look for page and plots: paper, ink, two accents; maps of colour that are even to the eye."""

from __future__ import annotations

import io
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import font_manager, image
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..core import images

PAPER = "#fbfaf7"
INK = "#22262b"
SOFT = "#737a82"
LINE = "#dcd8cf"
ACCENT = "#1d6f72"
WARM = "#c2572b"

DEPTH = "cividis_r"
ERROR = "magma"
CONFIDENCE = "cividis"

_FONTS = [name for name in ("Inter", "Helvetica Neue", "Arial") if name in font_manager.get_font_names()]
matplotlib.rcParams.update(
    {
        "font.family": [*_FONTS, "DejaVu Sans"],
        "font.size": 9,
        "text.color": INK,
        "axes.edgecolor": LINE,
        "axes.labelcolor": SOFT,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.facecolor": "none",
        "figure.facecolor": "none",
        "savefig.facecolor": "none",
        "xtick.color": SOFT,
        "ytick.color": SOFT,
        "xtick.labelsize": 8,
        "ytick.labelsize": 8,
    }
)


def plot_png(figure: Figure, dpi: int = 200, tight: bool = True) -> bytes:
    """Return a figure as the bytes of a PNG file, cut to what is drawn or of its own size; the ground is its own."""
    sink = io.BytesIO()
    box = {"bbox_inches": "tight", "pad_inches": 0.04} if tight else {}
    figure.savefig(sink, format="png", dpi=dpi, facecolor="auto", **box)
    return sink.getvalue()


def picture_png(pixels: NDArray[Any]) -> bytes:
    """Return (H, W, 3) or (H, W, 4) values from 0 to 1 as the bytes of a PNG file."""
    sink = io.BytesIO()
    image.imsave(sink, np.round(255 * np.clip(pixels, 0.0, 1.0)).astype(np.uint8), format="png")
    return sink.getvalue()


def display(radiance: NDArray[Any], exposure: float = 1.0) -> NDArray[np.float64]:
    """Return linear radiance as sRGB values from 0 to 1 (IEC 61966-2-1); what is brighter than white is cut off."""
    return images.srgb(np.clip(exposure * np.asarray(radiance, np.float64), 0.0, 1.0))


def exposure_for(radiance: NDArray[Any], percentile: float = 99.0) -> float:
    """Return the exposure at which so many per cent of the lit values are below white."""
    lit = np.asarray(radiance)[np.asarray(radiance) > 0]
    return 1.0 / float(np.percentile(lit, percentile)) if lit.size else 1.0


def mapped(
    values: NDArray[Any], low: float, high: float, colours: str, logarithmic: bool = False
) -> NDArray[np.float64]:
    """Return (H, W) values as (H, W, 4) colours; NaN is transparent."""
    with np.errstate(invalid="ignore", divide="ignore"):
        if logarithmic:
            values, low, high = np.log(np.maximum(values, low)), np.log(low), np.log(high)
        share = np.clip((values - low) / max(high - low, 1e-30), 0.0, 1.0)
    rgba = matplotlib.colormaps[colours](np.nan_to_num(share))
    rgba[..., 3] = np.isfinite(values)
    return np.asarray(rgba)
