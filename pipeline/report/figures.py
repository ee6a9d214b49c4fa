"""The figures of a report: arrays in, PNG bytes out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import NDArray

from ..core.camera import Camera
from ..core.shape.mesh import Mesh
from ..core.tradeoff import WORDS, Trial, dominated
from . import style

LETTER, LINE = 4.7, 10.0  # usual width of a letter and height of a line of labels [points]
KEY_SIZE = (2.3, 0.46)  # inches; all keys alike, so that pictures beside each other line up


def scale_bar(low: float, high: float, colours: str, label: str, logarithmic: bool = False) -> bytes:
    """Draw a horizontal colour scale, its ends and, where it is logarithmic, its decades marked."""
    figure = Figure(figsize=KEY_SIZE)
    axes = figure.add_axes((0.08, 0.66, 0.84, 0.22))
    norm = LogNorm(low, high) if logarithmic else Normalize(low, high)
    ticks = np.geomspace(low, high, round(np.log10(high / low)) + 1) if logarithmic else np.linspace(low, high, 3)
    bar = figure.colorbar(ScalarMappable(norm, colours), cax=axes, orientation="horizontal", ticks=ticks)
    bar.outline.set_visible(False)
    bar.set_label(label, fontsize=7, labelpad=2)
    bar.ax.tick_params(size=0, labelsize=7, pad=2)
    bar.ax.minorticks_off()
    bar.ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
    return style.plot_png(figure, dpi=300, tight=False)


def word_scale(colours: str, low: str, high: str) -> bytes:
    """Draw a horizontal colour scale with a word at either end."""
    figure = Figure(figsize=KEY_SIZE)
    axes = figure.add_axes((0.08, 0.66, 0.84, 0.22))
    axes.imshow(np.linspace(0, 1, 256)[None], aspect="auto", cmap=colours)
    axes.set_axis_off()
    for place, words, side in ((0.08, low, "left"), (0.92, high, "right")):
        figure.text(place, 0.44, words, fontsize=7, color=style.SOFT, ha=side, va="center")
    return style.plot_png(figure, dpi=300, tight=False)


def normal_colours(normal: NDArray[Any]) -> NDArray[np.float64]:
    """Return camera-space normals (H, W, 3) as colours (H, W, 4): x, y, z from -1..1 to 0..1; NaN is transparent."""
    rgba = np.ones((*normal.shape[:2], 4))
    rgba[..., :3] = np.nan_to_num(0.5 * (normal + 1.0))
    rgba[..., 3] = np.isfinite(normal).all(-1)
    return rgba


def direction_key() -> bytes:
    """Draw what the colours of surface directions mean: a ball that faces the viewer."""
    span = np.linspace(-1, 1, 240)
    x, y = np.meshgrid(span, -span)
    inside = x**2 + y**2 < 1
    ball = np.stack([x, y, np.sqrt(np.where(inside, 1 - x**2 - y**2, 0))], axis=-1)
    figure = Figure(figsize=KEY_SIZE)
    axes = figure.add_axes((0.35, 0.02, 0.3, 0.96))
    axes.imshow(normal_colours(np.where(inside[..., None], ball, np.nan)))
    axes.set_axis_off()
    return style.plot_png(figure, dpi=300, tight=False)


def wireframe(mesh: Mesh, camera: Camera, azimuths: Sequence[float]) -> list[bytes]:
    """Draw a mesh as a wire-frame with hidden lines removed, from several sides.

    Parameters
    ----------
    mesh : Mesh
    camera : Camera
        The first view; the others are turned from it about the vertical.
    azimuths : sequence of float
        [degrees]

    Returns
    -------
    list of bytes
        One PNG a view, all to the same scale.
    """
    centre = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    views = [(mesh.vertices - centre) @ camera.orbited(centre, a).to_world[:3, :3] for a in azimuths]
    half = 1.04 * max(float(np.abs(view[:, :2]).max(axis=0)[0]) for view in views)
    tall = 1.04 * max(float(np.abs(view[:, 1]).max()) for view in views)
    return [_wire(view[mesh.faces], half, tall) for view in views]


def _wire(triangles: NDArray[np.float64], half: float, tall: float) -> bytes:
    figure = Figure(figsize=(4.2, 4.2 * tall / half))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim(-half, half)
    axes.set_ylim(-tall, tall)
    triangles = triangles[np.argsort(triangles[:, :, 2].mean(axis=1))]
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    facing = normal[:, 2] / np.maximum(np.linalg.norm(normal, axis=1), 1e-30)
    light = np.clip(normal @ (0.45, 0.55, 0.7) / np.maximum(np.linalg.norm(normal, axis=1), 1e-30), 0, 1)[:, None]
    front, back, edge = (np.array(to_rgb(c)) for c in ("#ffffff", "#e9cbb9", "#8d969d"))
    tone = np.where(facing[:, None] > 0, front * (0.78 + 0.22 * light), back)
    lines = np.where(facing[:, None] > 0, edge, to_rgb(style.WARM))
    axes.add_collection(PolyCollection(triangles[:, :, :2], facecolors=tone, edgecolors=lines, linewidths=0.25))
    return style.plot_png(figure, dpi=320, tight=False)


def tradeoff_plot(trials: Sequence[Trial], timed: str) -> bytes:
    """Plot error against seconds, both logarithmic, with the Pareto front as a line; say what was timed."""
    figure = Figure(figsize=(5.4, 3.1))
    draw_tradeoff(figure.add_subplot(), trials, timed)
    return style.plot_png(figure)


def draw_tradeoff(axes: Any, trials: Sequence[Trial], timed: str) -> None:
    """Draw the plot of :func:`tradeoff_plot` into axes."""
    error = trials[0].error
    trials = [trial for trial in trials if np.isfinite(trial.errors[error])]
    seconds = np.array([trial.seconds for trial in trials])
    errors = np.array([trial.errors[error] for trial in trials])
    order = np.argsort(seconds)
    on_front = np.array([not better for better in dominated(trials)])
    front = order[on_front[order]]
    axes.plot(seconds[front], errors[front], color=style.ACCENT, linewidth=1.2, zorder=1)
    axes.scatter(seconds[on_front], errors[on_front], s=42, color=style.ACCENT, zorder=2)
    axes.scatter(
        seconds[~on_front],
        errors[~on_front],
        s=42,
        facecolor=style.PAPER,
        edgecolor=style.WARM,
        linewidth=1.3,
        zorder=2,
    )
    axes.set_xscale("log")
    scaled = [(axes.xaxis, seconds)]
    if (errors > 0).all():
        axes.set_yscale("log")
        scaled.append((axes.yaxis, errors))
    for axis, values in scaled:
        wide = values.max() > 30 * values.min() > 0
        axis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_locator(NullLocator())
    axes.tick_params(size=0, labelsize=8)
    axes.grid(color=style.LINE, linewidth=0.6)
    axes.margins(0.2, 0.25)
    axes.set_xlabel(timed)
    axes.set_ylabel(WORDS[error])
    first = [*np.flatnonzero(on_front), *np.flatnonzero(~on_front)]
    _label(axes, [(trials[i].label, seconds[i], errors[i]) for i in first])


def _label(axes: Any, points: Sequence[tuple[str, float, float]]) -> None:
    """Write beside each point what it is, where there is room; the first ones choose, and what has none is left out."""
    axes.autoscale_view()
    per_point = axes.figure.dpi / 72
    at = [axes.transData.transform((x, y)) / per_point for _, x, y in points]  # in points of type, as sizes are
    taken = [(x - 4, y - 4, x + 4, y + 4) for x, y in at]
    left = axes.bbox.x0 / per_point  # beyond it are the numbers of the axis
    for (label, seconds, error), (x, y) in zip(points, at, strict=True):
        wide = LETTER * len(label)
        for dx, dy in ((7, 5), (7, -14), (-7 - wide, 5), (-7 - wide, -14), (-wide / 2, 9), (-wide / 2, -19)):
            box = (x + dx, y + dy, x + dx + wide, y + dy + LINE)
            if box[0] > left and not any(_overlap(box, other) for other in taken):
                taken.append(box)
                axes.annotate(label, (seconds, error), (dx, dy), textcoords="offset points", fontsize=8.5)
                break


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def heat(values: NDArray[Any], label: str, logarithmic: bool = True) -> bytes:
    """Draw an error map with its colour scale as one picture that stands by itself."""
    finite = values[np.isfinite(values) & (values > 0)]
    high = float(np.percentile(finite, 99.5)) if finite.size else 1.0
    low = max(float(np.percentile(finite, 1)), high * 1e-4) if finite.size else 0.1
    if not logarithmic or low >= high:
        low, high, logarithmic = 0.0, max(high, 1e-12), False
    figure = Figure(figsize=(5, 5 * values.shape[0] / values.shape[1] + 0.6), facecolor=style.PAPER)
    axes = figure.add_subplot()
    axes.set_axis_off()
    ground = matplotlib.colormaps[style.ERROR].with_extremes(bad=style.PAPER)
    norm = LogNorm(low, high, clip=True) if logarithmic else Normalize(low, high, clip=True)
    shown = np.where(np.isfinite(values), np.maximum(values, low), np.nan)
    drawn = axes.imshow(shown, cmap=ground, norm=norm, interpolation="nearest")
    bar = figure.colorbar(drawn, ax=axes, orientation="horizontal", fraction=0.04, pad=0.03)
    bar.outline.set_visible(False)
    bar.set_label(label)
    return style.plot_png(figure)
