"""Shape, reflectance and lights of a capture whose lights are not known.

The lights and the bases come from the pictures reduced to a few thousand pixels (:mod:`.solve`, or :mod:`.source`);
then every pixel is fitted to them by itself, and the surface integrated. Lights are distant, or near points whose
places and powers are found. The brightness of all lights together is open: it is set so that bright pixels get the
albedo :data:`.pictures.BRIGHT_ALBEDO`. So is the size of all: of a pinhole camera's pictures the object and the lights'
distances.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...capture import Capture
from ...condition import noted
from ...errors import LightsphereError
from ...lights import SURFACES, Lights
from ...progress import Work
from ...reflectance.bivariate import Bivariate
from .. import Shape, level
from ..photometric.bases import gather
from ..photometric.recover import USUAL_DEVIATION, surface
from ..photometric.sight import Sight, see
from ..settings import STRENGTHS, ShapeSettings
from . import lobes
from .certainty import deviations, doubts
from .descent import Problem
from .found import Found
from .joint import Joint
from .known import known
from .lamps import directions, places
from .outline import outline
from .pictures import Pictures, blocks, pictures_of, reduced
from .scales import Scale, every_pixel
from .solve import solve
from .source.recover import alternated

Array = NDArray[np.float64]

FEWEST = 6  # photographs that tell lights and normals apart
PIXELS, USUAL_COUNT = 1800, 12  # about so many are solved together with the lights of so many photographs
FEW_PIXELS = 60


@dataclass(frozen=True)
class Recovered:
    """Shape, reflectance, and the lights in the world with their standard deviations (L,) [degrees].

    ``end`` is the solution of the coarse pictures, where another can begin from it.
    """

    end: Joint | None
    shape: Shape
    reflectance: Bivariate
    lights: Lights
    deviation: Array
    doubts: tuple[str, ...]


def recover(
    capture: Capture, settings: ShapeSettings, proxy: Shape | None = None, before: Recovered | None = None
) -> Work[Recovered]:
    """Recover lights, normals, surface, bases and weight maps; what the capture says of its lights is not looked at.

    Parameters
    ----------
    capture : Capture
    settings : ShapeSettings
    proxy : Shape, optional
        What the camera sees of a rough mesh of the object or of a part of it: its normals are a cue, its depth sets
        the size (pinhole) or the place along the view (orthographic) that normals leave open.
    before : Recovered, optional
        From nearly the same photographs: what to begin with instead of trying several starts.

    Raises
    ------
    LightsphereError
        For fewer than six photographs, too small an object, pictures without anything to start from, a file of
        known lights that is none, or near lamps or a choice of cues with the source's
        objective.
    """
    if len(capture) < FEWEST:
        raise LightsphereError(
            f"{capture.folder} has {len(capture)} photographs; unknown lights need at least {FEWEST}, better 10 to 15"
        )
    mask = capture.mask()
    if mask.sum() < FEW_PIXELS:
        raise LightsphereError(f"{capture.folder}: {int(mask.sum())} pixels show the object; correct the mask")
    told = known(capture, settings.cues, settings.known_lights, proxy)
    sight = yield from see(_hidden(capture), mask)
    unit = float(np.quantile(sight.values, 0.9))
    if not unit > 0:
        raise LightsphereError(f"{capture.folder}: the object is black in nearly all photographs; look at them")
    colours = _light_colours(sight)
    everything = pictures_of(capture.camera, mask, sight, unit * colours)
    scales = _scales(everything)
    coarse = scales[0].pictures
    problem = Problem(
        pictures=coarse,
        outline=outline(coarse.mask, coarse.views),
        bases=settings.bases,
        scatter=STRENGTHS[settings.strengths],
        known=told,
        proxy=_proxy_of_blocks(told.normals, scales[0]),
        near=settings.lamps == "near",
    )
    if settings.objective == "source":
        found = yield from alternated(problem, scales)
    else:
        found = yield from _solved(problem, scales, None if before is None else before.end)
    bright = np.pi * everything.white * unit
    misfit = found.misfit / (1.0 + found.misfit)
    confidence = (1.0 - misfit) / (1.0 + found.normal_deviation / USUAL_DEVIATION)
    layers = {"misfit": misfit, "normal_deviation": np.degrees(found.normal_deviation)}
    shape = surface(capture, mask, found.normals, confidence, None, layers)
    if proxy is not None:
        shape = dataclasses.replace(shape.levelled(proxy.depth), notes={"level": "of the proxy"})
    lights = _in_the_world(found, everything, shape, bright * colours)
    said = {"lights": _described(lights, shape, found.deviations), "doubts": list(found.doubts)}
    shape = dataclasses.replace(shape, notes={**shape.notes, **said, **found.notes})
    lit = dataclasses.replace(sight, lights=places(found.lights), near=problem.near, points=found.offsets)
    scaled = dataclasses.replace(found, table=found.table * unit / bright)
    reflectance = _reflectance(mask, lit, everything, scaled, misfit)
    return Recovered(found.end, shape, reflectance, lights, found.deviations[0], found.doubts)


def _solved(problem: Problem, scales: Sequence[Scale], before: Joint | None) -> Work[Found]:
    """Return what is found where all unknowns move at once."""
    solution = yield from solve(problem, before)
    joint = solution.joint
    fitted = yield from every_pixel(scales, joint)
    covariance, conditioned = joint.light_covariance()
    unsure = deviations(solution, covariance)
    return Found(
        end=joint,
        lights=joint.lights,
        centre=joint.centre,
        offsets=fitted.offsets,
        normals=fitted.normals,
        weights=fitted.weights[..., None],
        table=lobes.tables(joint.coefficients),
        misfit=fitted.misfit,
        normal_deviation=fitted.deviation,
        deviations=unsure,
        doubts=doubts(solution, *unsure),
        notes={
            "costs": list(solution.costs),
            "objective": list(solution.course),
            "cues": sorted(joint.known.cues),
            "condition": {"lights and bases": noted(np.array([conditioned]))},
        },
    )


def _in_the_world(found: Found, pictures: Pictures, shape: Shape, unit: Array) -> Lights:
    """Return the lights where they are to the surface as it was put in the end.

    Parameters
    ----------
    found : Found
    pictures : Pictures
        Of the shape's P pixels.
    shape : Shape
    unit : (L, 3) float64
        Irradiance that a strength of one stands for [W/m^2].
    """
    camera, strength = shape.camera, np.linalg.norm(found.lights[:, :3], axis=1, keepdims=True)
    to_world, surfaces = camera.to_world[:3, :3], np.full(len(strength), SURFACES.index(""))
    if found.lights.shape[1] == 3:
        return Lights("distant", directions(found.lights) @ to_world.T, strength * unit, surfaces)
    place = (found.centre + places(found.lights)) @ to_world.T + camera.to_world[:3, 3]
    there = Lights("near", place, strength / found.lights[:, 3:] ** 2 * unit, surfaces)
    then = ((found.centre + found.offsets - pictures.rays[:, :3]) * pictures.rays[:, 3:]).sum(axis=1)
    return level.lights_at(camera, there, level.change(camera, then, shape.depth[pictures.mask]))


def _described(lights: Lights, shape: Shape, unsure: tuple[Array, Array]) -> list[dict[str, Any]]:
    """Return what is written of every light: direction and distance from the object's centre, strength, how sure."""
    gray = lights.intensity.mean(axis=1)
    strength, away = gray / np.exp(np.log(gray).mean()), lights.position
    if lights.kind == "near":
        away = away - shape.middle()
    told = []
    for k, distance in enumerate(np.linalg.norm(away, axis=1)):
        one = {"direction": (away[k] / distance).tolist(), "strength": strength[k], "deviation_deg": unsure[0][k]}
        if lights.kind == "near":
            one |= {"distance": distance, "distance_deviation_pct": 100.0 * unsure[1][k]}
        told.append({name: value if isinstance(value, list) else float(value) for name, value in one.items()})
    return told


