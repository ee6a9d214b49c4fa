"""Lamps of unknown power: where a search begins."""

from __future__ import annotations

import numpy as np

from ...core.inverse.lamps import powers
from .evidence import Evidence

SAMPLES = 16
WORLD = 0.02  # share of the light that no lamp gives, above which that fixes the scale
LEAST_POWER = 1e-3  # of that in the scene, so that the search can still move it


def start_lamps(evidence: Evidence) -> None:
    """Let the lamps whose power is looked for have what their pictures alone tell, beside diffuse groups.

    Where nothing tells the scale, the brightest stays as it is in the scene and is no longer looked for.
    """
    room = evidence.room
    rest = room.alone(None, SAMPLES, evidence.next_seed())
    shown = [room.alone(n, SAMPLES, evidence.next_seed()) - rest for n in range(len(room.lamps))]
    light = np.array([picture.mean() for picture in shown])
    told = room.known or len(room.free_lamps) < len(room.lamps) or rest.mean() > WORLD * light.sum()
    if not told:
        room.free_lamps.remove(int(light.argmax()))
    used = evidence.weight[..., 0] > 0
    fixed = {number: 1.0 for number in range(len(room.lamps)) if number not in room.free_lamps}
    factors = powers(
        np.stack([picture[used] for picture in (*shown, rest)]),
        evidence.photograph[used],
        evidence.weight[used],
        evidence.index[used],
        {number: np.ones(3) for number in room.known},
        {**fixed, len(shown): 1.0},
    )
    for number in room.free_lamps:
        room.power(number, max(factors[number], LEAST_POWER))
