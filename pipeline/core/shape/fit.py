"""Levenberg-Marquardt on the lobe model of :mod:`.lobe` for one pixel, and the starts it is given."""

from __future__ import annotations

import math

import numpy as np

from ..compiled import kernel
from .lobe import (
    ALPHA_RANGE,
    BOUNCED,
    DEPTH,
    DIFFUSE,
    DIRECT_UNKNOWNS,
    KAPPA,
    KAPPA_RANGE,
    LOG_ALPHA,
    NX,
    NY,
    NZ,
    RISE,
    SPECULAR,
    STATE,
    UNKNOWNS,
    evaluate,
    tangents,
)

ROUNDING = 1e-6  # residuals below this share of the median root are the rounding of float pictures
EXACT = 2e-5  # a spread below this share of the median root leaves nothing to explain: float pictures' rounding
CONVERGED = 0.3 * EXACT  # root mean square of the residuals over the median root at which steps end
FIRST_DAMPING = 1e-3
# Where each unknown stands in the state; nothing is ever known of the two that turn the normal.
PLACES = (DEPTH, -1, -1, LOG_ALPHA, KAPPA, DIFFUSE, SPECULAR, RISE, 9, 10, 11, 12)


@kernel
def solve_damped(a, g, damping, frozen, step):  # type: ignore[no-untyped-def]
    """Solve (A + damping diag A) step = -g by Cholesky, with frozen unknowns left out; return whether it worked."""
    n = len(g)
    low = np.zeros((UNKNOWNS, UNKNOWNS))
    for i in range(n):
        for j in range(i + 1):
            value = 0.0 if (frozen[i] or frozen[j]) and i != j else a[i, j]
            if i == j:
                value = 1.0 if frozen[i] or a[i, i] <= 0.0 else a[i, i] * (1.0 + damping)
            for k in range(j):
                value -= low[i, k] * low[j, k]
            if i == j:
                if not value > 1e-14 * a[i, i]:
                    return False
                low[i, i] = math.sqrt(value)
            else:
                low[i, j] = value / low[j, j]
    for i in range(n):
        value = 0.0 if frozen[i] else -g[i]
        for k in range(i):
            value -= low[i, k] * step[k]
        step[i] = value / low[i, i]
    for i in range(n - 1, -1, -1):
        value = step[i]
        for k in range(i + 1, n):
            value -= low[k, i] * step[k]
        step[i] = value / low[i, i]
    return True


@kernel
def moved(state, step, pixel, out):  # type: ignore[no-untyped-def]
    """Write the state after a step, kept inside its limits."""
    reach = 0.15 * (pixel.far - pixel.near)
    out[DEPTH] = min(pixel.far, max(pixel.near, state[DEPTH] + min(reach, max(-reach, step[0]))))
    ax, ay, az, bx, by, bz = tangents(state[NX], state[NY], state[NZ])
    length = math.sqrt(step[1] * step[1] + step[2] * step[2])
    shrink = min(1.0, 0.5 / max(length, 1e-12))
    x = state[NX] + shrink * (step[1] * ax + step[2] * bx)
    y = state[NY] + shrink * (step[1] * ay + step[2] * by)
    z = state[NZ] + shrink * (step[1] * az + step[2] * bz)
    norm = 1.0 / math.sqrt(x * x + y * y + z * z)
    out[NX], out[NY], out[NZ] = x * norm, y * norm, z * norm
    out[LOG_ALPHA] = min(ALPHA_RANGE[1], max(ALPHA_RANGE[0], state[LOG_ALPHA] + min(0.7, max(-0.7, step[3]))))
    out[KAPPA] = min(KAPPA_RANGE[1], max(KAPPA_RANGE[0], state[KAPPA] + min(0.3, max(-0.3, step[4]))))
    out[DIFFUSE] = max(0.0, state[DIFFUSE] + step[5])
    out[SPECULAR] = max(0.0, state[SPECULAR] + step[6])
    out[RISE] = max(0.0, state[RISE] + step[7])
    for i in range(4):
        out[BOUNCED + i] = state[BOUNCED + i] + (step[8 + i] if pixel.bounced else 0.0)


@kernel
def normal_equations(state, pixel, residuals, jacobian, sigma, a, g):  # type: ignore[no-untyped-def]
    """Fill A = J^T W J and g = J^T W r with the weights of the loss, what is known beforehand added."""
    used = UNKNOWNS if pixel.bounced else DIRECT_UNKNOWNS
    a[:, :] = 0.0
    g[:] = 0.0
    for i in range(len(residuals)):
        r = residuals[i]
        weight = 1.0 / (1.0 + (r / sigma) ** 2)
        if i >= pixel.lit:
            weight *= weight
        for j in range(used):
            scaled = weight * jacobian[i, j]
            g[j] += scaled * r
            for k in range(j + 1):
                a[j, k] += scaled * jacobian[i, k]
    for j in range(used):
        for k in range(j):
            a[k, j] = a[j, k]
    for j in range(UNKNOWNS):
        known = sigma * sigma * pixel.precision[j]
        if known > 0.0:
            a[j, j] += known
            g[j] += known * (state[PLACES[j]] - pixel.expected[j])


