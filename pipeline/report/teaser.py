"""One wide picture that says what the program does: pictures in, shape recovered, asset seen anew."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from . import figures, style
from .demo import Results, around, telling_lights

WIDTH, HEIGHT = 1600, 620  # pixels
TOP, BOTTOM = 92, 36
GAP = 8


def teaser(results: Results) -> bytes:
    """Return the picture as the bytes of a PNG file."""
    figure = Figure(figsize=(WIDTH / 100, HEIGHT / 100), facecolor=style.PAPER)
    tall = HEIGHT - TOP - BOTTOM
    small = (tall - 2 * GAP) / 3
    pictures = [
        results.capture.image(int(i)) for s in ("inner", "outer") for i in telling_lights(results.capture, s, 3)
    ]
    exposure = style.exposure_for(np.stack(pictures), 97)
    left = 40.0
    for number, picture in enumerate(pictures):
        column, line = divmod(number, 3)
        place = (left + column * (small + GAP), TOP + line * (small + GAP), small, small)
        _show(figure, style.display(picture, exposure), place, "nearest")
    _caption(figure, left, f"{len(results.capture)} pictures, one lamp each")
    left += 2 * small + GAP + 44
    mask = results.capture.mask()
    part = around(mask)
    depth = np.where(mask, results.shape.depth, np.nan)[part]
    low, high = np.nanpercentile(depth, [0.5, 99.5])
    normal = np.where(mask[..., None], results.shape.normal, np.nan)[part]
    half = (tall - GAP) / 2
    wide = half * depth.shape[1] / depth.shape[0]
    _show(figure, style.mapped(depth, low, high, style.DEPTH), (left, TOP, wide, half), "nearest")
    _show(figure, figures.normal_colours(normal), (left, TOP + half + GAP, wide, half), "nearest")
    _caption(figure, left, "distance and direction of every pixel")
    left += wide + 44
    view = style.display(results.asset_view, style.exposure_for(results.true_view, 99.7))
    room = WIDTH - 40 - left
    crop = round((1 - min(tall / room, 1.0) * view.shape[1] / view.shape[0]) / 2 * view.shape[0])
    view = view[max(crop, 0) : view.shape[0] - max(crop, 0)]
    _show(figure, view, (left, TOP, room, tall), "lanczos")
    _caption(figure, left, "the recovered asset, turned and lit anew by Cycles")
    return style.plot_png(figure, dpi=100, tight=False)


def _show(figure: Figure, pixels: NDArray[Any], place: tuple[float, float, float, float], resampling: str) -> None:
    """Place an image by its left, top, width and height in pixels from the top left."""
    left, top, width, height = place
    axes = figure.add_axes((left / WIDTH, 1 - (top + height) / HEIGHT, width / WIDTH, height / HEIGHT))
    axes.imshow(pixels, interpolation=resampling)
    axes.set_axis_off()


def _caption(figure: Figure, left: float, words: str) -> None:
    figure.text(left / WIDTH, 1 - (TOP - 26) / HEIGHT, words, fontsize=13.5, color=style.INK, va="center")
