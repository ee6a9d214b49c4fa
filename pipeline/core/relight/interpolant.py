"""What a light at a new place makes of a pixel, found between the lights of the capture.

Seen from the surface point, every light of both surfaces is a direction. Of the NEAREST directions about the new one
the lit lights say by what factor the picture exceeds the expectation M, the unlit ones what bounced light fills the
shadow with, and both together where the edge of the shadow runs::

    y(u) = V(u) M(u) sum w_i (y_i / M_i) + (1 - V(u)) sum w_i y_i,    w = (1 - r / R)^2 / r^2

V is the step at 1/2, SHARPNESS times as steep, of a local linear regression of lit (1) and shadowed (0) lights, on
the direction and the place in the picture together: the edge of a shadow is a line that moves with both. It leans to
what :mod:`.occlusion` knows of the line to the new light, as far as that explains the shadows nearby. Lights that the
surface faces away from take no part in it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import prange

from ..compiled import kernel, parallel_kernel
from ..shape.lobe import tangents
from ..shape.source import hit
from .lobes import COLUMNS, columns, direction
from .occlusion import AWAY, LIT, SHADOWED, opacity

NEAREST = 12  # directions
SHARPNESS = 4.0
RING = 2  # pixels about one that say where a shadow's edge runs
SPREAD = 3.0  # pixels that count as one spacing of directions
LEAN = 0.7  # what space that is surely blocked rather than empty takes from the regression
HALFWAY = 0.4  # blocked, at an edge: lines empty all voxels they touch, a little more than is empty
SOFTEN = 0.03  # keeps a light that coincides with the new one from ruling the regression's slope alone
RIDGE = 1e-3
NEAR, ANYWHERE = 0.1, 4.0  # squared distances on the unit sphere within which lights are sought, first and at most
WIDENED, FARTHER = 1.15, 4.0  # of the squared distance within which the pixel before found its own; of what has too few
NEVER_BELOW = 1e-6  # of that: lights may all stand in one place
BLOCK = 64  # pixels that one thread takes at a time
MEET = 1e-9  # squared distance of directions below which lights are the same


@kernel
def find_nearest(  # type: ignore[no-untyped-def]
    point, u, lights, axes, kinds, facing, cosines, near, nearest, distances
):
    """Fill the nearest lights and their squared distances on the unit sphere; of the facing lights, or of the unlit.

    ``axes`` (3, L) are the lights in single precision: the processor compares several at once. ``near`` (1,) is the
    squared distance within which they are sought first, that of the pixel before: hardly any light is looked at twice.
    """
    px, py, pz = np.float32(point[0]), np.float32(point[1]), np.float32(point[2])
    ux, uy, uz = np.float32(u[0]), np.float32(u[1]), np.float32(u[2])
    for i in range(len(cosines)):
        x, y, z = axes[0, i] - px, axes[1, i] - py, axes[2, i] - pz
        cosines[i] = (x * ux + y * uy + z * uz) / np.sqrt(x * x + y * y + z * z)
    last = len(nearest) - 1
    collect(cosines, kinds, facing, np.float32(1.0 - 0.5 * near[0]), nearest, distances)
    while nearest[last] < 0 and near[0] <= ANYWHERE:
        near[0] *= FARTHER
        collect(cosines, kinds, facing, np.float32(1.0 - 0.5 * near[0]), nearest, distances)
    for j in range(len(nearest)):
        i = nearest[j]
        if i >= 0:
            x, y, z = lights[i, 0] - point[0], lights[i, 1] - point[1], lights[i, 2] - point[2]
            cosine = (x * u[0] + y * u[1] + z * u[2]) / math.sqrt(x * x + y * y + z * z)
            distances[j] = max(2.0 - 2.0 * cosine, 0.0)
            if distances[j] < distances[0]:  # single precision does not tell lights apart that nearly meet
                distances[0], distances[j] = distances[j], distances[0]
                nearest[0], nearest[j] = nearest[j], nearest[0]
    if nearest[last] >= 0:
        near[0] = max(WIDENED * distances[last], NEVER_BELOW)


@kernel
def collect(cosines: Any, kinds: Any, facing: Any, lowest: Any, nearest: Any, order: Any) -> None:
    """Fill the lights of the largest cosines above the lowest, the largest first, and minus those for an order."""
    last = len(nearest) - 1
    nearest[:] = -1
    order[:] = np.inf
    for i in range(len(cosines)):
        if cosines[i] > lowest and (kinds[i] != AWAY if facing else kinds[i] != LIT):
            at = last
            while at > 0 and order[at - 1] > -cosines[i]:
                order[at] = order[at - 1]
                nearest[at] = nearest[at - 1]
                at -= 1
            order[at] = -cosines[i]
            nearest[at] = i
            lowest = max(lowest, np.float32(-order[last]))


@kernel
def weight_of(distance: Any, widest: Any) -> Any:
    return max(0.0, 1.0 - math.sqrt(distance / widest)) ** 2 / (distance + 1e-3 * MEET)


@kernel
def first_unknown(matrix: Any, right: Any) -> Any:
    """Return the first unknown of a positive definite system, its upper half given, by elimination in place."""
    for a in range(len(right) - 1, 0, -1):
        for b in range(a):
            share = matrix[b, a] / matrix[a, a]
            for c in range(b, a):
                matrix[b, c] -= share * matrix[c, a]
            right[b] -= share * right[a]
    return right[0] / matrix[0, 0]


@kernel
def visibility(  # type: ignore[no-untyped-def]
    p, u, points, lights, kinds, around, offsets, reach, nearest, widest, lean, matrix, right
):
    """Return the visibility of a direction from pixel p: the regression's value at it and a lean, steep about 1/2."""
    ax, ay, az, bx, by, bz = tangents(u[0], u[1], u[2])
    row, to = np.empty(5), np.empty(3)
    matrix[:] = 0.0
    right[:] = 0.0
    scale = 1.0 / math.sqrt(widest)
    for n in range(len(offsets)):
        q = around[p, n]
        if q < 0:
            continue
        apart, steps = 0.0, offsets[n, 0] ** 2 + offsets[n, 1] ** 2
        for k in range(3):
            apart += (points[q, k] - points[p, k]) ** 2
        if apart > reach[p] ** 2 * max(1.0, steps):
            continue
        for j in range(len(nearest) - 1):
            i = nearest[j]
            if i < 0 or kinds[q, i] == AWAY:
                continue
            direction(points[q], lights[i], to)
            distance = 0.0
            for k in range(3):
                distance += (to[k] - u[k]) ** 2
            share = distance / widest
            if share >= 1.0:
                continue
            weight = (1.0 - share) ** 2 / (share + steps / SPREAD**2 + SOFTEN)
            row[0] = 1.0
            row[1] = (to[0] * ax + to[1] * ay + to[2] * az) * scale
            row[2] = (to[0] * bx + to[1] * by + to[2] * bz) * scale
            row[3], row[4] = offsets[n, 0] / SPREAD, offsets[n, 1] / SPREAD
            for a in range(5):
                for b in range(a + 1):
                    matrix[b, a] += weight * row[a] * row[b]
                if kinds[q, i] == LIT:
                    right[a] += weight * row[a]
    for a in range(1, 5):
        matrix[a, a] += RIDGE * matrix[0, 0]
    value = first_unknown(matrix, right)
    return min(1.0, max(0.0, SHARPNESS * (value + lean - 0.5) + 0.5))


