"""All unknowns together: what each changes in the picture, and the Gauss-Newton step that follows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from ...core.condition import condition
from ...core.inverse import COLOURED, FREE, LEAST, MOST, POWER, STEPS
from ...core.inverse.estimate import newton, normal_equations
from ...core.inverse.photograph import weights
from ...core.progress import Progress, Work
from . import levels
from .evidence import FEWEST, Evidence
from .room import Room

Array = NDArray[np.float64]
Unknown = tuple[int, str]  # a group and a kind of its parameters, or a lamp and POWER
DERIVATIVE_SAMPLES, UNSEEN_SAMPLES = 2, 8  # a pixel of the whole picture; by what only reflections tell of
DERIVATIVE_ENOUGH, DERIVATIVE_MOST = 6000, 64  # samples on a group's own pixels, and on one of them
UNSEEN = 1e-3  # share of the largest derivative below which nothing in the picture tells of a group
TELLING = 0.8  # of what tells of a group: the pixels that hold so much get samples of their own
LONGEST = 0.7  # of a step of what is no shape of a lobe: a factor of two
BRIGHT = 0.8  # reflectance
MOST_CHANGE = 2.0  # of a pixel by the logarithm of a parameter, in radiances about it


class Gains:
    """What share of every unknown's step is taken: 1 over 1 and how often its steps have turned (Kesten 1958).

    Parameters
    ----------
    wanted : sequence of Unknown
    turned : mapping of int to int
        How often the steps of a group have turned before.
    """

    def __init__(self, wanted: Sequence[Unknown], turned: Mapping[int, int]) -> None:
        self.turns = [np.full(3 if kind in COLOURED else 1, turned.get(number, 0)) for number, kind in wanted]
        self._last = [np.zeros(len(one)) for one in self.turns]

    def of(self, moves: list[Array]) -> list[Array]:
        """Return the shares of the next steps."""
        self.turns = [n + (by * last < 0) for n, by, last in zip(self.turns, moves, self._last, strict=True)]
        self._last = moves
        return [1 / (1 + n) for n in self.turns]


def unknowns(room: Room, shapes: bool) -> list[Unknown]:
    """Return what is looked for, as the groups' levels are now, with or without the shapes of lobes."""
    found = [
        (number, kind)
        for number, model in enumerate(room.models)
        for kind in FREE[model.level]
        if number not in room.known and (shapes or kind in COLOURED) and model.level != "texture"
    ]
    return found + [(number, POWER) for number in room.free_lamps]


def derivatives(evidence: Evidence, wanted: Sequence[Unknown], closer: int = 1) -> Work[Array]:
    """Return the change of the picture by every unknown, by two seeds: (2, N, H, W, 3).

    A group's own pixels are rendered with as many samples as they need, or so many times closer. What its diffuse
    reflectance changes elsewhere is what it shines on others where it glows as brightly as it reflects; what its lobe
    changes elsewhere is left out, which slows the search. Groups that no pixel shows, and lamps, are moved, and the
    whole picture is rendered: of the groups the median of nine pixels, for all but some pixels of a mirror would be
    noise, above all fireflies, and what noise in an instrument makes of the photograph's own is the same at every step.
    """
    room = evidence.room
    room.count_bounces()
    seeds = [evidence.next_seed() for _ in range(2)]
    each = evidence.samples(DERIVATIVE_SAMPLES)
    whole = [room.render(each, seed, True) for seed in seeds]
    found = np.zeros((2, len(wanted), *evidence.photograph.shape))
    unseen: list[int] = []
    lobed: dict[int, list[int]] = {}
    for place, (number, kind) in enumerate(wanted):
        mask = evidence.masks[number] if kind != POWER else None
        if mask is None or not mask.any():
            if kind in ("diffuse", POWER):
                unseen.append(place)
        elif room.models[number].level == "diffuse":  # it is all that it shows
            found[:, place, mask] = [shown[mask] for shown in whole]
        else:
            lobed.setdefault(number, []).append(place)
    if unseen:
        more = evidence.samples(UNSEEN_SAMPLES)
        changed = _changes(room, [wanted[place] for place in unseen], seeds, lambda seed: room.render(more, seed, True))
        found[:, unseen] = yield from changed
        for place in unseen:
            if wanted[place][1] != POWER:
                found[:, place] = median_filter(found[:, place], size=(1, 3, 3, 1))
    for number, places in lobed.items():
        mask = evidence.masks[number]
        samples = int(np.clip(closer * DERIVATIVE_ENOUGH / mask.sum(), 1, closer * DERIVATIVE_MOST))
        own = yield from own_derivatives(evidence, [wanted[place] for place in places], samples)
        for place, slopes in zip(places, own.swapaxes(0, 1), strict=True):
            found[:, place, mask] = slopes
    _let_glow(evidence, wanted, found, each, seeds)
    most = _most(evidence.photograph)
    return np.clip(found, -most, most)


def own_derivatives(evidence: Evidence, wanted: Sequence[Unknown], samples: int) -> Work[Array]:
    """Return the change of a group's own pixels by some of its parameters, by two seeds: (2, N, P, 3)."""
    room, mask = evidence.room, evidence.masks[wanted[0][0]]
    seeds = [evidence.next_seed() for _ in range(2)]
    found = yield from _changes(room, wanted, seeds, lambda seed: room.pixels(mask, samples, seed, True))
    most = _most(evidence.photograph)[mask]
    return np.clip(found, -most, most)


