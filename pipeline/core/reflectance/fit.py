"""A first reflectance on a known shape: albedo and one glossy lobe per pixel, its width shared by clusters of pixels.

At a given roughness and edge strength the model is linear in albedo and specular colour: every pixel is two
non-negative numbers a colour, from sums over the lights. The cost of each of ROUGHNESSES x EDGES at each pixel is
a table; the clusters are the few columns of it with the least total (greedy facility location), then refined
between columns by parabolas. Pixels that saw no highlight take their cluster's specular colour.

Source of the lobe: Walter, Marschner, Li, Torrance 2007; Heitz 2014. Not modelled: a second lobe,
interreflection (what the pictures hold of it goes to the albedo), errors of the normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..capture import Capture
from ..errors import LightsphereError
from ..progress import Progress, Work
from ..shape import Shape
from . import Reflectance, ReflectanceSettings, lobes, recovered_pixels

ROUGHNESSES = np.geomspace(0.06, 1.0, 24)
STEP = float(np.log(ROUGHNESSES[1] / ROUGHNESSES[0]))
FINER = 9
EDGES = np.array([0.0, 0.5, 1.0])
WORTH_A_CLUSTER = 0.1  # share of the cost that one more roughness must save, of the whole and of a pixel
PRIOR_PULL = 0.05  # of the median pixel's knowledge of its specular colour


@dataclass(frozen=True)
class _Pixels:
    """The geometry of P pixels in the world."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    views: NDArray[np.float64]

    def part(self, which: slice) -> _Pixels:
        return _Pixels(self.points[which], self.normals[which], self.views[which])


def fit(shape: Shape, capture: Capture, settings: ReflectanceSettings) -> Work[Reflectance]:
    """Fit albedo, specular colour and roughness to a capture on a recovered shape.

    Parameters
    ----------
    shape : Shape
        Pixels with a finite depth and normal are fitted.
    capture : Capture
        Of near lights, from the same camera.
    settings : ReflectanceSettings

    Yields
    ------
    Progress per picture read and per tile fitted.

    Returns
    -------
    Reflectance
        With ``notes["material_rel_rms"]``: RMS of the error of f cos over RMS of f cos, on lights that the fit
        never saw, over lit values of all pixels; the median over pixels stands beside it.

    Raises
    ------
    LightsphereError
        When the lights are not near ones, the shape is of another capture, or a picture cannot be read.
    """
    if capture.lights.kind != "near":
        raise LightsphereError(f"the lights are {capture.lights.kind}; a first reflectance needs near lights")
    known = recovered_pixels(shape, capture)
    pixels = _geometry(shape, known)
    lights = np.arange(len(capture))
    unseen = lights % settings.held_out == settings.held_out // 2
    if unseen.all() or not unseen.any():
        raise LightsphereError(f"{len(capture)} lights are too few to hold some out; capture more lights")
    seen = _Seen(capture, known, pixels, settings.memory)
    grid = np.broadcast_to(ROUGHNESSES, (len(pixels.points), len(ROUGHNESSES)))
    owner, roughness = shared_roughness((yield from seen.sums(~unseen, grid)), settings.clusters)
    near = roughness[owner, None] * np.exp(np.linspace(-0.5, 0.5, FINER) * STEP)
    roughness = finer_roughness((yield from seen.sums(~unseen, np.minimum(near, 1.0))), owner, roughness)
    final = (yield from seen.sums(~unseen, roughness[owner, None]))[:, 0]
    maps = np.empty((len(final), 8))
    maps[:, 7] = roughness[owner] ** 2
    for cluster in np.unique(owner):
        own = owner == cluster
        maps[own, :7] = _solve(final[own])
    squares = yield from seen.squares(unseen, maps)
    return _reflectance(shape, known, maps, squares, settings, int(unseen.sum()))