@parallel_kernel
def divide(  # type: ignore[no-untyped-def]
    points, normals, views, lights, weights, values, kinds, limits
):
    """Turn radiance over intensity into what :func:`add_light` takes: values, kinds and the floor, all in place.

    ``limits`` are the share of the expectation below which a light is shadowed, the floor's share of the mean lit
    value, and the largest ratio. A value that is not a number is taken as expected.
    """
    for p in prange(len(points)):
        u, row = np.empty(3), np.empty(COLUMNS)
        model, mean = np.empty((len(lights), 3)), np.zeros(3)
        lit = 0
        for i in range(len(lights)):
            d2 = direction(points[p], lights[i], u)
            columns(normals[p], views[p], u, row)
            expected, seen = 0.0, 0.0
            for k in range(3):
                model[i, k] = 0.0
                for a in range(COLUMNS):
                    model[i, k] += weights[p, a, k] * row[a]
                values[p, i, k] = max(0.0, values[p, i, k] * d2) if values[p, i, k] == values[p, i, k] else model[i, k]
                expected += model[i, k]
                seen += values[p, i, k]
            kinds[p, i] = AWAY
            if row[0] > 0.0:
                kinds[p, i] = LIT if seen > limits[0] * expected else SHADOWED
            if kinds[p, i] == LIT:
                lit += 1
                for k in range(3):
                    mean[k] += values[p, i, k]
        for k in range(3):
            weights[p, COLUMNS, k] = limits[1] * mean[k] / max(lit, 1) + 1e-12
        for i in range(len(lights)):
            if kinds[p, i] == LIT:
                for k in range(3):
                    values[p, i, k] = min(values[p, i, k] / (model[i, k] + weights[p, COLUMNS, k]), limits[2])


