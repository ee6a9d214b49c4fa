"""Normal and weights of every pixel, from coarse to fine: each scale expects what the coarser one found.

Lights and bases are known by now, from blocks of pixels. A single pixel in which noise is strong, or none of whose
lights makes a highlight, leaves its normal and weights half open: another pair of them explains it as well. Blocks have
less noise, and so does what the blocks around have in common. A pixel is pulled towards what they found, as strongly as
pixels that are sure of themselves agree with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter, map_coordinates

from ...progress import Progress, Work
from ..photometric.sight import Sight
from ..photometric.start import half_way, seen_from
from .joint import Joint
from .lamps import places
from .pictures import Pictures
from .pixels import refine_pixels

Array = NDArray[np.float64]

AT_ONCE = 20_000  # pixels refined between two words of progress
AROUND = 1.5  # standard deviation of the surroundings in which materials are alike [blocks]
OWN = float(gaussian_filter(np.pad([[1.0]], 9), AROUND).max())  # share of a block in its own surroundings
LEAST_SPREAD = 0.01  # of normals about what is expected [rad], and of weights over the mean one


@dataclass(frozen=True)
class Scale:
    """The pictures in blocks of so many pixels' side."""

    side: int
    pictures: Pictures


@dataclass(frozen=True)
class Fitted:
    """What was found of P blocks or pixels.

    Parameters
    ----------
    normals, weights : (P, 3), (P, K) float64
    misfit : (P,) float64
        Mean over the lit values of Cauchy's cost.
    noise : (P,) float64
        Cost of a value that is off by one standard deviation.
    deviation : (P,) float64
        Standard deviation of the normal [rad].
    offsets : (P, 3) float64
        Of the surface from the centre to which near lights' places refer, as it was taken.
    """

    normals: Array
    weights: Array
    misfit: Array
    noise: Array
    deviation: Array
    offsets: Array

    @property
    def both(self) -> Array:
        """Normals and weights (P, 3 + K)."""
        return np.concatenate([self.normals, self.weights], axis=1)


def every_pixel(scales: Sequence[Scale], joint: Joint) -> Work[Fitted]:
    """Return what the pixels of the finest scale are, from a solution of the coarsest.

    Parameters
    ----------
    scales : sequence of Scale
        Coarsest first.
    joint : Joint
    """
    now, total = scales[0], 2 * sum(len(scale.pictures.values) for scale in scales)
    offsets = joint.offsets
    nothing = np.zeros((len(joint.normals), 3 + joint.weights.shape[1]))
    own = (joint.normals, joint.weights)
    found = yield from _fitted(now.pictures, joint, offsets, nothing, nothing, [own], (0, total))
    expected = _surroundings(now.pictures.mask, found)
    pulls = _pulls(found, expected)
    pulls[:, :3] = 0.0  # a normal at an edge is none of its surroundings'
    found = yield from _fitted(
        now.pictures, joint, offsets, expected, pulls, [own, _parts(expected)], (len(own[0]), total)
    )
    done = 2 * len(own[0])
    for scale in scales[1:]:
        expected, offsets = _unit(finer(now, scale, found.both)), finer(scales[0], scale, joint.offsets)
        start, views = _parts(expected), scale.pictures.views
        sight = Sight(
            scale.pictures.values.astype(np.float32), scale.pictures.lit.astype(np.float32), places(joint.lights),
            joint.near, offsets, views,
        )  # fmt: skip
        starts = [(seen_from(start[0], sight), start[1]), (half_way(sight), start[1])]
        nothing = np.zeros_like(expected)
        free = yield from _fitted(scale.pictures, joint, offsets, nothing, nothing, starts, (done, total))
        starts.append((free.normals, free.weights))
        done += len(views)
        found = yield from _fitted(
            scale.pictures, joint, offsets, expected, _pulls(free, expected), starts, (done, total)
        )
        now, done = scale, done + len(views)
    return found


