"""A pixel's objective against its depth, as a plot."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..core.shape.profile import Profile
from . import style


def plot(profile: Profile, row: int, column: int) -> bytes:
    """Return the plot as a PNG: both objectives, and where the depth was found.

    Parameters
    ----------
    profile : Profile
    row, column : int
        The pixel, as the title names it.
    """
    figure = Figure(figsize=(6.4, 3.6), facecolor=style.PAPER)
    axes = figure.add_subplot()
    curves = (
        (profile.joint, style.ACCENT, "one reflectance function fitted to all lights"),
        (profile.source, style.WARM, "outer lights against inner ones (Magda et al.)"),
    )
    for values, colour, label in curves:
        finite = np.isfinite(values)
        axes.plot(profile.depths[finite], np.maximum(values[finite], 1e-6), color=colour, linewidth=1.3, label=label)
    axes.axvline(profile.depth, color=style.INK, linewidth=0.8, linestyle=":")
    axes.set_yscale("log")
    axes.grid(color=style.LINE, linewidth=0.6)
    axes.set_xlabel("depth along the ray [m]")
    axes.set_ylabel("misfit of the pictures [%]")
    axes.set_title(
        f"row {row}, column {column}: {profile.depth:.5g} m ± {profile.deviation:.2g} m, {profile.lit} lights",
        fontsize=9,
        color=style.SOFT,
        loc="left",
    )
    axes.legend(frameon=False, fontsize=8)
    return style.plot_png(figure)
