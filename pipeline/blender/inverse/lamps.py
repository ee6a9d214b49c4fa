"""Lamps of unknown power: where a search begins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.inverse.lamps import powers
from .evidence import Evidence
from .groups import place_of
from .room import Room

SAMPLES = 16
FIXED = 0.02  # light of known power as a share of the other, above which it fixes the scale
LEAST_POWER = 1e-3  # of that in the scene, so that the search can still move it
ALL = "all"


def listed_lamps(room: Room, words: str) -> list[int]:
    """Return the lamps named between commas, or all; raise a LightsphereError for one that is not there."""
    names = [lamp.name for lamp in room.lamps]
    wanted = names if words == ALL else filter(None, map(str.strip, words.split(",")))
    return [place_of(name, names, "unknown power", "lamp") for name in wanted]


def start_lamps(evidence: Evidence) -> None:
    """Let the lamps whose power is looked for have what their pictures alone tell, beside diffuse groups.

    Where nothing tells the scale, not even one that the picture shows, the brightest stays as it is in the scene and
    is no longer looked for.
    """
    room = evidence.room
    rest = room.alone(None, SAMPLES, evidence.next_seed())
    shown = [room.alone(n, SAMPLES, evidence.next_seed()) - rest for n in range(len(room.lamps))]
    used = evidence.weight[..., 0] > 0
    light = np.array([picture.mean() for picture in shown])
    room.free_lamps = [number for number in room.free_lamps if light[number] > 0]
    seen = evidence.shines() & used
    fixed_light = rest.mean() + np.delete(light, room.free_lamps).sum()
    if room.free_lamps and not (room.known or seen.any() or fixed_light > FIXED * light[room.free_lamps].sum()):
        room.free_lamps.remove(int(light.argmax()))
    fixed = {number: 1.0 for number in range(len(room.lamps)) if number not in room.free_lamps}
    factors = powers(
        np.stack([picture[used] for picture in (*shown, rest)]),
        evidence.photograph[used],
        evidence.weight[used],
        evidence.index[used],
        {number: np.ones(3) for number in (*room.known, *np.unique(evidence.index[seen]))},
        {**fixed, len(shown): 1.0},
    )
    for number in room.free_lamps:
        room.power(number, max(factors[number], LEAST_POWER))


def found_lamps(room: Room, deviations: Sequence[float | None]) -> list[dict[str, Any]]:
    """Return name, power, unit and relative deviation of the lamps whose power was looked for."""
    lamps = [room.lamps[number] for number in room.free_lamps]
    return [
        {"name": lamp.name, "power": lamp.power, "unit": lamp.unit, "deviation": deviation}
        for lamp, deviation in zip(lamps, deviations, strict=True)
    ]
