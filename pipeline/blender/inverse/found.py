"""What a search ends with."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.inverse import Model

Array = NDArray[np.float64]


@dataclass
class Found:
    """What the search ended with.

    Parameters
    ----------
    models : list of Model
    deviations : list of dict
        Standard deviation of each kind of parameter that render noise causes: relative, of angles in degrees.
    seen : list of str
        ``"directly"``, ``"in reflections"`` or ``"not at all"``.
    pixels : list of int
        Pixels that show the group and are trusted.
    tried : list of list of dict
        Levels that were tried, each with its relative error.
    costs : list of dict
        ``renders`` and ``seconds`` that were spent on each group alone.
    lamps : list of dict
        ``name``, ``power``, ``unit`` and relative ``deviation`` of the lamps whose power was looked for.
    history : list of dict
        After every step: ``stage``, ``seconds``, ``error`` (relative, render noise taken off), and ``diffuse``, what
        each group reflects.
    pictures : dict of str to (H, W, 3) float64
        What the room looked like when a stage last ended, denoised.
    """

    models: list[Model]
    deviations: list[dict[str, Any]]
    seen: list[str]
    pixels: list[int]
    tried: list[list[dict[str, Any]]]
    costs: list[dict[str, float]]
    lamps: list[dict[str, Any]] = field(default_factory=list)
    history: list[dict[str, Any]] = field(default_factory=list)
    pictures: dict[str, Array] = field(default_factory=dict)
