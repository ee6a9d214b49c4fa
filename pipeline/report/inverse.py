"""The page of an inverse rendering: photograph and picture beside each other, every group, and what accuracy cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..core.compare.pictures import picture_error
from ..core.inverse import GGX, uncertainty
from . import figures, html, style

TELLING = 0.02  # relative error of a level, below which noise hides nothing that matters
STAGES = {
    "diffuse": "Every group diffuse.",
    "lamps": "Lamps found.",
    "levels": "Every group at its level.",
    "refine": "All moved together.",
}


@dataclass(frozen=True)
class Results:
    """What the page shows.

    Parameters
    ----------
    name : str
    photograph : (H, W, 3) float
        Linear radiance.
    trusted : (H, W) bool
        Pixels of the photograph that count.
    found : dict
        The command's figures.
    stages : dict of str to (H, W, 3) float
        What was rendered when a stage ended, denoised, see STAGES.
    uses : dict of str to (H, W, 3) float
        Other pictures of what was found, by what they show.
    """

    name: str
    photograph: NDArray[Any]
    trusted: NDArray[np.bool_]
    found: dict[str, Any]
    stages: dict[str, NDArray[Any]]
    uses: dict[str, NDArray[Any]]


def report(r: Results) -> str:
    """Return the page."""
    parts = [_head(r), _pictures(r), _groups(r), _lamps(r), _stages(r), _uses(r), _cost(r)]
    return html.page(f"Reflectances of {r.name}", [part for part in parts if part])


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
                (f"{r.found['history'][-1]['seconds']:.0f} s", "search"),
            ]
        )
    )


def _pictures(r: Results) -> str:
    rendered = list(r.stages.values())[-1]
    high = float(np.nanpercentile(_error(r, rendered), 99.5))
    exposure = style.exposure_for(r.photograph, 98.0)
    shown = [
        _picture(r.photograph, exposure, "The photograph."),
        _picture(rendered, exposure, "Rendered from what was found, denoised."),
        _difference(r, rendered, "Difference.", high),
    ]
    return html.section("The picture", html.row(shown))


def _picture(pixels: NDArray[Any], exposure: float, words: str) -> str:
    shown = style.display(pixels, exposure)
    return html.figure(style.picture_png(shown), words, "", "pixels")


def _difference(r: Results, pixels: NDArray[Any], words: str, high: float) -> str:
    scale = figures.scale_bar(0.0, high, style.ERROR, "difference over the photograph's RMS")
    shown = style.mapped(_error(r, pixels), 0.0, high, style.ERROR)
    return html.figure(style.picture_png(shown), words, "", "pixels dark", scale)


def _error(r: Results, pixels: NDArray[Any]) -> NDArray[np.float64]:
    return np.where(r.trusted, picture_error(pixels, r.photograph), np.nan)


def _stages(r: Results) -> str:
    """Show what the picture lacked after every stage but the last, on the scale of the first."""
    kept = {STAGES[name]: pixels for name, pixels in list(r.stages.items())[:-1]}
    if not kept:
        return ""
    exposure = style.exposure_for(r.photograph, 98.0)
    high = float(np.nanpercentile(_error(r, next(iter(kept.values()))), 99.0))
    rows = [
        html.row([_picture(pixels, exposure, words), _difference(r, pixels, "Difference.", high)])
        for words, pixels in kept.items()
    ]
    return html.section("How it was found", *rows)


def _uses(r: Results) -> str:
    if not r.uses:
        return ""
    shown = [_picture(pixels, style.exposure_for(pixels, 98.0), words) for words, pixels in r.uses.items()]
    words = "Rendered from what was found, denoised. Open recovered.blend and do as you like."
    return html.section("What it is good for", html.row(shown), html.text(words, "soft"))


def _lamps(r: Results) -> str:
    if not r.found["lamps"]:
        return ""
    rows = [
        [
            lamp["name"],
            f"{lamp['power']:.4g} {lamp['unit']}",
            f"{100 * lamp['deviation']:.2g} %" if lamp["deviation"] else "",
        ]
        for lamp in r.found["lamps"]
    ]
    return html.section("What lamps were unknown", html.table(("lamp", "power", "uncertainty"), rows, ()))


def _trial(one: dict[str, Any]) -> str:
    hidden = one["surely_below"] > 2 * max(one["error"], TELLING)
    left = "?" if hidden else f"{100 * one['error']:.2g} %"
    return f"{one['level']} {left}"


def _groups(r: Results) -> str:
    heads = ("group", "level", "diffuse", "specular", "slopes, angle", "uncertainty", "seen")
    rows = [_row(name, one) for name, one in r.found["groups"].items()]
    tried = [
        [name, ", ".join(map(_trial, one["tried"])), f"{one['cost']['renders']:g}, {one['cost']['seconds']:.1f} s"]
        for name, one in r.found["groups"].items()
        if one.get("tried")
    ]
    words = (
        "Uncertainty: the standard deviation that render noise causes, the largest of the group's reflectances, faint "
        "ones beside a twentieth of its brightest. Levels "
        "tried: the relative error that each left in the group's own pixels, with the surroundings as they were then; "
        "a question mark where render noise could hide twice that."
    )
    return html.section(
        "What each group reflects",
        html.table(heads, rows, ()),
        html.table(("group", "levels tried", "renders for them"), tried, ()),
        html.text(words, "soft"),
    )


def _row(name: str, one: dict[str, Any]) -> list[str]:
    def colour(key: str) -> str:
        return " ".join(f"{value:.3f}" for value in one[key]) if key in one else ""

    slopes = f"{one['alpha_x']:.3f} {one['alpha_y']:.3f}" if "alpha_x" in one else ""
    if one.get("distribution") == GGX:
        slopes += " GGX"
    if "angle" in one:
        slopes += f", {one['angle']:.0f}°"
    uncertain = f"{100 * uncertainty(one):.2g} %" if one.get("deviation") else ""
    seen = one.get("why") or f"{one['seen']}, {one['pixels']} pixels" + (", known" if one.get("known") else "")
    diffuse = "texture" if one["level"] == "texture" else colour("rho_d")
    return [name, one["level"], diffuse, colour("rho_s"), slopes, uncertain, seen]


def _cost(r: Results) -> str:
    figure = Figure(figsize=(6.4, 2.9))
    axes = figure.add_subplot()
    history = r.found["history"]
    seconds = [one["seconds"] for one in history]
    axes.plot(seconds, [max(100 * one["error"], 1e-2) for one in history], color=style.LINE, linewidth=1.2)
    colours = {"diffuse": style.SOFT, "lamps": style.INK, "levels": style.WARM, "refine": style.ACCENT}
    for stage in dict.fromkeys(one["stage"] for one in history):
        places = [(one["seconds"], max(100 * one["error"], 1e-2)) for one in history if one["stage"] == stage]
        axes.plot(*np.array(places).reshape(-1, 2).T, "o", color=colours[stage], markersize=5, label=stage)
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
