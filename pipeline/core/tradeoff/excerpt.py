"""A part of a capture's pixels, held in memory, on which settings are tried before the whole is done."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..capture import Capture, Truth
from ..progress import Progress, Work

SHARE = 1 / 8  # of the pixels
SMALLER = 1 / 4  # share of an excerpt that a smaller one has


@dataclass(frozen=True)
class Size:
    """How large an excerpt is.

    Parameters
    ----------
    block : int
        Pixels of a side of the blocks that are taken, as far as a stage looks at pixels around.
    fewest, most : int
        Pixels.
    """

    block: int
    fewest: int
    most: int


SINGLE = Size(6, 300, 1200)  # for stages that solve pixels and look at their neighbours
AROUND = Size(24, 1500, 3000)  # for stages that take what is expected of a pixel from those around it


@dataclass(frozen=True)
class Excerpt(Capture):
    """A capture of which some pixels are known, and no truth.

    Parameters
    ----------
    shown : (H, W) bool
        Those P pixels.
    values : (L, P, 3) float32
    reads : list of int
        The lights whose pictures were opened, one entry each time; shared by all that is made from this excerpt.
    """

    shown: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), bool))
    values: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0, 3), np.float32))
    size: Size = SINGLE
    reads: list[int] = field(default_factory=list)

    def image(self, light: int) -> NDArray[np.float32]:
        """Return a picture (H, W, 3), black where pixels are not known."""
        self.reads.append(light)
        picture = np.zeros((*self.shown.shape, 3), np.float32)
        picture[self.shown] = self.values[light]
        return picture

    def mask(self) -> NDArray[np.bool_]:
        """Return the pixels that are known."""
        return self.shown.copy()

    def truth(self) -> Truth | None:
        """Return None: an excerpt serves choices, which truth has no part in."""
        return None

    def select(self, indices: NDArray[np.int64]) -> Excerpt:
        """Return the excerpt restricted to some of its lights."""
        fewer = super().select(indices)
        assert isinstance(fewer, Excerpt)
        return dataclasses.replace(fewer, values=self.values[indices])

    def smaller(self) -> Excerpt:
        """Return an excerpt of this one, a :data:`SMALLER` share of its pixels."""
        count = max(round(SMALLER * int(self.shown.sum())), 1)
        shown = blocks(self.shown, count, self.size.block)
        return dataclasses.replace(self, shown=shown, values=self.values[:, shown[self.shown]])


def excerpt(capture: Capture, pixels: NDArray[np.bool_], size: Size) -> Work[tuple[Excerpt, float]]:
    """Read blocks of some pixels (H, W) of a capture; return them and the seconds that opening a picture takes."""
    total = int(pixels.sum())
    shown = blocks(pixels, min(max(round(SHARE * total), size.fewest), size.most, total), size.block)
    values = np.empty((len(capture), int(shown.sum()), 3), np.float32)
    start = time.perf_counter()
    for light in range(len(capture)):
        values[light] = capture.image(light)[shown]
        yield Progress("read", light + 1, len(capture), "pictures")
    seconds = (time.perf_counter() - start) / len(capture)
    fields = {item.name: getattr(capture, item.name) for item in dataclasses.fields(Capture)}
    return Excerpt(**fields, shown=shown, values=values, size=size), seconds


def blocks(pixels: NDArray[np.bool_], count: int, side: int) -> NDArray[np.bool_]:
    """Return about so many of the pixels (H, W), at least, in square blocks that are evenly spread over them."""
    height, width = pixels.shape
    row, column = np.mgrid[:height, :width] // side
    number = row * (width // side + 1) + column
    own = np.bincount(number[pixels])
    filled = np.flatnonzero(own)
    # Halving intervals again and again spreads any number of blocks evenly over those that are there.
    turn = np.argsort([_reversed_bits(k) for k in range(len(filled))], kind="stable")
    order = filled[turn]
    taken = order[: int(np.searchsorted(np.cumsum(own[order]), count)) + 1]
    return np.asarray(pixels & np.isin(number, taken))


def _reversed_bits(number: int, bits: int = 32) -> int:
    return int(f"{number:0{bits}b}"[::-1], 2)
