"""Basis BRDFs as tables and weight maps on a known shape, by alternating constrained least squares.

The tables are found from as many pixels as fit into memory, every so many-th one, the weights of every pixel by these
tables; the method is that of :mod:`pipeline.core.shape.photometric.known_normals`, which does not move the normals.

Source: Alldrin, Zickler, Kriegman 2008. Not modelled: anisotropy, interreflection (what the pictures hold of it goes to
tables and weights), light through the surface, errors of the shape.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
from numpy.typing import NDArray

from ..capture import Capture
from ..condition import condition, noted
from ..errors import LightsphereError
from ..progress import Work
from ..shape import Shape
from ..shape.photometric.foreseen import predict
from ..shape.photometric.held_out import split
from ..shape.photometric.known_normals import tabulate, weigh
from ..shape.photometric.sight import Sight, see
from ..shape.photometric.start import seen_from
from . import ReflectanceSettings, lobes, recovered_pixels
from .bivariate import Bivariate

HELD = 100  # bytes per value that the alternation needs at once: the value, its certainties and directions


def fit(shape: Shape, capture: Capture, settings: ReflectanceSettings) -> Work[Bivariate]:
    """Fit at most ``settings.bases`` tabulated basis BRDFs and their weight maps to a capture on a known shape.

    Parameters
    ----------
    shape : Shape
        Pixels with a finite depth and normal are fitted.
    capture : Capture
        Of near or distant lights, from the same camera.
    settings : ReflectanceSettings

    Yields
    ------
    Progress per picture read and per round.

    Returns
    -------
    Bivariate
        With ``notes["material_rel_rms"]``, defined as that of :func:`pipeline.core.reflectance.fit.fit`: RMS of the
        error of f cos over RMS of f cos, on lights that the fit never saw, over lit values of all pixels; the median
        over pixels stands beside it. The layer ``error`` is that of the pixel.

    Raises
    ------
    LightsphereError
        When the lights are unknown or too few, the shape is of another capture, or a picture cannot be read.
    """
    known = recovered_pixels(shape, capture)
    groups = interleaved(known, settings.memory * 2**20 / (HELD * len(capture)))
    sight = yield from see(capture, groups[0], shape.depth)
    normals = _normals(shape, groups[0], sight)
    tables = yield from tabulate(_split(sight, settings.held_out)[0], normals, settings.bases)
    table, seen = tables.fine()
    weights = np.full((*known.shape, table.shape[2], 1), np.nan)
    squares = np.full((*known.shape, 2), np.nan)
    told = np.full(known.shape, np.nan)
    for number, group in enumerate(groups):
        if number > 0:
            sight = yield from see(capture, group, shape.depth)
            normals = _normals(shape, group, sight)
        used = _split(sight, settings.held_out)[0]
        weights[group] = weigh(used, normals, tables)
        told[group] = condition(_weight_equations(used, normals, table))
        unseen = _split(dataclasses.replace(sight, usable=lit(sight, normals)), settings.held_out)[1]
        squares[group] = squares_left(unseen, normals, table, weights[group])
    error = np.sqrt(squares[..., 0] / np.where(squares[..., 1] > 0, squares[..., 1], np.nan))
    total = squares[known].sum(axis=0)
    notes = {
        "settings": dict(vars(settings)),
        "capture": shape.notes.get("capture", ""),
        "bases": table.shape[2],
        "objective": list(tables.objective),
        "nodes_seen": float((seen > 0).mean()),
        "condition": {"weights of a pixel": noted(told[known])},
        "held_out_lights": len(unseen.lights),
        "material_rel_rms": float(np.sqrt(total[0] / max(total[1], 1e-30))),
        "material_rel_rms_median": float(np.nanmedian(error)) if np.isfinite(error).any() else 1.0,
    }
    return Bivariate(table, seen, weights.astype(np.float32), error.astype(np.float32), notes)


def interleaved(known: NDArray[np.bool_], most: float) -> list[NDArray[np.bool_]]:
    """Return masks (H, W) that share out the known pixels in turn, each of at most so many."""
    place = np.flatnonzero(known)
    count = math.ceil(len(place) / max(most, 1.0))
    groups = np.zeros((count, known.size), bool)
    for number, group in enumerate(groups):
        group[place[number::count]] = True
    return list(groups.reshape(count, *known.shape))


def lit(sight: Sight, normals: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return how far each value is lit (P, L), as :func:`pipeline.core.reflectance.lobes.visibility` says it."""
    points = sight.points if sight.near else np.zeros_like(sight.points)
    squared = ((sight.lights - points[:, None]) ** 2).sum(axis=2, keepdims=True)
    radiance = np.where(sight.usable[..., None] > 0, sight.values / squared, np.nan).astype(np.float32)
    weight = np.empty(sight.usable.shape, np.float32)
    lobes.visibility(points, normals, sight.lights, radiance, np.empty_like(radiance), weight)
    return weight


def squares_left(
    sight: Sight, normals: NDArray[np.float64], table: NDArray[np.float64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return every pixel's squared error of the prediction and squared value (P, 2), over usable values and colours."""
    model = np.empty(sight.values.shape, np.float32)
    predict(sight.lights, sight.near, sight.points, sight.views, table, normals, weights, model)
    squares = [np.square(part, dtype=np.float64).sum(axis=2) for part in (model - sight.values, sight.values)]
    return np.stack([(sight.usable * square).sum(axis=1) for square in squares], axis=-1)


def _weight_equations(sight: Sight, normals: NDArray[np.float64], table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normal equations (P, K, K) of every pixel's weights: products of what the bases alone would show."""
    count = table.shape[2]
    alone = np.empty((count, *sight.values.shape), np.float32)
    for k in range(count):
        only = np.zeros((len(normals), count, 1))
        only[:, k] = 1.0
        predict(sight.lights, sight.near, sight.points, sight.views, table, normals, only, alone[k])
    found = np.empty((len(normals), count, count))
    for a, b in itertools.combinations_with_replacement(range(count), 2):
        found[:, a, b] = found[:, b, a] = np.einsum("plc,plc,pl->p", alone[a], alone[b], sight.usable)
    return found


def _split(sight: Sight, every: int) -> tuple[Sight, Sight]:
    """Return the lights of the fit and those held out."""
    used, unseen = split(sight, every)
    if unseen is None or not len(unseen.lights) or not len(used.lights):
        raise LightsphereError(f"{len(sight.lights)} lights are too few to hold some out; capture more lights")
    return used, unseen


def _normals(shape: Shape, chosen: NDArray[np.bool_], sight: Sight) -> NDArray[np.float64]:
    normals = shape.normal[chosen].astype(np.float64)
    return seen_from(normals / np.linalg.norm(normals, axis=1, keepdims=True), sight, 0.0)
