"""The azimuth of normals from isotropic symmetry, for any isotropic BRDF and distant lights.

An isotropic BRDF does not change when both directions are mirrored in a plane that holds the normal. In the plane that
also holds the view, the view stays where it is, so that the pictures of a pixel, as a function of the light's
direction, are the same on both sides of it (Alldrin and Kriegman, "Toward reconstructing surfaces with arbitrary
isotropic reflectance: a stratified photometric stereo approach", ICCV 2007). Every plane through the view is tried:
each light is mirrored in it, the logarithm of the picture there interpolated between the three lights around, and the
robust mean of the differences taken.

Not modelled: interreflection, anisotropic surfaces, lights nearby.
"""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from ..compiled import kernel, parallel_kernel

PLANES = 60  # tried about the view, 3 degrees apart
FINE = np.radians(1.0)  # step about the best of them
REACH = 3  # fine steps to either side that the parabola is laid through
DARK = 0.05  # of the pixel's bright values: half usable
FLOOR = 0.01  # of the pixel's bright values: logarithms end there
APART = 0.1  # relative difference that counts half
MISSING = 0.05  # weight of a complete disagreement, as a share of all the pixel's weight: planes without pairs lose
UNCERTAIN = 4.0  # fine steps of uncertainty that halve the trust
UNLIKE = 0.3  # robust mean difference that halves it
FEW = 12.0  # pairs that halve it
GAP = 2.0  # of the median triangle's angular radius: larger ones bridge what has no lights
CELLS = 128  # of the map from directions to triangles, along either side