def _changes(
    room: Room, wanted: Sequence[Unknown], seeds: Sequence[int], render: Callable[[int], Array]
) -> Work[Array]:
    """Return the change of what is rendered by a seed, (..., 3), by every unknown: (S, N, ..., 3)."""
    now = np.stack([render(seed) for seed in seeds])
    found = np.zeros((len(seeds), len(wanted), *now.shape[1:]))
    for place, (number, kind) in enumerate(wanted):
        by = _away(room, number, kind)
        with room.moving(number, kind, by):
            found[:, place] = (np.stack([render(seed) for seed in seeds]) - now) / by
        yield Progress("derivatives", place + 1, len(wanted))
    return found


def _away(room: Room, number: int, kind: str) -> float:
    """Return by what a parameter is moved to see what changes: reflectances that are almost 1 to darker ones."""
    bright = kind in COLOURED and getattr(room.models[number], kind).max() > BRIGHT
    return -STEPS[kind] if bright else STEPS[kind]


def _most(photograph: Array) -> Array:
    """Return what a parameter can change, (H, W, 3): any instrument will do, and one without fireflies does best."""
    return MOST_CHANGE * np.sqrt(1 / np.maximum(weights(photograph), 1e-30))


def _let_glow(evidence: Evidence, wanted: Sequence[Unknown], found: Array, samples: int, seeds: Sequence[int]) -> None:
    """Add to derivatives what the groups that are seen shine on all pixels but, where these are moved, their own."""
    places = {n: place for place, (n, kind) in enumerate(wanted) if kind == "diffuse" and evidence.masks[n].any()}
    glow = {n: evidence.mean(found[:, place].mean(axis=0), n) for n, place in places.items()}
    for s, seed in enumerate(seeds):
        for number, shining in evidence.room.glowing(glow, samples, seed).items():
            mask = evidence.masks[number]
            plain = evidence.room.models[number].level == "diffuse"
            shining[mask] = shining[mask] - glow[number] if plain else 0.0
            found[s, places[number]] += shining


def _telling(evidence: Evidence) -> Array:
    """Return the weights of pixels: a texture shows whatever the photograph does, and tells nothing of lamps."""
    room = evidence.room
    if not room.free_lamps:
        return evidence.weight
    textured = [mask for mask, model in zip(evidence.masks, room.models, strict=True) if model.level == "texture"]
    left = evidence.weight * ~np.any(textured, axis=0)[..., None] if textured else evidence.weight
    return left if left.any() else evidence.weight


def reflections(evidence: Evidence, wanted: Sequence[Unknown], slopes: Array) -> list[NDArray[np.bool_]]:
    """Return the pixels (H, W) of each group that tell most of what is seen in it alone, by derivatives of all."""
    found = []
    for place, (number, kind) in enumerate(wanted):
        if kind not in COLOURED or evidence.masks[number].any():
            continue
        power = np.maximum(slopes[0, place] * slopes[1, place] * evidence.weight, 0.0).sum(axis=-1)
        falling = np.sort(power, axis=None)[::-1]
        least = falling[np.searchsorted(np.cumsum(falling), TELLING * falling.sum())]
        found += [mask & (power >= least) & (power > 0) for mask in evidence.masks]
    return [mask for mask in found if mask.sum() >= FEWEST]


def sizes(room: Room, wanted: Sequence[Unknown]) -> Array:
    """Return what the picture's derivatives by logarithms grow with, (N, 3): reflectances and powers; of shapes, 1."""
    found = np.ones((len(wanted), 3))
    for place, (number, kind) in enumerate(wanted):
        if kind == POWER:
            found[place] = room.powers[number]
        elif kind in COLOURED:
            found[place] = np.maximum(getattr(room.models[number], kind), LEAST)
    return found


def _bounds(room: Room, unknown: Unknown) -> tuple[Array, Array]:
    """Return the least and the largest step of an unknown: where reflectances end, steps do."""
    kind = unknown[1]
    longest = np.full(3 if kind in COLOURED else 1, levels.LONGEST.get(kind, LONGEST))
    if kind not in COLOURED:
        return -longest, longest
    now = sizes(room, [unknown])[0]
    return np.maximum(-longest, np.log(LEAST / now)), np.minimum(longest, np.log(MOST / now))


def step(
    evidence: Evidence, wanted: Sequence[Unknown], slopes: Array, residuals: Array, damping: float
) -> tuple[list[Array], list[Array], set[int], float]:
    """Return the step of every unknown, its deviation, the groups that the picture tells nothing of, and the condition.

    Steps and deviations are (3,) of reflectances and (1,) of what all colours share. Steps end where reflectances do,
    and at the longest that derivatives are good for.
    """
    columns, owner = [], []
    for place, (_, kind) in enumerate(wanted):
        coloured = kind in COLOURED
        for colour in range(3 if coloured else 1):
            column = np.zeros_like(slopes[:, place])
            chosen = slice(colour, colour + 1) if coloured else slice(None)
            column[..., chosen] = slopes[:, place][..., chosen]
            columns.append(column.reshape(2, -1))
            owner.append(place)
    weight = _telling(evidence).ravel()
    used = weight > 0
    jacobians = np.stack(columns, axis=1)[:, :, used]
    ends = zip(*(_bounds(evidence.room, one) for one in wanted), strict=True)
    bounds = tuple(np.concatenate(one) for one in ends)
    move, deviation = newton(jacobians, residuals.reshape(2, -1)[:, used], weight[used], damping, bounds=bounds)
    power = (jacobians[0] * jacobians[1] * weight[used]).sum(axis=1)
    parts = [np.array(owner) == place for place in range(len(wanted))]
    shown = {
        number
        for (number, kind), part in zip(wanted, parts, strict=True)
        if kind != POWER and power[part].max() > UNSEEN**2 * power.max()
    }
    untold = {number for number, kind in wanted if kind != POWER} - shown
    told = float(condition(normal_equations(jacobians, weight[used])))
    return [move[part] for part in parts], [deviation[part] for part in parts], untold, told
