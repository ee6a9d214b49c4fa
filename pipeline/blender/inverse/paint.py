"""The texture of a group that no lobe explains."""

from __future__ import annotations

import numpy as np

from ...core.inverse import LEAST, grey
from ...core.inverse.texture import light_on, reflectance_map, seen_reflectance, sharpened
from .evidence import Evidence

SAMPLES, LIGHT_SAMPLES = 16, 32  # a pixel of pictures by one seed, and of the light by two
SHARPENED = 3  # rounds


def paint(evidence: Evidence, number: int) -> None:
    """Let a group have the texture that its pixels in the photograph over those of a white surface make, sharpened.

    Noise is no hindrance: with the same seed, the render over that of the white surface has nearly none.
    """
    room = evidence.room
    whole, seed = evidence.whole(number), evidence.next_seed()
    inner = evidence.masks[number][whole]
    room.paint(number, None)
    with room.trying(number, grey(LEAST)):
        dark = room.pixels(whole, SAMPLES, seed, True)
    with room.trying(number, grey(0.5)):
        plain = (room.pixels(whole, SAMPLES, seed, True) - dark) / (0.5 - LEAST)
        white = np.mean([evidence.render(LIGHT_SAMPLES) for _ in range(2)], axis=0) / 0.5
    light = light_on(white, evidence.masks[number])[whole]
    wanted, tells = seen_reflectance(evidence.photograph[whole], light, dark, plain, inner)
    uv, values = evidence.uv[whole][tells], wanted[tells]
    for _ in range(SHARPENED):
        room.paint(number, reflectance_map(values, uv))
        shown = (room.pixels(whole, SAMPLES, seed, True) - dark) / np.maximum(plain, 1e-12)
        values = sharpened(values, wanted[tells], shown[tells])
    room.paint(number, reflectance_map(values, uv))