def _fitted(
    pictures: Pictures, joint: Joint, offsets: Array, expected: Array, pulls: Array,
    starts: Sequence[tuple[Array, Array]], progress: tuple[int, int],
) -> Work[Fitted]:  # fmt: skip
    """Fit every pixel from some starts (P, 3), (P, K), and return the best ends."""
    pixels, bases = len(expected), expected.shape[1] - 3
    normals, weights = np.empty((pixels, 3)), np.empty((pixels, bases))
    misfit, stiffness = np.empty((2, pixels))
    lights = np.ascontiguousarray(joint.lights)
    for first in range(0, pixels, AT_ONCE):
        part = slice(first, min(first + AT_ONCE, pixels))
        least = np.full(part.stop - part.start, np.inf)
        for start in starts:
            end = (start[0][part].copy(), start[1][part].copy(), *np.empty((3, len(least))))
            refine_pixels(
                pictures.values[part], pictures.usual[part], pictures.noise, pictures.lit[part], pictures.views[part],
                offsets[part], lights, joint.coefficients, expected[part], pulls[part], *end,
            )  # fmt: skip
            better = end[2] < least
            for kept, new in zip((normals, weights, misfit, stiffness), (*end[:2], *end[3:]), strict=True):
                kept[part][better] = new[better]
            least[better] = end[2][better]
        yield Progress("normals", progress[0] + part.stop, progress[1], "pixels")
    used = np.maximum((pictures.lit > 0).sum(axis=1), 1)
    noise = misfit * used / np.maximum(used - 2, 1)
    deviation = np.minimum(np.sqrt(noise / np.maximum(stiffness, 1e-12)), np.pi / 2)
    return Fitted(normals, weights, misfit, noise, deviation, offsets)


def _pulls(found: Fitted, expected: Array) -> Array:
    """Return what a squared difference from what is expected adds to the cost, (P, 3 + K), alike for all pixels.

    It is the cost of one standard deviation, where differences are as those of the surer half of the pixels.
    """
    apart = (found.both - expected)[found.deviation <= np.median(found.deviation)]
    normals = np.full(3, 1.4826 * float(np.median(np.linalg.norm(apart[:, :3], axis=1))))
    weights = 1.4826 * np.median(np.abs(apart[:, 3:]), axis=0)
    least = LEAST_SPREAD * np.append(np.ones(3), np.maximum(found.weights.mean(axis=0), 1e-9))
    spread = np.maximum(np.append(normals, weights), least)
    return np.tile(float(np.median(found.noise)) / spread**2, (len(expected), 1))


def _surroundings(mask: NDArray[np.bool_], found: Fitted) -> Array:
    """Return the mean normal and weights (P, 3 + K) around every block, by how sure they are; its own if alone."""
    sure = 1.0 / (found.deviation**2 + float(np.median(found.deviation)) ** 2 + LEAST_SPREAD**2)
    picture = np.zeros(mask.shape)

    def around(values: Array) -> Array:
        picture[mask] = values
        return np.asarray(gaussian_filter(picture, AROUND, mode="constant")[mask] - OWN * values)

    total = around(sure)
    alone = total <= 1e-6 * sure
    both = found.both
    mean = np.stack([around(sure * column) for column in both.T], axis=1) / np.where(alone, 1.0, total)[:, None]
    return _unit(np.where(alone[:, None], both, mean))


def finer(coarse: Scale, fine: Scale, values: Array) -> Array:
    """Return values (P, N) of a coarse scale at the places of a finer one."""
    nearest = distance_transform_edt(~coarse.pictures.mask, return_distances=False, return_indices=True)
    place = (np.argwhere(fine.pictures.mask) + 0.5) * fine.side / coarse.side - 0.5
    picture, columns = np.zeros(coarse.pictures.mask.shape), []
    for column in values.T:
        picture[coarse.pictures.mask] = column
        columns.append(map_coordinates(picture[tuple(nearest)], place.T, order=1, mode="nearest"))
    return np.ascontiguousarray(np.stack(columns, axis=1))


def _unit(both: Array) -> Array:
    """Return the same with normals of length one."""
    both[:, :3] /= np.maximum(np.linalg.norm(both[:, :3], axis=1, keepdims=True), 1e-9)
    return both


def _parts(both: Array) -> tuple[Array, Array]:
    return np.ascontiguousarray(both[:, :3]), np.ascontiguousarray(both[:, 3:])
