"""The data sheet of a dataset: what it is, how it was made, what is in it, and how that is spread.

It answers the questions of Gebru and others, "Datasheets for datasets", 2021, that a program can answer.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ..core.capture import Capture
from ..core.dataset.draw import Sample
from ..core.dataset.recipe import CAPTURE, SPLITS, Recipe
from ..core.settings import limits_of
from . import figures, html, style

SHOWN = 12  # samples whose pictures are shown
A_ROW = 6
BINS = 24
MOST_WORDS = 12  # kinds that are told apart


def report(folder: Path, recipe: Recipe, samples: Sequence[Sample]) -> str:
    """Return the page of the samples that are there; it depends on recipe and samples alone."""
    return html.page(
        recipe.name,
        [_head(recipe, samples), _pictures(folder, recipe, samples), _spread(samples), _layouts(recipe), _how(recipe)],
    )


def _head(recipe: Recipe, samples: Sequence[Sample]) -> str:
    splits = Counter(sample.split for sample in samples)
    words = recipe.description or "Captures of drawn shapes, materials, lights and cameras, rendered by Cycles."
    missing = recipe.count - len(samples)
    return (
        html.text("Lightsphere data sheet", "kicker")
        + f"<h1>{html.escape(recipe.name)}</h1>"
        + html.text(words, "lead")
        + html.facts(
            [
                (f"{len(samples):,}", "samples" if not missing else f"samples; {missing:,} are missing"),
                (f"{sum(sample.lights for sample in samples):,}", "pictures, one light each"),
                (f"{recipe.camera.resolution} px", "width and height"),
                (" / ".join(f"{splits[split]:,}" for split in SPLITS), " / ".join(SPLITS)),
            ]
        )
        + html.text(f"Licence: {recipe.licence or 'not stated by the recipe'}. Seed {recipe.seed}.")
        + html.text(
            "Samples of one mesh or scene file are all in one split. Every sample depends on recipe, seed and its "
            "number alone."
        )
    )


def _pictures(folder: Path, recipe: Recipe, samples: Sequence[Sample]) -> str:
    if CAPTURE not in recipe.output.formats or not samples:
        return ""
    even = np.unique(np.linspace(0, len(samples) - 1, SHOWN).astype(int))
    shown = [_pair(folder, samples[i]) for i in even]
    rows = [html.row(shown[i : i + A_ROW], "row strip") for i in range(0, len(shown), A_ROW)]
    return html.section("Samples", html.text("Under their first light, and their normals."), *rows)


def _pair(folder: Path, sample: Sample) -> str:
    capture = Capture.open(folder / CAPTURE / sample.name)
    truth = capture.truth()
    assert truth is not None
    picture = capture.image(0)
    shown = style.display(picture, style.exposure_for(picture))
    normal = figures.normal_colours(np.where(capture.mask()[..., None], truth.normal, np.nan))[..., :3]
    both = np.concatenate([shown, np.nan_to_num(normal)], axis=0)
    return html.figure(style.picture_png(both), str(sample.index), "", "pixels")


def _spread(samples: Sequence[Sample]) -> str:
    if not samples:
        return ""
    parts = [part for sample in samples for part in sample.principled]
    numbers: dict[str, Sequence[float]] = {
        "lights": [sample.lights for sample in samples],
        "field of view [degrees]": [sample.field_of_view for sample in samples],
        "azimuth of the camera [degrees]": [sample.azimuth for sample in samples],
        "elevation of the camera [degrees]": [sample.elevation for sample in samples],
        "materials that are mixed": [len(sample.principled) for sample in samples if sample.principled],
        "base colours": [value for part in parts for value in part.base_color],
        "roughness": [part.roughness for part in parts],
        "metallic": [part.metallic for part in parts],
        "specular level": [part.specular for part in parts],
        "size of patches / extent": [sample.patches for sample in samples if len(sample.principled) > 1],
        "electrons at white": [sample.full_well for sample in samples if sample.full_well],
    }
    words = {
        "Shapes": Counter(Path(sample.shape).name for sample in samples),
        "Materials": Counter(Path(sample.material).name for sample in samples),
    }
    told = [
        f"<h3>{title}</h3>" + html.bars([(word, n, f"{n:,}") for word, n in counts.most_common(MOST_WORDS)])
        for title, counts in words.items()
    ]
    drawn = {name: values for name, values in numbers.items() if values}
    return html.section(
        "How it is spread", *told, html.figure(_histograms(drawn), "", "Numbers of samples or materials.")
    )


def _histograms(drawn: dict[str, Sequence[float]]) -> bytes:
    columns = 4
    rows = -(-len(drawn) // columns)
    figure = Figure(figsize=(10, 1.7 * rows), layout="constrained")
    grid: NDArray[Any] = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat[len(drawn) :]:
        axes.set_visible(False)
    for axes, (name, values) in zip(grid.flat, drawn.items(), strict=False):
        axes.hist(values, bins=BINS, color=style.ACCENT)
        axes.set_xlabel(name)
        axes.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    return style.plot_png(figure)


def _layouts(recipe: Recipe) -> str:
    told = {
        "capture": "`capture/NAME`: `capture.json` (camera, lights, what was drawn, effects, checksums), a linear "
        "OpenEXR for every light, `mask.exr`, `truth.exr` (depth along the ray, normal in camera space, position, "
        "material), `layers.exr` (diffuse and glossy colour, roughness, shares of mixed materials)",
        "diligent": "`diligent/NAMEPNG`: 16-bit PNG, lists of lights, mask and `Normal_gt.mat` as in DiLiGenT",
        "near": "`near/NAME`: the same pictures with `light.mat` (S in mm) and `camera.mat` (K)",
        "hdf5": "`hdf5/NAME.hdf5`: `colors`, `depth`, `normals`, `category_id_segmaps` as BlenderProc has them, and "
        "`radiance`, lights and mask",
        "webdataset": "`webdataset/SPLIT-NUMBER.tar`: the captures as shards",
    }
    rows = [[told[name]] for name in recipe.output.formats]
    if recipe.truth.direct:
        rows.append(["`direct_NUMBER.exr` beside every picture: direct light alone; the rest of the picture bounced"])
    return html.section("What is in it", html.table(["layout"], rows, []))


def _how(recipe: Recipe) -> str:
    """Return the recipe as a table."""
    rows = []
    for item in dataclasses.fields(recipe):
        value = getattr(recipe, item.name)
        if not dataclasses.is_dataclass(value):
            rows.append([f"`{item.name}`", _told(value), limits_of(item).help])
            continue
        for part in dataclasses.fields(value):
            limits = limits_of(part)
            unit = f" [{limits.unit}]" if limits.unit else ""
            rows.append([f"`{item.name}.{part.name}`", _told(getattr(value, part.name)) + unit, limits.help])
    limits = (
        "Not modelled: lenses other than a pinhole, polarisation, fluorescence, colour filters of a sensor. Pictures "
        "with bounces have the noise of their samples."
    )
    return html.section("How it was made", html.text(limits), html.table(["", "value", "meaning"], rows, []))


def _told(value: Any) -> str:
    if not isinstance(value, tuple):
        return str(value)
    if isinstance(value[0], str):
        names = [Path(word).name for word in value]
        more = len(names) - MOST_WORDS
        return ", ".join(names[:MOST_WORDS]) + (f" and {more} more" if more > 0 else "")
    low, high = value
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"
