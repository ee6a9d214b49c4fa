"""What matters for reflectance: the model, how many bases, how many roughnesses."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any

from ..capture import Capture
from ..reflectance import ReflectanceSettings, fit, tables
from ..shape import Shape
from . import Variant

BASES = (1, 2, 3, 4)
CLUSTERS = (1, 3, 6)


def variants(shape: Shape, capture: Capture, settings: ReflectanceSettings) -> list[Variant]:
    """Return what is tried: basis BRDFs as tables, or a lobe per pixel, on the same lights held out."""

    found = []
    for bases in BASES:
        chosen = dataclasses.replace(settings, model="bivariate", bases=bases)
        label = f"{bases} table" + "s" * (bases > 1)
        described = {"model": "bivariate", "bases": bases}
        found.append(Variant(label, described, 8.0 * bases, partial(tables.fit, shape, capture, chosen), _judged))
    for clusters in CLUSTERS:
        chosen = dataclasses.replace(settings, model="ggx", clusters=clusters)
        label = f"lobe, {clusters} roughness" + "es" * (clusters > 1)
        described = {"model": "ggx", "clusters": clusters}
        found.append(Variant(label, described, 1.0 + 0.2 * clusters, partial(fit.fit, shape, capture, chosen), _judged))
    return found


def _judged(found: Any) -> dict[str, float]:
    return {"material_rel_rms": found.notes["material_rel_rms"]}
