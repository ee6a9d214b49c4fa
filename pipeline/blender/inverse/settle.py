"""The last word on a lobe: many renders, each with noise of its own, say together what one of them cannot.

Where few pixels show a lobe its width and its reflectance make up for each other, and a descent of one pair of renders
ends where their noise has a valley. Here every step of Gauss and Newton is taken as it comes, by derivatives J that are
the mean of several looks, and steps become shorter, so that the lobe ends in the mean of what all renders say (Robbins
and Monro 1951)::

    x <- x + (J^T W J)^-1 J^T W (photograph - render) / n        n = 1 + how often the step of a parameter turned

(Kesten 1958). Noise in J, which is not the renders', shortens steps and leaves where they end.
"""

from __future__ import annotations

import numpy as np

from ...core.inverse import FREE
from ...core.progress import Progress, Work
from . import together
from .evidence import Evidence

LOOKS, ROUNDS = 4, 14
ENOUGH, MOST = 320_000, 1024  # samples on a group's pixels, and on one of them, of a render beside the photograph
LESS = 4  # times fewer of a look at derivatives
DAMPING = 1e-3


def settle(evidence: Evidence, number: int) -> Work[None]:
    """Let a group have the lobe and the reflectances that explain most near its own.

    One that is closed before LOOKS steps are taken leaves the group as it was.
    """
    room, mask = evidence.room, evidence.masks[number]
    before, is_sure = room.models[number], False
    samples = int(np.clip(ENOUGH / mask.sum(), 1, MOST))
    kinds = FREE[before.level]
    wanted = [(number, kind) for kind in kinds]
    slopes = np.zeros((len(kinds), *mask.shape, 3))
    missing = np.zeros((2, *mask.shape, 3))
    gains = together.Gains(wanted, {})
    try:
        for turn in range(ROUNDS):
            if turn < LOOKS:
                seen = yield from together.own_derivatives(evidence, wanted, -(-samples // LESS))
                slopes[:, mask] += (seen.mean(axis=0) - slopes[:, mask]) / (turn + 1)
            for one in missing:
                shown = room.pixels(mask, samples, evidence.next_seed(), steady=True)
                one[mask] = evidence.photograph[mask] - shown
            moves, *_ = together.step(evidence, wanted, np.stack([slopes, slopes]), missing, DAMPING)
            for kind, by, gain in zip(kinds, moves, gains.of(moves), strict=True):
                room.move(number, kind, gain * by)
            is_sure = turn + 1 >= LOOKS
            yield Progress("settle", turn + 1, ROUNDS)
    finally:
        if not is_sure:
            room.show(number, before)
