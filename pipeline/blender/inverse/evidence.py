"""What a search is judged by: the photograph, the pixels of each group, and renders of independent seeds beside it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.inverse.brushing import brushing
from ...core.inverse.estimate import structured, unexplained
from ...core.inverse.photograph import Photograph, inner, weights
from ...core.inverse.texture import smoothed
from .room import Room

Array = NDArray[np.float64]
FEWEST = 6  # pixels without which a group's own are not judged
MOST_SAMPLES = 512  # a pixel of a small group
USUAL = 160 * 120  # pixels for which numbers of samples are stated
SMOOTH = 4.0  # standard deviation over which light does not vary much [px]
DARK = 1e-6  # of the photograph's mean: what shows less counts as that
STEADY = 4.0  # standard deviations above which an error is not noise


class Evidence:
    """A photograph beside a room.

    Parameters
    ----------
    room : Room
    photograph : Photograph
        Of the room's size.

    Attributes
    ----------
    photograph : (H, W, 3) float64
    index : (H, W) int
        What each pixel shows, see :meth:`Room.layers_of_pixels`.
    uv : (H, W, 2) float64
    places : (H, W, 3) float64
        What each pixel shows, in world coordinates.
    masks : list of (H, W) bool
        Each group's trusted pixels that are not at an edge.
    weight : (H, W, 3) float64
    """

    def __init__(self, room: Room, photograph: Photograph) -> None:
        self.room = room
        self.photograph = photograph.pixels
        self.index, self.uv, self.places = room.layers_of_pixels()
        self._trusted = photograph.trusted & ((self.index >= 0) | self.shines())
        kept = self._trusted & inner(self.index)
        count = len(room.groups)
        for number in range(count):  # a group that is all edge keeps its pixels
            if (kept & (self.index == number)).sum() < FEWEST:
                kept |= self.whole(number)
        self.masks = [kept & (self.index == number) for number in range(count)]
        self.weight = weights(self.photograph) * kept[..., None]
        self._seed = 0

    def shines(self) -> NDArray[np.bool_]:
        """Return the pixels that show what shines with a power that is looked for, (H, W): they tell it outright."""
        room = self.room
        numbers = [-1 if room.lamps[lamp].is_world else -3 - lamp for lamp in room.free_lamps]
        return np.asarray(np.isin(self.index, numbers))

    def next_seed(self) -> int:
        """Return a seed that no render had before."""
        self._seed += 1
        return self._seed

    def whole(self, number: int) -> NDArray[np.bool_]:
        """Return a group's trusted pixels, those at its edge, too, (H, W)."""
        return self._trusted & (self.index == number)

    def samples(self, samples: int) -> int:
        """Return samples a pixel that make a small picture as certain as one of USUAL pixels."""
        return max(samples, round(samples * USUAL / self.index.size))

    def render(self, samples: int) -> Array:
        """Render the room as it is with a new seed."""
        return self.room.render(self.samples(samples), self.next_seed())

    def residuals(self, samples: int, enough: int = 0, beside: Sequence[NDArray[np.bool_]] = ()) -> Array:
        """Return photograph less render by two seeds, (2, H, W, 3).

        Groups of few pixels, and masks (H, W) beside them, get more samples, so that they have enough in all, and all
        are judged alike.
        """
        residuals = self.photograph - np.stack([self.render(samples) for _ in range(2)])
        for mask in (*self.masks, *beside):
            more = min(round(enough / max(mask.sum(), 1)), MOST_SAMPLES)
            if mask.any() and more > self.samples(samples):
                for own in residuals:
                    own[mask] = self.photograph[mask] - self.room.pixels(mask, more, self.next_seed())
        return residuals

    def mean(self, shown: Array, number: int) -> Array:
        """Return a group's mean in a picture, dark pixels counting as much as bright ones, (3,).

        Render noise does not change it in the mean, as it does least squares.
        """
        mask = self.masks[number]
        mean = np.average(shown[mask], axis=0, weights=np.sqrt(self.weight[mask]))
        return np.asarray(np.maximum(mean, DARK * self.photograph.mean()))

    def ratio(self, shown: Array, number: int) -> Array:
        """Return what a group's pixels in a render are to be multiplied by to be the photograph's, (3,)."""
        return self.mean(self.photograph, number) / self.mean(shown, number)

    def gains(self, shown: Array, numbers: Sequence[int], samples: int) -> Array:
        """Return what each of N groups shows where one alone glows, over what it shows in a render, (N, N, 3).

        As brightly as the render shows it. Where the second is the one that glows, its glow is in it.
        """
        means = {number: self.mean(shown, number) for number in numbers}
        pictures = self.room.glowing(means, self.samples(samples), self.next_seed())
        shares = [[self.mean(pictures[glowing], n) / means[n] for glowing in numbers] for n in numbers]
        return np.array(shares).reshape(len(numbers), len(numbers), 3)

    def brushing(self, number: int) -> float | None:
        """Return the direction in which the photograph shows a group brushed, see :func:`brushing`, if it does."""
        if not self.room.directions[number]:
            return None
        return brushing(self.photograph, self.masks[number], self.places, self.uv, self.room.camera)

    def error(self, residuals: Array) -> tuple[float, float]:
        """Return the mean square relative error of the picture, and its standard deviation by noise."""
        used = self.weight[..., 0] > 0
        return unexplained(residuals[:, used], self.weight[used])

    def errors(self, residuals: Array) -> list[float]:
        """Return the relative error of every group with all noise taken off, 0 where it is within noise."""
        missing, found = np.sqrt(self.weight) * residuals, []
        for mask in self.masks:
            mean, noise = unexplained(residuals[:, mask], self.weight[mask]) if mask.any() else (0.0, 0.0)
            found.append(structured(missing, mask) if mean > STEADY * noise else 0.0)
        return [float(np.sqrt(max(square, 0.0))) for square in found]

    def fine_share(self, residuals: Array, number: int) -> float:
        """Return what share of a group's unexplained square varies over few pixels: light does not, patterns do."""
        mask = self.masks[number]
        missing = np.sqrt(self.weight) * residuals
        fine = np.stack([one - smoothed(one, mask, SMOOTH) for one in missing])
        return structured(fine, mask) / max((missing[0] * missing[1])[mask].mean(), 1e-30)


def worse(error: tuple[float, float], least: tuple[float, float]) -> bool:
    """Return whether an error is more than twice the least, for all noise of both; see :meth:`Evidence.error`.

    The least of many is what noise made so, and often negative: all that follow would seem worse.
    """
    return error[0] > 2 * max(least[0], 0.0) + STEADY * float(np.hypot(error[1], 2 * least[1]))