@kernel
def objective(state, glossy, pixel, sigma, residuals, jacobian):  # type: ignore[no-untyped-def]
    """Return the cost of the pictures plus that of leaving what is known beforehand, per lit light."""
    cost = evaluate(state, glossy, pixel, sigma, residuals, jacobian)
    departure = 0.0
    for j in range(UNKNOWNS):
        if pixel.precision[j] > 0.0:
            departure += pixel.precision[j] * (state[PLACES[j]] - pixel.expected[j]) ** 2
    return cost + departure / len(residuals)


@kernel
def freeze(state, g, glossy, bounced, frozen):  # type: ignore[no-untyped-def]
    """Mark the unknowns that must not move: the lobe's when there is none, and those pressed against a limit."""
    frozen[:] = False
    frozen[DIRECT_UNKNOWNS:] = not bounced
    frozen[5] = state[DIFFUSE] <= 0.0 and g[5] > 0.0
    frozen[6] = not glossy or (state[SPECULAR] <= 0.0 and g[6] > 0.0)
    frozen[7] = not glossy or (state[RISE] <= 0.0 and g[7] > 0.0)
    lobe_off = not glossy or (state[SPECULAR] <= 0.0 and state[RISE] <= 0.0)
    frozen[3] = (
        lobe_off
        or (state[LOG_ALPHA] <= ALPHA_RANGE[0] and g[3] > 0.0)
        or (state[LOG_ALPHA] >= ALPHA_RANGE[1] and g[3] < 0.0)
    )
    frozen[4] = (
        lobe_off or (state[KAPPA] <= KAPPA_RANGE[0] and g[4] > 0.0) or (state[KAPPA] >= KAPPA_RANGE[1] and g[4] < 0.0)
    )


@kernel
def reweigh(pixel, residuals):  # type: ignore[no-untyped-def]
    """Set the weights from the predicted roots: weights from noisy values would prefer those that came out large.

    Noise of standard deviation s moves a root c by s / (3 c^2), and no further than at c^3 = s: a prediction of
    nothing must not excuse everything. A weight falls below 1 where that exceeds one per cent of the value at the
    median.
    """
    if pixel.noise <= 0.0:
        return
    usual = 0.01 / 3.0 * pixel.middle
    least = 0.1 * pixel.middle
    if not pixel.bounced:  # whose noise is a doubt about the model, by which values do not scatter
        least = max(least, np.cbrt(pixel.noise))
    for i in range(len(residuals)):
        predicted = pixel.roots[i] + residuals[i] / pixel.weights[i]
        spread = pixel.noise / (3.0 * max(predicted, least) ** 2)
        pixel.weights[i] = usual / math.sqrt(usual * usual + spread * spread)


@kernel
def refine(state, glossy, pixel, scales, iterations, summary):  # type: ignore[no-untyped-def]
    """Refine a state in place by Levenberg-Marquardt with an annealed Cauchy loss.

    Parameters
    ----------
    state : (13,) float64
        See :mod:`.lobe`.
    glossy : bool
        Whether the lobe takes part.
    pixel : Pixel
    scales : (S,) float64
        Multiples of the residuals' spread to anneal through.
    iterations : int
        Steps at most for each scale.
    summary : (2,) float64
        Filled with the residuals' spread (1.4826 x median of absolute values) and the depth's standard deviation [m].
    """
    count = len(pixel.roots)
    residuals = np.empty(count)
    trial_residuals = np.empty(count)
    jacobian = np.empty((count, UNKNOWNS))
    nothing = np.empty((0, UNKNOWNS))
    a = np.empty((UNKNOWNS, UNKNOWNS))
    g = np.empty(UNKNOWNS)
    step = np.empty(UNKNOWNS)
    frozen = np.zeros(UNKNOWNS, np.bool_)
    trial = np.empty(STATE)
    floor = ROUNDING * pixel.middle
    evaluate(state, glossy, pixel, 1.0, residuals, nothing)
    for s in range(len(scales) + 1):
        last = s == len(scales)  # no steps: the state's own figures at the spread that it reached
        reweigh(pixel, residuals)
        spread = 1.4826 * np.median(np.abs(residuals[: pixel.lit]))
        if 0 < s < len(scales) and spread < EXACT * pixel.middle:
            continue
        sigma = max(floor, (1.0 if last else scales[s]) * spread)
        cost = objective(state, glossy, pixel, sigma, residuals, jacobian)
        damping = FIRST_DAMPING
        for _ in range(0 if last else iterations):
            normal_equations(state, pixel, residuals, jacobian, sigma, a, g)
            freeze(state, g, glossy, pixel.bounced, frozen)
            gain = 0.0
            for _attempt in range(5):
                if solve_damped(a, g, damping, frozen, step):
                    moved(state, step, pixel, trial)
                    gain = cost - objective(trial, glossy, pixel, sigma, trial_residuals, nothing)
                    if gain > 0.0:
                        break
                damping *= 8.0
            if not gain > 0.0:
                break
            state[:] = trial
            damping = max(1e-9, damping * 0.15)
            done = gain < 1e-5 * cost or cost - gain < (CONVERGED * pixel.middle / sigma) ** 2
            cost = objective(state, glossy, pixel, sigma, residuals, jacobian)
            if done:
                break
    normal_equations(state, pixel, residuals, jacobian, sigma, a, g)
    freeze(state, g, glossy, pixel.bounced, frozen)
    summary[0] = 1.4826 * np.median(np.abs(residuals[: pixel.lit]))
    summary[1] = depth_deviation(a, frozen, sigma)


