"""The photometric equations of many pixels under lights that are unknown, too, and their elimination.

Pixel p sees of light l, in colour c::

    y_plc = max(n_p . s_pl, 0) sum_k w_pk sum_j C_kjc g_j(n_p, s_pl, v_p)

with the unit normal n, the light s that reaches the pixel (its direction times its strength, :mod:`.lamps`), the
weights w >= 0 of the bases and the coefficients C >= 0 of the lobes g (:mod:`.lobes`). A Gauss-Newton step over all of
these at once needs a system that is dense in the few unknowns shared by all pixels, lights and coefficients, and small
for each pixel: normal (two tangents) and weights. Every pixel's own unknowns are eliminated (Schur complement), which
costs a time linear in pixels.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ...compiled import kernel, parallel_kernel
from .lamps import arriving
from .lobes import LEAST_FACING, lobes

Array = NDArray[np.float64]

WIDTH = 0.1  # misfit over the larger of value and usual value at which a value without noise counts half
NOISY = 2.4  # times the noise: Cauchy's width that wastes little of Gaussian noise (Holland and Welsch 1977)
RIDGE = 1e-9
LARGEST_TURN = 0.3  # of a normal in one step [rad]


@kernel
def frame(normal: Array, tangents: Array) -> None:
    """Fill in two unit tangents (2, 3) of a normal. Steps are damped along each, so that others end elsewhere."""
    x, y, z = normal
    if abs(x) < 0.6:
        tangents[0, 0], tangents[0, 1], tangents[0, 2] = 0.0, z, -y
    else:
        tangents[0, 0], tangents[0, 1], tangents[0, 2] = -z, 0.0, x
    tangents[0] /= math.sqrt((tangents[0] ** 2).sum())
    tangents[1, 0] = y * tangents[0, 2] - z * tangents[0, 1]
    tangents[1, 1] = z * tangents[0, 0] - x * tangents[0, 2]
    tangents[1, 2] = x * tangents[0, 1] - y * tangents[0, 0]


@kernel
def workspace(bases: int, functions: int) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
    """Return the arrays that :func:`respond` fills in, for K bases of J functions.

    Returns
    -------
    tangents : (2, 3)
        Of the normal; the caller fills them in.
    scratch : (4, J)
    value : (3,)
        y of the three colours.
    by_normal, by_weight, by_light : (2, 3), (K, 3), (3, 3)
        Derivatives by the turn towards each tangent, each weight and each component of the light; colours last.
    by_lobe : (J,)
        Derivative by the coefficient C_kjc over w_k.
    """
    return (
        np.zeros((2, 3)), np.empty((4, functions)), np.empty(3), np.empty((2, 3)), np.empty((bases, 3)),
        np.empty((3, 3)), np.empty(functions),
    )  # fmt: skip


@kernel
def respond(
    normal: Array, view: Array, light: Array, weights: Array, coefficients: Array, space: tuple[Array, ...]
) -> bool:
    """Fill in what a pixel shows of a light, and the derivatives; return whether the light is above the surface.

    Parameters
    ----------
    normal, view, light : (3,)
    weights : (K,)
    coefficients : (K, J, 3)
    space : tuple
        Of :func:`workspace`; where the light is below, y is 0 and the rest is left as it was.
    """
    tangents, scratch, value, by_normal, by_weight, by_light, by_lobe = space
    value[:] = 0.0
    facing = normal[0] * light[0] + normal[1] * light[1] + normal[2] * light[2]
    if facing <= 0.0:
        return False
    strength = math.sqrt(light[0] ** 2 + light[1] ** 2 + light[2] ** 2)
    half = math.sqrt(
        (light[0] / strength + view[0]) ** 2
        + (light[1] / strength + view[1]) ** 2
        + (light[2] / strength + view[2]) ** 2
    )
    cos_h, cos_o, towards = 0.0, 0.0, 0.0
    for i in range(3):
        cos_h += normal[i] * (light[i] / strength + view[i]) / half
        cos_o += normal[i] * view[i]
        towards += (light[i] / strength + view[i]) / half * light[i] / strength
    cos_h, cos_i = min(cos_h, 1.0), facing / strength
    g, g_h, g_i, g_o = scratch[0], scratch[1], scratch[2], scratch[3]
    lobes(cos_h, cos_i, max(cos_o, LEAST_FACING), g, g_h, g_i, g_o)
    for j in range(g.size):
        by_lobe[j] = facing * g[j]
    along = (cos_i - cos_h * towards) / half  # of the part of n across h, over |l + v|, with l
    for c in range(3):
        f, f_h, f_i, f_o = 0.0, 0.0, 0.0, 0.0
        for k in range(weights.size):
            b, b_h, b_i, b_o = 0.0, 0.0, 0.0, 0.0
            for j in range(g.size):
                b += coefficients[k, j, c] * g[j]
                b_h += coefficients[k, j, c] * g_h[j]
                b_i += coefficients[k, j, c] * g_i[j]
                b_o += coefficients[k, j, c] * g_o[j]
            by_weight[k, c] = facing * b
            f += weights[k] * b
            f_h += weights[k] * b_h
            f_i += weights[k] * b_i
            f_o += weights[k] * b_o
        value[c] = facing * f
        for t in range(2):
            turn_h, turn_i, turn_o = 0.0, 0.0, 0.0
            for i in range(3):
                turn_h += tangents[t, i] * (light[i] / strength + view[i]) / half
                turn_i += tangents[t, i] * light[i] / strength
                turn_o += tangents[t, i] * view[i]
            by_normal[t, c] = strength * turn_i * f + facing * (f_h * turn_h + f_i * turn_i + f_o * turn_o)
        for i in range(3):
            direction = light[i] / strength
            across_h = (normal[i] - cos_h * (direction + view[i]) / half) / half
            move_h = (across_h - direction * along) / strength
            move_i = (normal[i] - direction * cos_i) / strength
            by_light[i, c] = normal[i] * f + facing * (f_h * move_h + f_i * move_i)
    return True


@parallel_kernel
def certainties(
    values: Array, usual: Array, noise: float, lit: Array, views: Array, offsets: Array, normals: Array,
    weights: Array, lights: Array, coefficients: Array, certainty: Array, misfit: Array,
) -> None:  # fmt: skip
    """Fill in how much each value (P, L) counts, and Cauchy's cost of its misfit."""
    pixels, count = lit.shape
    for p in prange(pixels):
        space = workspace(weights.shape[1], coefficients.shape[1])
        here, slopes = np.empty(3), np.empty((lights.shape[1], 3))
        for k in range(count):
            certainty[p, k] = misfit[p, k] = 0.0
            if lit[p, k] > 0.0:
                arriving(lights[k], offsets[p], here, slopes)
                respond(normals[p], views[p], here, weights[p], coefficients, space)
                sure, cost = certainty_of(values[p, k], space[2], usual[p], noise)
                certainty[p, k], misfit[p, k] = lit[p, k] * sure, lit[p, k] * cost