def azimuth(
    values: NDArray[np.float32], lights: NDArray[np.float64], view: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the plane through view and normal about which a pixel's pictures are symmetric.

    Parameters
    ----------
    values : (P, L) float32
        Radiance over the light's irradiance, in any unit [1/sr].
    lights : (L, 3) float64
        Unit directions to the lights, camera space.
    view : (P, 3) float64
        Unit directions to the camera, camera space.

    Returns
    -------
    azimuth : (P,) float64
        Angle about the view from the first axis of :func:`frames` to the normal [rad], in (-pi, pi].
    trust : (P,) float64
        0 to 1: how well the plane is known. Low where few lights have a mirror image among the lights (an incomplete
        cone), where all planes are alike (a normal that faces the viewer), and where none fits (interreflection,
        anisotropy). 0 where nothing can be interpolated: fewer than four lights, or all in one plane.

    Examples
    --------
    A normal to the right of the view has azimuth 0, one above it pi / 2.
    """
    lights = np.ascontiguousarray(lights, np.float64)
    try:
        corners, inverse, cells = _triangulated(lights)
    except (QhullError, ValueError):  # fewer than four, or all in one plane
        return np.zeros(len(values)), np.zeros(len(values))
    turned = np.ascontiguousarray(frames(view))
    found: tuple[NDArray[np.float64], NDArray[np.float64]] = _search(
        np.ascontiguousarray(values, np.float32), lights, turned, corners, inverse, cells
    )
    return found


def frames(view: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotations (..., 3, 3) that turn z straight to the view: a normal is ``R (s cos a, s sin a, c)``.

    ``a`` is the azimuth, ``s`` and ``c`` are sine and cosine of the angle between view and normal. The view has a
    positive z.
    """
    x, y, z = np.moveaxis(np.asarray(view, np.float64), -1, 0)
    k = 1 / (1 + z)
    rows = [[1 - k * x * x, -k * x * y, x], [-k * x * y, 1 - k * y * y, y], [-x, -y, z]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _triangulated(
    lights: NDArray[np.float64],
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.int32]]:
    """Return triangles of neighbouring lights (T, 3), their inverse corner matrices (T, 3, 3), and a map to them.

    The map (CELLS, CELLS) holds the triangle around the direction of each cell's centre, -1 where there is none.
    """
    hull = ConvexHull(lights)
    corners = hull.simplices
    radius = np.arccos(np.clip(-hull.equations[:, 3], -1, 1))
    corners = corners[radius <= GAP * np.median(radius)]
    inverse = np.linalg.inv(lights[corners].transpose(0, 2, 1))
    cells = np.full((CELLS, CELLS), -1, np.int32)
    for row, directions in enumerate(_cell_centres()):
        inside = np.einsum("tij,cj->cti", inverse, directions).min(axis=-1)
        best = inside.argmax(axis=1)
        cells[row] = np.where(inside[np.arange(CELLS), best] > -1e-9, best, -1)
    return corners.astype(np.int32), inverse, cells


def _cell_centres() -> NDArray[np.float64]:
    """Return the directions (CELLS, CELLS, 3) at the centres of an octahedral map's cells."""
    side = (np.arange(CELLS) + 0.5) / CELLS * 2 - 1
    y, x = np.meshgrid(side, side, indexing="ij")
    z = 1 - np.abs(x) - np.abs(y)
    folded = np.minimum(z, 0)
    x, y = x + np.copysign(folded, x), y + np.copysign(folded, y)
    directions = np.stack([x, y, z], axis=-1)
    return np.asarray(directions / np.linalg.norm(directions, axis=-1, keepdims=True))


@kernel
def _cell(x: float, y: float, z: float) -> tuple[int, int]:
    """Return row and column of a direction in the octahedral map."""
    size = abs(x) + abs(y) + abs(z)
    u, v = x / size, y / size
    if z < 0:
        u, v = (1 - abs(v)) * (1.0 if u >= 0 else -1.0), (1 - abs(u)) * (1.0 if v >= 0 else -1.0)
    last = CELLS - 1
    return min(int((v + 1) / 2 * CELLS), last), min(int((u + 1) / 2 * CELLS), last)


@kernel
def _difference(logs, usable, lights, frame, angle, corners, inverse, cells):  # type: ignore[no-untyped-def]
    """Return the robust mean difference between the picture and its mirror image, and the pairs' weight."""
    sine, cosine = np.sin(angle), np.cos(angle)
    dx = frame[0, 1] * cosine - frame[0, 0] * sine
    dy = frame[1, 1] * cosine - frame[1, 0] * sine
    dz = frame[2, 1] * cosine - frame[2, 0] * sine
    cost, weight, total = 0.0, 0.0, 0.0
    for light in range(len(lights)):
        own = usable[light]
        total += own
        if own < 1e-3:
            continue
        x, y, z = lights[light, 0], lights[light, 1], lights[light, 2]
        twice = 2 * (x * dx + y * dy + z * dz)
        x, y, z = x - twice * dx, y - twice * dy, z - twice * dz
        row, column = _cell(x, y, z)
        triangle = cells[row, column]
        if triangle < 0:
            continue
        there, mirrored, shares = 0.0, 0.0, 0.0
        for i in range(3):
            m = inverse[triangle, i]
            share = max(m[0] * x + m[1] * y + m[2] * z, 0.0)
            corner = corners[triangle, i]
            shares += share
            mirrored += share * logs[corner]
            there += share * usable[corner]
        apart = (mirrored / shares - logs[light]) ** 2
        pair = own * there / shares
        weight += pair
        cost += pair * apart / (apart + APART * APART)
    missing = MISSING * total
    return (cost + missing) / (weight + missing), weight


@kernel
def _prepare(values, logs, usable):  # type: ignore[no-untyped-def]
    """Fill logarithms and soft usability (L,) of a pixel's values; return the median of the usable ones."""
    ordered = np.sort(values)
    bright = ordered[int(0.9 * (len(values) - 1))]
    lit = 0
    for i in range(len(values)):
        ratio = max(values[i] / bright, 0.0) if bright > 0 else 0.0
        logs[i] = np.log(ratio + FLOOR)
        usable[i] = ratio**2 / (ratio**2 + DARK**2)
        lit += usable[i] > 0.5
    return ordered[len(values) - 1 - lit // 2] if bright > 0 else 0.0


@kernel
def _brighter(values, usable, highest, lights, frame, angle):  # type: ignore[no-untyped-def]
    """Return the angle or its opposite: where the least-squares Lambertian normal of the usable values points.

    Values are cut at their median, which keeps highlights from tilting it; a fit to the usable values alone is not
    turned by a cast shadow as a sum over both sides is.
    """
    gram, moment = np.zeros((3, 3)), np.zeros(3)
    for light in range(len(lights)):
        value = min(values[light], highest)
        for i in range(3):
            weighted = usable[light] * lights[light, i]
            moment[i] += weighted * value
            for j in range(3):
                gram[i, j] += weighted * lights[light, j]
    size = gram[0, 0] + gram[1, 1] + gram[2, 2]
    for i in range(3):
        gram[i, i] += 1e-6 * size
    normal = np.linalg.solve(gram, moment)
    side = 0.0
    for i in range(3):
        side += normal[i] * (np.cos(angle) * frame[i, 0] + np.sin(angle) * frame[i, 1])
    return angle if side >= 0 else angle + np.pi


@kernel
def _parabola(costs):  # type: ignore[no-untyped-def]
    """Return where the parabola through costs at whole steps -REACH .. REACH is lowest, and its second coefficient."""
    slope = curve = lengths = bends = 0.0
    for i in range(-REACH, REACH + 1):
        bend = i * i - REACH * (REACH + 1) / 3
        slope += i * costs[i + REACH]
        curve += bend * costs[i + REACH]
        lengths += i * i
        bends += bend * bend
    slope, curve = slope / lengths, curve / bends
    if curve <= 0:
        return 0.0, 0.0
    return min(max(-slope / (2 * curve), -REACH), REACH), curve


@kernel
def _trust(cost, mean, curve, pairs):  # type: ignore[no-untyped-def]
    """Return how well a plane is known, 0 to 1.

    From its cost, the mean cost of all planes, the cost's curvature per squared step, and the pairs. The mean of so
    many pairs is uncertain by its own size over the root of their number; the plane, by the angle over which the
    parabola rises as much. A plane hardly better than all others, one that explains the pictures badly, and one of
    few pairs are not trusted either.
    """
    if curve <= 0 or pairs <= 0:
        return 0.0
    angle = np.sqrt(cost / (np.sqrt(pairs) * curve))
    known = max(1 - cost / mean, 0.0) / (1 + (angle / UNCERTAIN) ** 2)
    return known / (1 + (cost / UNLIKE) ** 4) / (1 + (FEW / pairs) ** 4)


@parallel_kernel
def _search(values, lights, frames, corners, inverse, cells):  # type: ignore[no-untyped-def]
    """Return azimuth and trust (P,) of every pixel; both 0 where fewer than a tenth of the lights shine."""
    azimuths, trusts = np.zeros(len(values)), np.zeros(len(values))
    for p in prange(len(values)):
        logs, usable, fine = np.empty(len(lights)), np.empty(len(lights)), np.empty(2 * REACH + 1)
        highest = _prepare(values[p], logs, usable)
        if highest <= 0:
            continue
        best, lowest, mean = 0.0, np.inf, 0.0
        for i in range(PLANES):
            angle = np.pi * i / PLANES
            cost, pairs = _difference(logs, usable, lights, frames[p], angle, corners, inverse, cells)
            mean += cost / PLANES
            if cost < lowest:
                lowest, best = cost, angle
        curve = 0.0
        for _ in range(2):
            for i in range(-REACH, REACH + 1):
                angle = best + i * FINE
                fine[i + REACH], pairs = _difference(logs, usable, lights, frames[p], angle, corners, inverse, cells)
            step, curve = _parabola(fine)
            best += FINE * step
        cost, pairs = _difference(logs, usable, lights, frames[p], best, corners, inverse, cells)
        trusts[p] = _trust(cost, mean, curve, pairs)
        turned = _brighter(values[p], usable, highest, lights, frames[p], best)
        azimuths[p] = np.arctan2(np.sin(turned), np.cos(turned))
    return azimuths, trusts