@kernel
def depth_deviation(a, frozen, sigma):  # type: ignore[no-untyped-def]
    """Return the standard deviation of the depth, sigma sqrt((A^-1)_00); infinite where A is singular."""
    unit = np.zeros(UNKNOWNS)
    unit[0] = -1.0
    column = np.empty(UNKNOWNS)
    if not solve_damped(a, unit, 1e-12, frozen, column) or column[0] <= 0.0:
        return np.inf
    return sigma * math.sqrt(column[0])


@kernel
def diffuse_start(state, depth, pixel, upper):  # type: ignore[no-untyped-def]
    """Set depth, normal and kd of a state by linear least squares on the values whose root is at most ``upper``."""
    ray = pixel.ray
    m = np.zeros((3, 3))
    g = np.zeros(3)
    for i in range(pixel.lit):
        if pixel.roots[i] > upper:
            continue
        wx = pixel.lights[i, 0] - ray[0] - depth * ray[3]
        wy = pixel.lights[i, 1] - ray[1] - depth * ray[4]
        wz = pixel.lights[i, 2] - ray[2] - depth * ray[5]
        d2 = wx * wx + wy * wy + wz * wz
        inverse = 1.0 / math.sqrt(d2)
        value = pixel.roots[i] ** 3 * d2
        weight = 1.0 / (value + 1e-3 * upper**3 * d2)
        u = (wx * inverse, wy * inverse, wz * inverse)
        for j in range(3):
            g[j] += weight * u[j] * value
            for k in range(3):
                m[j, k] += weight * u[j] * u[k]
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    for j in range(3):
        m[j, j] += 1e-9 * trace + 1e-30
    b = np.linalg.solve(m, g)
    length = math.sqrt(b[0] ** 2 + b[1] ** 2 + b[2] ** 2)
    facing = -(b[0] * ray[3] + b[1] * ray[4] + b[2] * ray[5])
    if facing <= 0.02 * length:  # a surface that is seen faces the camera
        for j in range(3):
            b[j] -= (0.1 * length - facing + 1e-12) * ray[3 + j]
    norm = 1.0 / max(1e-30, math.sqrt(b[0] ** 2 + b[1] ** 2 + b[2] ** 2))
    state[BOUNCED:] = 0.0
    state[DEPTH] = depth
    state[NX], state[NY], state[NZ] = b[0] * norm, b[1] * norm, b[2] * norm
    state[DIFFUSE] = length
    state[SPECULAR] = 0.0
    state[RISE] = 0.0
    state[LOG_ALPHA] = math.log(0.3)
    state[KAPPA] = 0.4


@kernel
def glossy_start(state, mirror, alpha, pixel):  # type: ignore[no-untyped-def]
    """Add a lobe to a diffuse start, about the half vector of the brightest light (mirror) or about its normal."""
    ray = pixel.ray
    top = np.argmax(pixel.roots[: pixel.lit])
    wx = pixel.lights[top, 0] - ray[0] - state[DEPTH] * ray[3]
    wy = pixel.lights[top, 1] - ray[1] - state[DEPTH] * ray[4]
    wz = pixel.lights[top, 2] - ray[2] - state[DEPTH] * ray[5]
    d2 = wx * wx + wy * wy + wz * wz
    inverse = 1.0 / math.sqrt(d2)
    if mirror:
        hx, hy, hz = wx * inverse - ray[3], wy * inverse - ray[4], wz * inverse - ray[5]
        norm = math.sqrt(hx * hx + hy * hy + hz * hz)
        if norm > 1e-6:
            state[NX], state[NY], state[NZ] = hx / norm, hy / norm, hz / norm
            state[DIFFUSE] *= 0.3
    state[SPECULAR] = max(0.0, pixel.roots[top] ** 3 * d2 - 0.5 * state[DIFFUSE])
    state[LOG_ALPHA] = math.log(alpha)
