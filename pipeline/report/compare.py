"""The page of a comparison: an asset beside what it should look like, where it errs and by how much."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compare.pictures import Comparison, picture_error, structural_similarity
from . import figures, html, style
from .flip import flip

SHOWN = 4  # lights of each kind
LABEL = "RMS difference, % of the reference's RMS"
Figures = dict[str, Any]


def figures_of(comparison: Comparison) -> Figures:
    """Return ``relight_rel_rmse``, ``noise``, ``flip`` and ``ssim``, means over the lights and the object's pixels.

    ``bases`` is the relative RMSE, over all lights together, where the asset shows most of each of its bases; it is
    empty for one. FLIP and SSIM are of what a screen shows, of an exposure at which one per cent of the reference's
    object is white.
    """
    looks = [looks_of(a, b, comparison.mask) for a, b in zip(comparison.pictures, comparison.references, strict=True)]
    seen, alike = np.mean(looks, axis=0)
    return {
        "lights": len(comparison.pictures),
        "relight_rel_rmse": comparison.relative_rmse,
        "noise": comparison.noise,
        "flip": float(seen),
        "ssim": float(alike),
        "bases": comparison.errors_of_parts,
    }


def looks_of(picture: NDArray[Any], reference: NDArray[Any], mask: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the means of FLIP and SSIM over a mask, of linear radiance (H, W, 3)."""
    exposure = style.exposure_for(reference[mask])
    a, b = (style.display(values, exposure) for values in (picture, reference))
    return float(flip(a, b)[mask].mean()), float(structural_similarity(a, b)[mask].mean())


def heat_map(comparison: Comparison) -> bytes:
    """Draw where the pictures of a comparison differ, with its colour scale, as a PNG."""
    return figures.heat(100 * comparison.error, LABEL)


def report(name: str, capture: str, comparisons: Sequence[Comparison], found: Sequence[Figures], true: bool) -> str:
    """Return the page.

    Parameters
    ----------
    name, capture : str
        The asset and the capture in words.
    comparisons : sequence of Comparison
    found : sequence of dict
        The figures of each, :func:`figures_of`.
    true : bool
        Whether the true scene was at hand.
    """
    beside = "the capture and the true scene" if true else "the capture"
    facts = [(_percent(one["relight_rel_rmse"]), c.words) for c, one in zip(comparisons, found, strict=True)]
    head = (
        html.text("Lightsphere comparison", "kicker")
        + f"<h1>{html.escape(name)}</h1>"
        + html.text(f"The asset, rendered by Cycles, beside {beside} ({capture}).", "lead")
        + html.facts(facts)
    )
    return html.page(
        f"Comparison of {name}",
        [
            head,
            _table(comparisons, found, true),
            *_bases_table(comparisons, found),
            _maps(comparisons),
            *map(_section, comparisons),
        ],
    )


def _table(comparisons: Sequence[Comparison], found: Sequence[Figures], true: bool) -> str:
    rows = [
        [
            c.words,
            f"{one['lights']}",
            _percent(one["relight_rel_rmse"]),
            _percent(one["noise"]) if one["noise"] else "none",
            f"{one['flip']:.3f}",
            f"{one['ssim']:.4f}",
        ]
        for c, one in zip(comparisons, found, strict=True)
    ]
    heads = ("pictures", "lights", "relative RMSE", "of which noise", "FLIP", "SSIM")
    words = (
        "Means over the lights and the pixels of the object. Relative RMSE is of linear radiance, render noise of both "
        "sides included. FLIP (0 looks alike, 1 is black for white) and SSIM (1 is alike) are of pictures on a screen."
    )
    if not true:
        words += (
            " The captured scene is not at hand, so that lights and views beyond the capture could not be compared, "
            "and the asset stands alone: what its surroundings reflect onto it is missing."
        )
    return html.section("How close it is", html.table(heads, rows, range(1, 6)), html.text(words, "soft"))


def _bases_table(comparisons: Sequence[Comparison], found: Sequence[Figures]) -> list[str]:
    """Return the section on the bases of the asset's material, none where there is one alone."""
    names = list(dict.fromkeys(name for one in found for name in one["bases"]))
    if not names:
        return []
    rows = []
    for name in names:
        share = np.mean([(c.mask & c.parts[name]).sum() / c.mask.sum() for c in comparisons])
        errors = [_percent(one["bases"][name]) if name in one["bases"] else "not lit" for one in found]
        rows.append([name, _percent(float(share)), *errors])
    heads = ("material", "of the pixels", *(c.words for c in comparisons))
    words = (
        "Relative RMSE, over all lights together, of the pixels that show more of one basis of the recovered material "
        "than of the others."
    )
    return [
        html.section("Which material errs", html.table(heads, rows, range(1, len(heads))), html.text(words, "soft"))
    ]


def _maps(comparisons: Sequence[Comparison]) -> str:
    drawn = [html.figure(heat_map(c), f"{c.words[:1].upper()}{c.words[1:]}.", "") for c in comparisons]
    return html.section("Where it differs", html.row(drawn), html.text("Root mean square over all lights.", "soft"))


def _section(c: Comparison) -> str:
    shown = np.unique(np.linspace(0, len(c.pictures) - 1, SHOWN).round().astype(int))
    exposure = style.exposure_for(c.references[:, c.mask], 97.0)
    errors = [picture_error(c.pictures[i], c.references[i]) for i in shown]
    high = max(float(np.percentile(np.stack(errors)[:, c.mask], 99.5)), 1e-12)
    rows = (
        ("It should be.", [style.display(c.references[i], exposure) for i in shown]),
        ("The asset.", [style.display(c.pictures[i], exposure) for i in shown]),
        ("Difference.", [style.mapped(np.where(c.mask, e, np.nan), 0.0, high, style.ERROR) for e in errors]),
    )
    scale = figures.scale_bar(0.0, 100 * high, style.ERROR, LABEL)
    strips = [
        html.row(
            [
                html.figure(
                    style.picture_png(picture), title, "", "pixels dark", scale if title == rows[-1][0] else None
                )
                for picture, title in zip(pictures, (title, "", "", ""), strict=False)
            ],
            "row strip",
        )
        for title, pictures in rows
    ]
    return html.section(c.words[:1].upper() + c.words[1:], *strips)


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"