def shared_roughness(table: NDArray[np.float64], clusters: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Choose at most so many roughnesses for all pixels.

    Parameters
    ----------
    table : (P, A, 18) float64
        The sums of :func:`pipeline.core.reflectance.lobes.sums` at each of ROUGHNESSES.

    Returns
    -------
    owner : (P,) int64
        The cluster of each pixel.
    roughness : (clusters,) float64
    """
    energy = np.maximum(table[:, 0, 9::4].sum(axis=-1), 1e-30)
    columns = [_cost(table[:, a], edge) / energy for a in range(table.shape[1]) for edge in EDGES]
    costs = np.stack(columns, axis=-1)
    chosen = [int(np.argmin(costs.sum(axis=0)))]
    owner = np.zeros(len(costs), np.int64)
    best = costs[:, chosen[0]]
    while len(chosen) < clusters:
        # a pixel changes only for a clear gain: one without a highlight fits every roughness alike
        wins = costs < (1 - WORTH_A_CLUSTER) * best[:, None]
        totals = np.where(wins, costs, best[:, None]).sum(axis=0)
        column = int(np.argmin(totals))
        if not totals[column] < (1 - WORTH_A_CLUSTER) * best.sum():
            break
        owner[wins[:, column]] = len(chosen)
        best = np.where(wins[:, column], costs[:, column], best)
        chosen.append(column)
    values = np.empty(len(chosen))
    for cluster, column in enumerate(chosen):
        row, edge = divmod(column, len(EDGES))
        totals = costs[owner == cluster][:, edge :: len(EDGES)].sum(axis=0)
        values[cluster] = min(np.exp(_bottom(np.log(ROUGHNESSES), totals, row)), 1.0)
    return owner, values


def finer_roughness(
    table: NDArray[np.float64], owner: NDArray[np.int64], roughness: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Refine each cluster's roughness on a table of FINER roughnesses within half a step of it."""
    places = np.linspace(-0.5, 0.5, FINER) * STEP
    energy = np.maximum(table[:, 0, 9::4].sum(axis=-1), 1e-30)
    values = roughness.copy()
    for cluster in range(len(roughness)):
        own = owner == cluster
        if not own.any():
            continue
        totals = np.array(
            [min(float((_cost(table[own, a], e) / energy[own]).sum()) for e in EDGES) for a in range(FINER)]
        )
        values[cluster] = min(roughness[cluster] * np.exp(_bottom(places, totals, int(np.argmin(totals)))), 1.0)
    return values


def _cost(equations: NDArray[np.float64], edge: float) -> NDArray[np.float64]:
    left = lobes.without_edge(equations, edge)
    return lobes.cost(left, lobes.non_negative(left, np.zeros(3), 0.0))


def _bottom(places: NDArray[np.float64], values: NDArray[np.float64], lowest: int) -> float:
    """Return where the parabola through the lowest of evenly spaced values and its two neighbours is lowest."""
    if not 0 < lowest < len(places) - 1:
        return float(places[lowest])
    below, here, above = values[lowest - 1 : lowest + 2]
    bend = below - 2 * here + above
    shift = float(np.clip(0.5 * (below - above) / bend, -0.5, 0.5)) if bend > 0 else 0.0
    return float(places[lowest] + shift * (places[1] - places[0]))


def _solve(equations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return albedo, specular colour and edge of a cluster's pixels, (P, 7).

    A pixel is drawn towards the cluster's specular colour by as much as it saw no highlight itself.
    """
    places = np.linspace(0.0, 1.0, 11)
    energy = np.maximum(equations[:, 9::4].sum(axis=-1), 1e-30)
    totals = np.array([(_cost(equations, edge) / energy).sum() for edge in places])
    edge = min(max(_bottom(places, totals, int(np.argmin(totals))), 0.0), 1.0)
    left = lobes.without_edge(equations, edge)
    alone = lobes.non_negative(left, np.zeros(3), 0.0)
    knowledge = np.maximum(left[:, 2] - left[:, 1] ** 2 / np.maximum(left[:, 0], 1e-30), 0.0)
    shared = (knowledge[:, None] * alone[..., 1]).sum(axis=0) / max(knowledge.sum(), 1e-30)
    colours = lobes.non_negative(left, shared, PRIOR_PULL * float(np.median(knowledge)))
    return np.concatenate([colours[..., 0], colours[..., 1], np.full((len(left), 1), edge)], axis=1)


def _geometry(shape: Shape, known: NDArray[np.bool_]) -> _Pixels:
    _, directions = shape.camera.rays()
    normals = shape.camera.normals_to_world(shape.normal)[known]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return _Pixels(shape.points()[known], normals, -directions[known])


class _Seen:
    """What the known pixels saw of the lights, read by tiles of bounded memory; a single tile is read once."""

    def __init__(self, capture: Capture, known: NDArray[np.bool_], pixels: _Pixels, memory: float) -> None:
        self.capture = capture
        self.pixels = pixels
        self.place = np.nonzero(known)
        count, lights = len(pixels.points), len(capture)
        rows = max(1, int(memory * 2**20 / (lights * 7 * 4)))  # radiance, apparent BRDF and weight
        self.tiles = [slice(start, min(start + rows, count)) for start in range(0, count, rows)]
        self.kept: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None

    def sums(self, used: NDArray[np.bool_], roughness: NDArray[np.float64]) -> Work[NDArray[np.float64]]:
        """Return the sums of :func:`pipeline.core.reflectance.lobes.sums` at roughnesses (P, A), (P, A, 18)."""
        out = np.empty((*roughness.shape, 18))
        lights = self.capture.lights.position[used]
        for tile in self.tiles:
            y, weight = yield from self._apparent(tile)
            part = self.pixels.part(tile)
            alphas = np.ascontiguousarray(roughness[tile] ** 2)
            lobes.sums(part.points, part.normals, part.views, lights, y[:, used], weight[:, used], alphas, out[tile])
        return out

    def squares(self, used: NDArray[np.bool_], maps: NDArray[np.float64]) -> Work[NDArray[np.float64]]:
        """Return the sums of :func:`pipeline.core.reflectance.lobes.held_out_squares`, (P, 2)."""
        out = np.empty((len(maps), 2))
        lights = self.capture.lights.position[used]
        for tile in self.tiles:
            y, weight = yield from self._apparent(tile)
            part = self.pixels.part(tile)
            lobes.held_out_squares(
                part.points, part.normals, part.views, lights, y[:, used], weight[:, used], maps[tile], out[tile]
            )
        return out

    def _apparent(self, tile: slice) -> Work[tuple[NDArray[np.float32], NDArray[np.float32]]]:
        """Return a tile's apparent BRDFs (P, L, 3) and how far each is lit (P, L)."""
        if self.kept is not None:
            return self.kept
        capture, part = self.capture, self.pixels.part(tile)
        row, column = (index[tile] for index in self.place)
        values = np.empty((len(row), len(capture), 3), np.float32)
        limit = float(capture.notes.get("saturation", np.inf))
        for light in range(len(capture)):
            seen = capture.image(light)[row, column]
            seen = np.where((seen < limit) & np.isfinite(seen), seen, np.nan)
            values[:, light] = seen / np.maximum(capture.lights.intensity[light], 1e-30)
            yield Progress("reflectance", light + 1, len(capture), "pictures")
        y = np.empty_like(values)
        weight = np.empty(values.shape[:2], np.float32)
        lobes.visibility(part.points, part.normals, capture.lights.position, values, y, weight)
        if len(self.tiles) == 1:
            self.kept = y, weight
        return y, weight


def _reflectance(
    shape: Shape,
    known: NDArray[np.bool_],
    maps: NDArray[np.float64],
    squares: NDArray[np.float64],
    settings: ReflectanceSettings,
    held_out: int,
) -> Reflectance:
    full = np.full((*known.shape, 9), np.nan, np.float32)
    full[known, :7] = maps[:, :7]
    full[known, 7] = np.sqrt(maps[:, 7])
    seen = squares[:, 1] > 0
    per_pixel = np.full(len(squares), np.nan)
    per_pixel[seen] = np.sqrt(squares[seen, 0] / squares[seen, 1])
    full[known, 8] = per_pixel
    notes = {
        "model": "diffuse + GGX",
        "edge": sorted({round(float(e), 6) for e in maps[:, 6]}),
        "settings": dict(vars(settings)),
        "capture": shape.notes.get("capture", ""),
        "roughness": sorted({round(float(np.sqrt(a)), 6) for a in maps[:, 7]}),
        "held_out_lights": held_out,
        "material_rel_rms": float(np.sqrt(squares[:, 0].sum() / max(squares[:, 1].sum(), 1e-30))),
        "material_rel_rms_median": float(np.median(per_pixel[seen])) if seen.any() else 1.0,
    }
    return Reflectance(full[..., :3], full[..., 3:6], full[..., 6], full[..., 7], full[..., 8], notes)