@parallel_kernel
def add_light(  # type: ignore[no-untyped-def]
    points, normals, views, weights, values, kinds, around, offsets, reach, codes, frames, local, ahead, rotation,
    lights, place, distant, arriving, out,
):  # fmt: skip
    """Add the light of one emitter to a picture.

    Parameters
    ----------
    points, normals, views : (P, 3) float64
    weights : (P, C + 1, 3) float32
        Of the lobes' columns, and a floor that keeps the ratios finite.
    values : (P, L, 3) float32
        Of lit lights y / M, of the others y.
    kinds : (P, L) uint8
        AWAY, SHADOWED, LIT or BEYOND.
    around : (P, N) int32
        Pixels about each, -1 for none.
    offsets : (N, 2) float64
        Where those are in the picture [px].
    reach : (P,) float64
        How far a step of a pixel may go on the same surface [m].
    codes, frames, local, ahead, rotation
        Of :class:`.occlusion.Space`, local its points.
    lights : (L, 3) float64
    place : (3,) float64
        The emitter's position, or the unit direction to it where it is ``distant``.
    arriving : (P, 3) float32
        Irradiance of a surface that faces it.
    out : (P, 3) float64
        Added to.
    """
    axes = np.ascontiguousarray(lights.T).astype(np.float32)  # a transposed view would be read one by one
    for block in prange((len(points) + BLOCK - 1) // BLOCK):
        u, turned, row = np.empty(3), np.empty(3), np.empty(COLUMNS)
        nearest, distances = np.empty(NEAREST + 1, np.int64), np.empty(NEAREST + 1)
        cosines, near = np.empty(len(lights), np.float32), np.full(1, NEAR)
        matrix, right, ratio, fill = np.empty((5, 5)), np.empty(5), np.empty(3), np.empty(3)
        for p in range(block * BLOCK, min((block + 1) * BLOCK, len(points))):
            far = np.inf
            if distant:
                u[:] = place
            else:
                far = math.sqrt(direction(points[p], place, u))
            columns(normals[p], views[p], u, row)
            facing = row[0] > 0.0
            find_nearest(points[p], u, lights, axes, kinds[p], facing, cosines, near, nearest, distances)
            widest = distances[NEAREST] if nearest[NEAREST] >= 0 else 4.0
            lit, dark, hidden = 0.0, 0.0, 0.0
            ratio[:] = 0.0
            fill[:] = 0.0
            for j in range(NEAREST):
                i = nearest[j]
                if i < 0:
                    break
                weight = weight_of(distances[j], widest)
                if kinds[p, i] == LIT:
                    lit += weight
                    for k in range(3):
                        ratio[k] += weight * values[p, i, k]
                else:
                    dark += weight
                    if kinds[p, i] == SHADOWED:
                        hidden += weight
                    for k in range(3):
                        fill[k] += weight * values[p, i, k]
            if not facing or lit <= 0.0:
                visible = 0.0
            elif dark <= 0.0:
                visible = 1.0
            elif distances[0] < MEET:
                visible = 1.0 if kinds[p, nearest[0]] == LIT else 0.0
            else:
                lean = 0.0
                if hidden > 0.0:
                    for k in range(3):
                        turned[k] = rotation[0, k] * u[0] + rotation[1, k] * u[1] + rotation[2, k] * u[2]
                    blocked = opacity(local[p], turned, ahead[p], far, codes, frames)
                    lean = LEAN * hidden / dark * (HALFWAY - blocked)
                visible = visibility(
                    p, u, points, lights, kinds, around, offsets, reach, nearest, widest, lean, matrix, right
                )
            for k in range(3):
                value = 0.0
                if visible > 0.0:
                    model = 0.0
                    for a in range(COLUMNS):
                        model += weights[p, a, k] * row[a]
                    value += visible * (model + weights[p, COLUMNS, k]) * ratio[k] / lit
                if visible < 1.0 and dark > 0.0:
                    value += (1.0 - visible) * fill[k] / dark
                out[p, k] += value * arriving[p, k]


@parallel_kernel
def add_light_by_source(  # type: ignore[no-untyped-def]
    points, values, lights, triangles, place, distant, arriving, out
):
    """Add the light of one emitter by the source's rule: the picture value where its ray meets the inner surface.

    Values are radiance over intensity (P, L, 3); the rest is as above. Magda et al. 2001, equation 6.
    """
    for p in prange(len(points)):
        u, corners = np.empty(3), np.empty(3)
        if distant:
            u[:] = place
        else:
            direction(points[p], place, u)
        for t in range(len(triangles)):
            distance = hit(points[p], u, lights, triangles[t], corners)
            if distance > 0.0:
                for k in range(3):
                    value = 0.0
                    for c in range(3):
                        value += corners[c] * values[p, triangles[t, c], k]
                    out[p, k] += value * distance * distance * arriving[p, k]
                break
