"""The page of an inverse rendering: photograph and picture beside each other, every group, and what accuracy cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..core.compare.pictures import picture_error
from . import figures, html, style


@dataclass(frozen=True)
class Results:
    """What the page shows.

    Parameters
    ----------
    name : str
    photograph, rendered : (H, W, 3) float
        Linear radiance.
    trusted : (H, W) bool
        Pixels of the photograph that count.
    found : dict
        The command's figures.
    history : list of dict
        ``stage``, ``seconds`` and ``error`` after every step.
    """

    name: str
    photograph: NDArray[Any]
    rendered: NDArray[Any]
    trusted: NDArray[np.bool_]
    found: dict[str, Any]
    history: list[dict[str, Any]]


def report(r: Results) -> str:
    """Return the page."""
    return html.page(f"Reflectances of {r.name}", [_head(r), _pictures(r), _groups(r), _cost(r)])


def _head(r: Results) -> str:
    words = "What every group of surfaces reflects, from one picture, with light that bounces between all of them."
    return (
        html.text("Lightsphere inverse", "kicker")
        + f"<h1>{html.escape(r.name)}</h1>"
        + html.text(words, "lead")
        + html.facts(
            [
                (f"{len(r.found['groups'])}", "groups"),
                (f"{100 * r.found['rerendered_rel_rmse']:.2g} %", "rendered against the photograph"),
                (f"{r.found['renders']}", "renders"),
                (f"{r.history[-1]['seconds']:.0f} s", "search"),
            ]
        )
    )


def _pictures(r: Results) -> str:
    exposure = style.exposure_for(r.photograph, 98.0)
    error = np.where(r.trusted, picture_error(r.rendered, r.photograph), np.nan)
    high = float(np.nanpercentile(error, 99.5))
    scale = figures.scale_bar(0.0, high, style.ERROR, "difference over the photograph's RMS")
    shown = [
        html.figure(style.picture_png(style.display(r.photograph, exposure)), "The photograph.", "", "pixels"),
        html.figure(
            style.picture_png(style.display(r.rendered, exposure)), "Rendered from what was found.", "", "pixels"
        ),
        html.figure(
            style.picture_png(style.mapped(error, 0.0, high, style.ERROR)), "Difference.", "", "pixels dark", scale
        ),
    ]
    return html.section("The picture", html.row(shown))


def _groups(r: Results) -> str:
    heads = ("group", "level", "diffuse", "specular", "slopes, angle", "uncertainty", "seen")
    rows = [_row(name, one) for name, one in r.found["groups"].items()]
    tried = [
        [name, ", ".join(f"{trial['level']} {100 * trial['error']:.2g} %" for trial in one["tried"])]
        for name, one in r.found["groups"].items()
        if one.get("tried")
    ]
    words = (
        "Uncertainty: the standard deviation that render noise causes, the largest of the group's reflectances. Levels "
        "tried: the relative error that each left in the group's own pixels, with the surroundings as they were then."
    )
    return html.section(
        "What each group reflects",
        html.table(heads, rows, ()),
        html.table(("group", "levels tried"), tried, ()),
        html.text(words, "soft"),
    )


def _row(name: str, one: dict[str, Any]) -> list[str]:
    def colour(key: str) -> str:
        return " ".join(f"{value:.3f}" for value in one[key]) if key in one else ""

    slopes = f"{one['alpha_x']:.3f} {one['alpha_y']:.3f}" if "alpha_x" in one else ""
    if "angle" in one:
        slopes += f", {one['angle']:.0f}°"
    spread = [value for kind in ("diffuse", "specular") for value in one.get("deviation", {}).get(kind, ())]
    uncertain = f"{100 * max(spread):.2g} %" if spread else ""
    seen = one.get("why") or f"{one['seen']}, {one['pixels']} pixels"
    diffuse = "texture" if one["level"] == "texture" else colour("rho_d")
    return [name, one["level"], diffuse, colour("rho_s"), slopes, uncertain, seen]


def _cost(r: Results) -> str:
    figure = Figure(figsize=(6.4, 2.9))
    axes = figure.add_subplot()
    seconds = [one["seconds"] for one in r.history]
    axes.plot(seconds, [max(100 * one["error"], 1e-2) for one in r.history], color=style.LINE, linewidth=1.2)
    for stage, colour in (("diffuse", style.SOFT), ("levels", style.WARM), ("refine", style.ACCENT)):
        places = [(one["seconds"], max(100 * one["error"], 1e-2)) for one in r.history if one["stage"] == stage]
        axes.plot(*np.array(places).reshape(-1, 2).T, "o", color=colour, markersize=5, label=stage)
    axes.set_yscale("log")
    axes.grid(color=style.LINE, linewidth=0.6)
    axes.set_xlabel("seconds")
    axes.set_ylabel("error of the picture [%]")
    axes.legend(frameon=False, fontsize=8)
    words = (
        f"{r.found['renders']} renders took {r.found['render_seconds']:.0f} s. The error is that of the whole picture "
        "with render noise taken off, by the product of two renders of other seeds."
    )
    return html.section("What accuracy costs", html.figure(style.plot_png(figure), "", ""), html.text(words, "soft"))