@kernel
def squared_width(size: float, noise: float) -> float:
    """Return the squared misfit at which a value counts half, of the size that misfits are shares of."""
    return (WIDTH * size) ** 2 + (NOISY * noise) ** 2


@kernel
def certainty_of(seen: Array, foreseen: Array, usual: float, noise: float) -> tuple[float, float]:
    """Return Cauchy's weight of a value's (3,) misfit over its variance, and Cauchy's cost log(1 + (miss / width)^2).

    The width is a share of the larger of a value and the pixel's usual one, so that highlights count by their ratio
    and dark values by their difference, and no less than the pictures' noise asks for.
    """
    size = max((seen[0] + seen[1] + seen[2]) / 3.0, usual)
    miss = (abs(seen[0] - foreseen[0]) + abs(seen[1] - foreseen[1]) + abs(seen[2] - foreseen[2])) / 3.0
    width = squared_width(size, noise)
    return 1.0 / (3.0 * (width + miss**2)), math.log(1.0 + miss**2 / width)


@kernel
def _add_cues(cues: Array, targets: Array, trust: Array, normal: Array, tangents: Array, a: Array, b: Array) -> None:
    """Add the equations cue . n = target of one pixel to its system."""
    for m in range(trust.size):
        if trust[m] <= 0.0:
            continue
        miss, first, second = targets[m], 0.0, 0.0
        for i in range(3):
            miss -= cues[m, i] * normal[i]
            first += cues[m, i] * tangents[0, i]
            second += cues[m, i] * tangents[1, i]
        b[0] += trust[m] * first * miss
        b[1] += trust[m] * second * miss
        a[0, 0] += trust[m] * first * first
        a[1, 0] += trust[m] * first * second
        a[1, 1] += trust[m] * second * second