def _scales(full: Pictures) -> list[Scale]:
    """Return the pictures at blocks of half the side each, from about :data:`PIXELS` blocks to the pixels.

    Of more photographs each block tells more, and costs more.
    """
    wanted = PIXELS * min(1.0, float(np.sqrt(USUAL_COUNT / full.values.shape[1])))
    side = max(round(float(np.sqrt(full.mask.sum() / wanted))), 1)
    found = []
    while side > 1:
        coarse = reduced(full, side)
        if len(coarse.values) >= FEW_PIXELS:
            found.append(Scale(side, coarse))
        side = (side + 1) // 2
    return [*found, Scale(1, full)]


def _proxy_of_blocks(normals: Array | None, scale: Scale) -> Array:
    """Return the mean normals (P, 3) of a rough mesh in blocks, NaN where it has none."""
    if normals is None:
        return np.full((len(scale.pictures.values), 3), np.nan)
    mean = blocks(normals, scale.side).mean(axis=(1, 3))[scale.pictures.mask]
    return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))


def _hidden(capture: Capture) -> Capture:
    """Return the capture under lights that say nothing: values are radiances."""
    axis = np.repeat(capture.camera.to_world[None, :3, 2], len(capture), axis=0)
    blank = Lights("distant", axis, np.ones((len(capture), 3)), np.full(len(capture), 2))
    return dataclasses.replace(capture, lights=blank)


def _light_colours(sight: Sight) -> Array:
    """Return the colour of every light (L, 3) over the set's, with mean 1: the usual pixel's change of colour."""
    values = sight.values.astype(np.float64)
    lit = (sight.lit() & (values.min(axis=2) > 0))[..., None]
    ratio = np.where(
        lit, np.log(np.where(lit, values / np.where(lit, values.mean(axis=2, keepdims=True), 1), 1)), np.nan
    )
    ratio = ratio[lit[..., 0].sum(axis=1) >= FEWEST]
    if not len(ratio):
        return np.ones((values.shape[1], 3))
    change = np.nan_to_num(np.nanmedian(ratio - np.nanmedian(ratio, axis=1, keepdims=True), axis=0))
    colours = np.exp(change)
    return np.asarray(colours / colours.mean(axis=1, keepdims=True))


def _reflectance(mask: NDArray[np.bool_], sight: Sight, full: Pictures, found: Found, misfit: Array) -> Bivariate:
    """Return bases as tables, weight maps, and where values reached the tables."""
    table, weights = found.table, found.weights
    certainty = (full.lit > 0).astype(np.float32)
    band = gather(sight, certainty, found.normals, weights, table.shape).band
    seen = band[:, 0].reshape(table.shape[:3])
    maps = np.full((*mask.shape, *weights.shape[1:]), np.nan, np.float32)
    maps[mask] = weights
    error = np.full(mask.shape, np.nan, np.float32)
    error[mask] = misfit
    notes = {"bases": table.shape[2], "nodes_seen": float((seen > 0).mean())}
    return Bivariate(table, seen, maps, error, notes)
