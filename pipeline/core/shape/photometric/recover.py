"""Shape and reflectance from known lights: normals per pixel, a surface through them, tables and weight maps."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...capture import Capture
from ...condition import BAD, condition, noted
from ...errors import LightsphereError
from ...lights import Lights
from ...progress import Work
from ...reflectance.bivariate import Bivariate
from .. import Shape
from ..double_sphere import recover as by_double_sphere
from ..integration import integrate
from ..settings import ShapeSettings
from . import lambertian, matte
from .acls import Decomposition, Options, decompose
from .held_out import held_out_error, split
from .sight import Sight, see
from .start import seen_from

FEWEST = 3  # lights that fix a Lambertian normal
USUAL_DEVIATION = np.radians(1.0)  # of a normal whose confidence is one half
PARALLEL = 1e-6  # least over largest spread of the light directions


@dataclass(frozen=True)
class Recovered:
    """What :func:`recover` found: the shape and, but for the Lambertian method, its reflectance; under which lights."""

    shape: Shape
    reflectance: Bivariate | None
    lights: Lights


def recover(capture: Capture, settings: ShapeSettings) -> Work[Recovered]:
    """Recover normals, surface and reflectance of a capture with known lights.

    Distant lights give normals, from which the surface is integrated. On a double-sphere capture depth comes first,
    by double covering; the normals found on it with every pixel's own lights then repair the depth. Where a matte
    surface explains all but noise (:mod:`.matte`), its normals stay, and ``notes["matte"]`` says so.

    Parameters
    ----------
    capture : Capture
    settings : ShapeSettings
        ``method`` is ``"acls"`` or ``"lambertian"``.

    Raises
    ------
    LightsphereError
        For lights that are too few, unknown or in one plane, or an empty mask.
    """
    check(capture)
    mask = capture.mask().copy()
    if not mask.any():
        raise LightsphereError(f"{capture.folder}: no pixel shows the object; correct the mask or the camera")
    before = None
    if capture.lights.kind == "near":
        before = yield from by_double_sphere(capture, settings)
        mask = mask & np.isfinite(before.depth)
    sight = yield from see(capture, mask, None if before is None else before.depth)
    enough = sight.lit().sum(axis=1) >= FEWEST
    if not enough.any():
        raise LightsphereError(f"{capture.folder}: no pixel is lit by {FEWEST} lights; look at the pictures")
    mask[mask] = enough
    sight = sight.select(enough)
    if settings.method == "lambertian":
        return Recovered(_lambertian(capture, mask, sight, before), None, capture.lights)
    used, unseen = split(sight, settings.held_out)
    by_symmetry = settings.start == "symmetry"
    options = Options(settings.bases, settings.colour, rounds=settings.rounds, by_symmetry=by_symmetry)
    known, sure = None, None
    if before is not None:
        known = seen_from(before.normal[mask].astype(np.float64), used, 0.0)
    elif not by_symmetry:
        b = lambertian.robust(used)
        sure = matte.deviation(used, b, mask)
        known = None if sure is None else seen_from(b, used, 0.0)
    found = yield from decompose(used, options, known, held=sure is not None)
    if sure is not None:
        found = dataclasses.replace(found, deviation=sure)
    reflectance = as_reflectance(mask, found)
    if unseen is not None:
        error = held_out_error(unseen, found)
        reflectance = dataclasses.replace(reflectance, notes={**reflectance.notes, "held_out": error})
    shape = _noted(_shape(capture, mask, found, before), condition(sight.light_equations(), one_unit=True))
    shape = dataclasses.replace(shape, notes={**shape.notes, "matte": sure is not None})
    return Recovered(shape, reflectance, capture.lights)


def _noted(shape: Shape, told: NDArray[np.float64]) -> Shape:
    """Note how well every pixel's lights tell the parts of its normal apart."""
    return dataclasses.replace(shape, notes={**shape.notes, "condition": {"lights of a pixel": noted(told)}})


def check(capture: Capture) -> None:
    """Raise LightsphereError when the lights cannot fix normals."""
    lights = capture.lights
    if lights.kind == "unknown":
        raise LightsphereError(f"{capture.folder}: the lights are unknown; give their directions when you import")
    if len(lights) < FEWEST:
        raise LightsphereError(f"{capture.folder} has {len(lights)} lights; normals need at least {FEWEST}")
    spread = np.linalg.svd(lights.position, compute_uv=False)
    if lights.kind == "distant" and not spread[2] > PARALLEL * spread[0]:
        raise LightsphereError(
            f"{capture.folder}: all lights lie in one plane with the object; add one that stands out of it"
        )


def _lambertian(capture: Capture, mask: NDArray[np.bool_], sight: Sight, before: Shape | None) -> Shape:
    b = lambertian.robust(sight)
    known = np.isfinite(b).all(axis=1) & (np.linalg.norm(b, axis=1) > 0)
    if not known.any():
        raise LightsphereError(f"{capture.folder}: no pixel is lit from three independent directions; add lights")
    mask = mask.copy()
    mask[mask] = known
    seen = sight.select(known)
    told = condition(seen.light_equations(), one_unit=True)
    return _noted(surface(capture, mask, seen_from(b[known], seen, 0.0), 1 / (1 + told / BAD), before, {}), told)


def _shape(capture: Capture, mask: NDArray[np.bool_], found: Decomposition, before: Shape | None) -> Shape:
    confidence = (1.0 - found.misfit) / (1.0 + found.deviation / USUAL_DEVIATION)
    layers = {
        "misfit": found.misfit,
        "normal_deviation": np.degrees(found.deviation),
        "start_explains_better": found.kept.astype(np.float64),
    }
    return surface(capture, mask, found.normals, confidence, before, layers)


def surface(
    capture: Capture,
    mask: NDArray[np.bool_],
    normals: NDArray[np.float64],
    confidence: NDArray[np.float64],
    before: Shape | None,
    layers: dict[str, NDArray[np.float64]],
) -> Shape:
    """Return the surface through the normals (P, 3) of a mask's pixels, on the depth of an earlier shape if any."""
    normal = np.full((*mask.shape, 3), np.nan)
    normal[mask] = normals
    trust, maps = np.zeros(mask.shape), {name: np.full(mask.shape, np.nan, np.float32) for name in layers}
    trust[mask] = confidence
    for name, layer in layers.items():
        maps[name][mask] = layer
    if before is None:
        depth = integrate(normal, mask, capture.camera, trust)
        notes = {"level": "open"}  # normals leave the scale (pinhole) or shift (orthographic) open
    else:
        depth = integrate(normal, mask, capture.camera, trust, before.depth, before.layers.get("expected_error"))
        trust = np.sqrt(trust * before.confidence)
        notes = dict(before.notes)
    trust = np.where(np.isfinite(depth), trust, 0.0)
    single = np.float32
    return Shape(capture.camera, depth.astype(single), normal.astype(single), trust.astype(single), maps, notes)


def as_reflectance(mask: NDArray[np.bool_], found: Decomposition) -> Bivariate:
    """Arrange the pixels' weights and misfits as maps."""
    weights = np.full((*mask.shape, *found.weights.shape[1:]), np.nan, np.float32)
    weights[mask] = found.weights
    error = np.full(mask.shape, np.nan, np.float32)
    error[mask] = found.misfit
    notes = {
        "bases": found.table.shape[2],
        "objective": list(found.objective),
        "start_explains_better": float(found.kept.mean()),
        "nodes_seen": float((found.seen > 0).mean()),
    }
    return Bivariate(found.table, found.seen, weights, error, notes)
