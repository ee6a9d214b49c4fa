"""The page of a material: how faithful it is, what that costs to render, and how Cycles shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..core.brdf import Brdf
from ..core.material import Mixture
from ..core.material.fit import VIEWS
from ..core.material.principled import Principled
from ..core.material.surface import Surface
from . import figures, html, style

SUNS = (0, 4, 7)  # of the round trip: from the view, from the side, from behind
OF_PRINCIPLED = ("principled_rel_rms", "principled_cube_root_rel_rms")
SLICES = (5.0, 45.0, 70.0)  # theta_d [degrees]


@dataclass(frozen=True)
class Results:
    """What the page shows.

    Parameters
    ----------
    name : str
    surface : Surface
    pictures : (K, L, H, W, 3) float32
        Every basis on a ball, rendered by Cycles under single suns.
    rendered : (K,) float64
        Relative RMS of these pictures against the basis BRDFs.
    costs : sequence of float
        Render time over that of one Principled BSDF with the same texture, for 0, 1, .. lobes.
    principled : Principled or None
        The nearest Principled BSDF, where it was asked for.
    """

    name: str
    surface: Surface
    pictures: NDArray[np.float32]
    rendered: NDArray[np.float64]
    costs: Sequence[float]
    principled: Principled | None


def report(r: Results) -> str:
    """Return the page."""
    parts = [_head(r), _errors(r), _spheres(r), _slices(r), _cost(r)]
    if r.surface.weights.shape[0] > 1:
        parts.append(_weights(r))
    return html.page(f"Material of {r.name}", parts)


def bases_picture(r: Results) -> bytes:
    """Draw every basis in a row, as a PNG: on balls under the suns of :func:`_spheres`, and over angles."""
    count = len(r.pictures)
    figure = Figure(figsize=(9.6, 2.4 * count), facecolor=style.PAPER, layout="constrained")
    rows = figure.subplots(count, len(SUNS) + 1, squeeze=False, width_ratios=[1.0] * len(SUNS) + [1.6])
    for k, (axes, pictures) in enumerate(zip(rows, r.pictures, strict=True)):
        exposure = style.exposure_for(pictures, 99.0)
        for ball, sun in zip(axes, SUNS, strict=False):
            ball.set_axis_off()
            if sun < len(pictures):
                ball.imshow(style.display(pictures[sun], exposure), interpolation="nearest")
        axes[0].set_title(f"basis {k + 1}", fontsize=9, color=style.SOFT, loc="left")
        _draw_slices(axes[-1], r.surface.bases[k], r.surface.mixture, k)
    return style.plot_png(figure)


def _head(r: Results) -> str:
    notes = r.surface.mixture.notes
    lobes = len(r.surface.mixture.lobes) - 1
    return (
        html.text("Lightsphere material", "kicker")
        + f"<h1>{html.escape(r.name)}</h1>"
        + html.text(
            f"{_counted(len(r.surface.bases), 'basis BRDF', 'basis BRDFs')}, mixed from one diffuse and {lobes} glossy "
            "closures of Cycles that all bases share. The colour of each closure follows the view by a curve.",
            "lead",
        )
        + html.facts(
            [
                (_percent(np.mean(notes["material_rel_rms"])), "error of the fit, all directions"),
                (_percent(np.max(r.rendered)), "Cycles' picture against the recovered"),
                (f"{np.max(notes['albedo']):.2f}", "largest share of light returned"),
                (f"{r.costs[-1]:.2f} x", "render time of one Principled"),
            ]
        )
    )


def _errors(r: Results) -> str:
    notes = r.surface.mixture.notes
    heads = ["basis", "fit", "fit, cube roots", "rendered", "returned", "reciprocity"]
    rows = [
        [
            f"{k + 1}",
            _percent(notes["material_rel_rms"][k]),
            _percent(notes["cube_root_rel_rms"][k]),
            _percent(r.rendered[k]),
            f"{notes['albedo'][k]:.3f}",
            _percent(notes["reciprocity_error"][k]),
        ]
        for k in range(len(r.surface.bases))
    ]
    if r.principled is not None:
        heads += ["Principled", "Principled, cube roots"]
        for k, row in enumerate(rows):
            row += [_percent(r.principled.notes[name][k]) for name in OF_PRINCIPLED]
    return html.section(
        "How faithful it is",
        html.table(heads, rows, range(1, len(heads))),
        html.text(
            "Fit: material_rel_rms, the RMS error of f cos over its RMS, all pairs of directions; highlights rule it. "
            "Cube roots count dim and bright parts alike. Rendered: "
            "the pictures below against the table. Returned: the largest directional albedo; never above 1. "
            "Reciprocity: what exchanging light and viewer changes.",
            "soft",
        ),
    )


def _spheres(r: Results) -> str:
    rows = []
    for k, pictures in enumerate(r.pictures):
        shown = [pictures[i] for i in SUNS if i < len(pictures)]
        exposure = style.exposure_for(np.stack(shown), 99.0)
        rows.append(
            html.row(
                [
                    html.figure(style.picture_png(style.display(p, exposure)), title, "", "pixels")
                    for p, title in zip(shown, (f"Basis {k + 1}.", "", ""), strict=False)
                ],
                "row strip",
            )
        )
    words = (
        "Each basis on a sphere, rendered by Cycles under a sun behind the viewer, beside and opposite of the viewer."
    )
    return html.section("Rendered by Cycles", html.text(words), *rows)


def _slices(r: Results) -> str:
    drawn = [
        html.figure(_slice_plot(brdf, r.surface.mixture, k), f"Basis {k + 1}.", "")
        for k, brdf in enumerate(r.surface.bases)
    ]
    words = (
        "f [1/sr], mean of the colours, against the half angle, light and view in one plane with the normal: the table "
        "as a line, the mixture as dots."
    )
    views = html.figure(_view_plot(r.surface.mixture), "Over views.", "Error of the fit for each view by itself.")
    rows = [html.row([*drawn, views][i : i + 2]) for i in range(0, len(drawn) + 1, 2)]
    return html.section("Over angles", html.text(words), *rows)


def _view_plot(mixture: Mixture) -> bytes:
    figure = Figure(figsize=(4.2, 2.9))
    axes = figure.add_subplot()
    middle = (np.array(VIEWS[:-1]) + np.array(VIEWS[1:])) / 2
    for k, errors in enumerate(mixture.notes["error_by_view"]):
        axes.plot(middle, np.multiply(100, errors), "o-", linewidth=1.2, markersize=3, label=f"basis {k + 1}")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("angle of the view [degrees]")
    axes.set_ylabel("material_rel_rms [%]")
    axes.legend(frameon=False, fontsize=7.5)
    return style.plot_png(figure)


def _slice_plot(brdf: Brdf, mixture: Mixture, number: int) -> bytes:
    figure = Figure(figsize=(4.2, 2.9))
    _draw_slices(figure.add_subplot(), brdf, mixture, number)
    return style.plot_png(figure)


def _draw_slices(axes: Any, brdf: Brdf, mixture: Mixture, number: int) -> None:
    for degrees, colour in zip(SLICES, (style.ACCENT, style.WARM, style.SOFT), strict=True):
        theta_d = np.radians(degrees)
        theta_h = np.linspace(0, 1, 120) ** 2 * (np.radians(89) - theta_d)
        wi, wo = (np.stack([np.sin(a), 0 * a, np.cos(a)], axis=-1) for a in (theta_h + theta_d, theta_h - theta_d))
        shown = np.degrees(theta_h)
        axes.plot(shown, brdf.evaluate(wi, wo).mean(axis=1), color=colour, linewidth=1.2, label=f"{degrees:g}°")
        mixed = mixture.evaluate(wi, wo)[:, number].mean(axis=1) / wi[:, 2]
        axes.plot(shown[::4], mixed[::4], ".", color=colour, markersize=4)
    axes.set_yscale("log")
    axes.set_xlabel("half angle [degrees]")
    axes.legend(frameon=False, fontsize=7.5, title="difference angle", title_fontsize=7.5)


def _cost(r: Results) -> str:
    errors = r.surface.mixture.notes["error_by_lobes"]
    heads = ("glossy lobes", "error of the fit", "render time over one Principled")
    rows = [
        [
            f"{n}" + (", taken" if n == len(r.costs) - 1 else ""),
            _percent(e),
            f"{r.costs[n]:.2f}" if n < len(r.costs) else "",
        ]
        for n, e in enumerate(errors)
    ]
    words = (
        "A lobe more is taken while it lowers the error by .3 % or more. The lobes that are taken are chosen once more "
        "together, so that the material is at least as good as its line here. Time: a sphere under a sky, the same "
        "texture."
    )
    return html.section(
        "What accuracy costs",
        html.row([html.figure(_cost_plot(errors, r.costs), "", ""), html.table(heads, rows, (1, 2))], "two"),
        html.text(words, "soft"),
    )


def _cost_plot(errors: Sequence[float], costs: Sequence[float]) -> bytes:
    figure = Figure(figsize=(4.4, 2.9))
    axes = figure.add_subplot()
    axes.plot(costs, errors[: len(costs)], "o-", color=style.ACCENT, linewidth=1.2, markersize=5)
    for n, (cost, error) in enumerate(zip(costs, errors, strict=False)):
        axes.annotate(f"{n}", (cost, error), (6, 5), textcoords="offset points", fontsize=8.5)
    axes.set_yscale("log")
    axes.grid(color=style.LINE, linewidth=0.6)
    axes.margins(0.15, 0.2)
    axes.set_xlabel("render time over one Principled")
    axes.set_ylabel("material_rel_rms")
    return style.plot_png(figure)


def _weights(r: Results) -> str:
    scale = figures.scale_bar(0.0, 1.0, style.CONFIDENCE, "weight")
    maps = np.moveaxis(r.surface.weights.mean(axis=-1), -1, 0)
    shown = [style.picture_png(style.mapped(weights, 0.0, 1.0, style.CONFIDENCE)) for weights in maps]
    drawn = [html.figure(png, f"Basis {k}.", "", "", scale) for k, png in enumerate(shown, start=1)]
    return html.section("Where each basis is", html.row(drawn))


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _counted(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"