@kernel
def add_value(
    space: tuple[Array, ...], colour: int, sure: float, miss: float, slope: Array, a: Array, b: Array
) -> None:
    """Add one colour of one value to a pixel's system, the lower half of a and b; leave its slopes (2 + K,)."""
    by_normal, by_weight = space[3], space[4]
    slope[0], slope[1] = by_normal[0, colour], by_normal[1, colour]
    for n in range(by_weight.shape[0]):
        slope[2 + n] = by_weight[n, colour]
    for i in range(slope.size):
        b[i] += sure * slope[i] * miss
        for j in range(i + 1):
            a[i, j] += sure * slope[i] * slope[j]


@kernel
def cholesky(a: Array, weights: Array, b: Array, damping: float) -> None:
    """Turn the lower half of a pixel's system into its damped Cholesky factor; weights that want below 0 are held."""
    size = b.size
    for k in range(weights.size):
        if weights[k] <= 0.0 and b[2 + k] <= 0.0:
            a[2 + k, :] = 0.0
            a[:, 2 + k] = 0.0
            a[2 + k, 2 + k] = 1.0
            b[2 + k] = 0.0
    for i in range(size):
        a[i, i] = a[i, i] * (1.0 + damping) + RIDGE
        for j in range(i + 1):
            total = a[i, j]
            for m in range(j):
                total -= a[i, m] * a[j, m]
            a[i, j] = math.sqrt(max(total, RIDGE**2)) if i == j else total / a[j, j]


@kernel
def solve_lower(factor: Array, b: Array) -> None:
    """Solve factor x = b for a lower triangle, in place."""
    for i in range(b.size):
        for j in range(i):
            b[i] -= factor[i, j] * b[j]
        b[i] /= factor[i, i]


