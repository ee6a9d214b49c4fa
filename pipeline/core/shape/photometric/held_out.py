"""Pictures that the fit has not seen: the honest error of a decomposition."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from .acls import Decomposition
from .foreseen import predict
from .sight import Sight


def split(sight: Sight, every: int) -> tuple[Sight, Sight | None]:
    """Return the lights for the fit and every so many-th one for judging it; all and None where ``every`` is 0."""
    if every == 0:
        return sight, None
    number = np.arange(len(sight.lights))
    unseen = number % every == every // 2
    return _lights(sight, ~unseen), _lights(sight, unseen)


def _lights(sight: Sight, chosen: Any) -> Sight:
    values, usable = (np.ascontiguousarray(part[:, chosen]) for part in (sight.values, sight.usable))
    return dataclasses.replace(sight, values=values, usable=usable, lights=np.ascontiguousarray(sight.lights[chosen]))


def held_out_error(unseen: Sight, found: Decomposition) -> dict[str, Any]:
    """Return the relative RMS error on lights left out, over all pixels and for those that each basis leads.

    Cast shadows of those lights are not foreseen: they count as errors.
    """
    model = np.empty(unseen.values.shape, np.float32)
    predict(unseen.lights, unseen.near, unseen.points, unseen.views, found.table, found.normals, found.weights, model)
    squares = ((model - unseen.values) ** 2 * unseen.usable[..., None]).sum(axis=(1, 2), dtype=np.float64)
    powers = (unseen.values**2 * unseen.usable[..., None]).sum(axis=(1, 2), dtype=np.float64)
    size = found.table.mean(axis=(0, 1, 3))
    leader = np.argmax(found.weights.mean(axis=2) * size, axis=1)

    def error(pixels: Any) -> float:
        return float(np.sqrt(squares[pixels].sum() / max(powers[pixels].sum(), 1e-30)))

    return {
        "lights": len(unseen.lights),
        "rel_rms": error(slice(None)),
        "rel_rms_of_bases": [error(leader == k) if (leader == k).any() else None for k in range(len(size))],
    }