@parallel_kernel
def eliminate(
    values: Array, certainty: Array, views: Array, offsets: Array, cues: Array, targets: Array, trust: Array,
    normals: Array, weights: Array, lights: Array, coefficients: Array, damping: float,
    factors: Array, reduced: Array, right: Array, shared: Array, gradient: Array,
) -> None:  # fmt: skip
    """Fill in the equations of all pixels with their own unknowns eliminated.

    Parameters
    ----------
    values, certainty, views, offsets : (P, L, 3), (P, L), (P, 3), (P, 3)
    cues, targets, trust : (P, M, 3), (P, M), (P, M)
        What is known of a normal otherwise: cue . n = target.
    normals, weights, lights, coefficients : (P, 3), (P, K), (L, N), (K, J, 3)
    damping : float
        Of Levenberg and Marquardt.
    factors : (P, 2 + K, 2 + K)
        Cholesky factor A (lower) of each pixel's damped system.
    reduced, right : (P, 2 + K, G), (P, 2 + K)
        A^-1 times the coupling to the G = N L + 3 K J shared unknowns, and times the pixel's gradient.
    shared, gradient : (T, G, G), (T, G)
        Zeros on entry; sums over T parts of the pixels: the shared unknowns' own system. Of its couplings between
        lights and coefficients only the lights' rows are filled in.
    """
    pixels, count = certainty.shape
    bases, functions = coefficients.shape[:2]
    own, total, parts, numbers = 2 + bases, shared.shape[1], shared.shape[0], lights.shape[1]
    for part in prange(parts):
        space = workspace(bases, functions)
        tangents, value, by_lobe = space[0], space[2], space[6]
        here, slopes, by_light = np.empty(3), np.empty((numbers, 3)), np.empty((numbers, 3))
        coupling, slope = np.empty((own, total)), np.empty(own)
        glow, glows = np.empty(bases * functions), np.zeros((bases * functions, bases * functions))
        for p in range(part * pixels // parts, (part + 1) * pixels // parts):
            a, b = factors[p], right[p]
            a[:], b[:], coupling[:] = 0.0, 0.0, 0.0
            frame(normals[p], tangents)
            _add_cues(cues[p], targets[p], trust[p], normals[p], tangents, a, b)
            for k in range(count):
                sure = certainty[p, k]
                if sure <= 0.0:
                    continue
                arriving(lights[k], offsets[p], here, slopes)
                if not respond(normals[p], views[p], here, weights[p], coefficients, space):
                    continue
                for n in range(bases):
                    for j in range(functions):
                        glow[n * functions + j] = weights[p, n] * by_lobe[j]
                for n in range(glow.size):  # alike for the three colours
                    if glow[n] != 0.0:
                        for m in range(n + 1):
                            glows[n, m] += sure * glow[n] * glow[m]
                for j in range(numbers):
                    for c in range(3):
                        by_light[j, c] = 0.0
                        for i in range(3):
                            by_light[j, c] += slopes[j, i] * space[5][i, c]
                for c in range(3):
                    miss = values[p, k, c] - value[c]
                    add_value(space, c, sure, miss, slope, a, b)
                    for i in range(own):
                        for j in range(numbers):
                            coupling[i, numbers * k + j] += sure * slope[i] * by_light[j, c]
                        for n in range(bases):
                            share = sure * slope[i] * weights[p, n]
                            if share != 0.0:
                                for j in range(functions):
                                    coupling[i, numbers * count + (n * functions + j) * 3 + c] += share * by_lobe[j]
                    for i in range(numbers):
                        gradient[part, numbers * k + i] += sure * by_light[i, c] * miss
                        for j in range(numbers):
                            shared[part, numbers * k + i, numbers * k + j] += sure * by_light[i, c] * by_light[j, c]
                    for n in range(bases):
                        if weights[p, n] == 0.0:
                            continue
                        for j in range(functions):
                            place = numbers * count + (n * functions + j) * 3 + c
                            share = sure * weights[p, n] * by_lobe[j]
                            gradient[part, place] += share * miss
                            for i in range(numbers):
                                shared[part, numbers * k + i, place] += share * by_light[i, c]
            for n in range(bases):
                if weights[p, n] <= 0.0 and b[2 + n] <= 0.0:
                    coupling[2 + n] = 0.0
            cholesky(a, weights[p], b, damping)
            solve_lower(a, b)
            for i in range(own):
                for g in range(total):
                    rest = coupling[i, g]
                    for j in range(i):
                        rest -= a[i, j] * reduced[p, j, g]
                    reduced[p, i, g] = rest / a[i, i]
        for n in range(glow.size):
            for m in range(glow.size):
                for c in range(3):
                    shared[part, numbers * count + 3 * n + c, numbers * count + 3 * m + c] = glows[max(n, m), min(n, m)]


@parallel_kernel
def foreseen_costs(
    values: Array, certainty: Array, views: Array, offsets: Array, cues: Array, targets: Array, trust: Array,
    normals: Array, weights: Array, lights: Array, coefficients: Array, costs: Array,
) -> None:  # fmt: skip
    """Fill in the weighted squared misfit of every pixel (P,), whose equations :func:`eliminate` has."""
    pixels, count = certainty.shape
    for p in prange(pixels):
        space = workspace(weights.shape[1], coefficients.shape[1])
        here, slopes = np.empty(3), np.empty((lights.shape[1], 3))
        costs[p] = 0.0
        for m in range(trust.shape[1]):
            costs[p] += trust[p, m] * (targets[p, m] - (cues[p, m] * normals[p]).sum()) ** 2
        for k in range(count):
            if certainty[p, k] > 0.0:
                arriving(lights[k], offsets[p], here, slopes)
                respond(normals[p], views[p], here, weights[p], coefficients, space)
                for c in range(3):
                    costs[p] += certainty[p, k] * (values[p, k, c] - space[2][c]) ** 2


@parallel_kernel
def foresee(
    views: Array, offsets: Array, normals: Array, weights: Array, lights: Array, coefficients: Array, foreseen: Array
) -> None:
    """Fill in what every pixel shows of every light (P, L, 3)."""
    for p in prange(len(normals)):
        space = workspace(weights.shape[1], coefficients.shape[1])
        here, slopes = np.empty(3), np.empty((lights.shape[1], 3))
        for k in range(len(lights)):
            arriving(lights[k], offsets[p], here, slopes)
            respond(normals[p], views[p], here, weights[p], coefficients, space)
            foreseen[p, k] = space[2]


@kernel
def turn(start: Array, tangents: Array, step: Array, view: Array, normal: Array) -> None:
    """Fill in the normal turned by a step along its tangents, but no further than the camera can see."""
    first = min(max(step[0], -LARGEST_TURN), LARGEST_TURN)
    second = min(max(step[1], -LARGEST_TURN), LARGEST_TURN)
    for i in range(3):
        normal[i] = start[i] + first * tangents[0, i] + second * tangents[1, i]
    normal /= math.sqrt((normal**2).sum())
    lack = max(LEAST_FACING - (normal * view).sum(), 0.0)
    for i in range(3):
        normal[i] += lack * view[i]
    normal /= math.sqrt((normal**2).sum())


@parallel_kernel
def turn_normals(steps: Array, views: Array, normals: Array) -> None:
    """Turn normals (P, 3) in place by steps (P, 2 or more) along their tangents."""
    for p in prange(normals.shape[0]):
        tangents, turned = np.empty((2, 3)), np.empty(3)
        frame(normals[p], tangents)
        turn(normals[p], tangents, steps[p], views[p], turned)
        normals[p] = turned
