"""Depths of coarsely rounded pictures: the mean of all that the roundings allow.

Where white is at the brightest highlight, most values are rounded to none or to one step. That a value was rounded says
in which step it lay, and not where: least squares, which take the middle of a step for what was measured, end beside
the truth. Here the model of :mod:`.lobe`, linear near its fit, makes of all steps a polytope of states x, and ::

    x = mean of N(x; prior) prod_i [ pi_i + (1 - pi_i) P(low_i <= M_i(x) <= high_i) ]

follows from expectation propagation: every step becomes the Gaussian factor that, beside all others', has the step's
own mean and variance (Minka 2001; over polytopes Cunningham, Hennig and Lacoste-Julien 2011). What was rounded to 0 may
be shadow, of which the model knows nothing, by a probability pi that the pixels around tell, in the same picture: of
those where more than a step is expected, the share that is dark. What a lobe is like is told by the pixels around, too:
each says what its own pictures alone do, below 0 where they do, and all are pooled with the scatter between them that
their variances do not explain (DerSimonian and Laird 1986). Lobes that limits hold at 0 or above, each for itself, lean
all to one side, and depths with them.

Not modelled: bounced light; roundings by another step than the median light's; that parameters of one lobe, and lobes
of neighbours, err together.
"""

from __future__ import annotations

import math

import numpy as np
from numba import prange
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from ..compiled import kernel, parallel_kernel
from ..progress import Progress, Work
from . import joint
from .coarse_to_fine import BLOCK, Solution, Views
from .fit import PLACES, moved
from .lobe import DIFFUSE, DIRECT_UNKNOWNS, HALF_STEP, RISE, SPECULAR, STATE, UNKNOWNS, Pixel, evaluate

ROUNDS = 5  # in each of which the model is made linear anew, and the neighbours are asked
SWEEPS = 4  # over all factors
KEPT = 0.3  # share of a factor as it was that stays at each visit
SLACK = 0.05  # of half a step, by which the model itself may be off
OUTLIER, OUTSIDE = 1e-3, 0.02  # probability that a lit value is none of the model's, and of such a value where it is
DEPTH_PRIOR = 0.25  # of the way between the depth's limits: how far it may be from the fit's
PRIOR = np.array([0.0, 0.4, 0.4, 0.7, 0.3, 1.0, 0.3, 0.3])  # of the others; of reflectances, over the diffuse one
FAINT = 1e-3  # of the lobe: diffuse reflectances below it may be that
LOBE = 3  # the first unknown that neighbours tell; the last is the last of direct light
TELLS = 0.02  # of what was known of an unknown beforehand: less is not told
TELLING = 1.5  # half steps expected at least where a dark pixel tells of shadow
USUAL_SHADOW, USUAL_WEIGHT = 0.25, 0.03  # probability where no neighbour tells, and as how many pixels it counts
SHADOW_REACH, LOBE_REACH = 2.0, 4.0  # standard deviations of the neighbourhoods that tell [px]
POOLINGS = 3  # in which the scatter between neighbours settles
ENOUGH = 0.05  # share of a neighbourhood that tells, at least


def average_allowed(views: Views, solution: Solution) -> Work[None]:
    """Replace states by the means, and deviations by the spreads, of what coarsely rounded pictures allow.

    Parameters
    ----------
    views : Views
        Without bounced light; of values below 0 is known that they were rounded to 0.
    solution : Solution
        Changed in place. Needs as much memory beside it as the values.
    """
    pixels = np.flatnonzero(solution.kind != joint.NONE)
    expected, precision = np.zeros((2, len(pixels), UNKNOWNS))
    told, told_precision = np.zeros((2, len(pixels), DIRECT_UNKNOWNS - LOBE))
    for turn in range(ROUNDS):
        shadow = shadowed(views, solution)
        for j in range(LOBE, DIRECT_UNKNOWNS):
            own = told[:, j - LOBE], told_precision[:, j - LOBE]
            expected[:, j], precision[:, j] = pooled(views.mask, pixels, *own)
        for start in range(0, len(pixels), BLOCK):
            part = slice(start, start + BLOCK)
            solution.deviation[pixels[part]], told[part], told_precision[part] = sweep_allowed(
                pixels[part], solution.state, solution.kind, views.rays, views.near, views.far, views.values,
                views.positions, views.noise, shadow, expected[part], precision[part],
            )  # fmt: skip
            done = turn * len(pixels) + min(start + BLOCK, len(pixels))
            yield Progress("roundings", done, ROUNDS * len(pixels), "pixels")


def shadowed(views: Views, solution: Solution) -> NDArray[np.float32]:
    """Return the probability that a pixel is in a light's shadow, (P, L), as its neighbours tell."""
    expected: NDArray[np.float32] = predicted(solution.state, solution.kind, views.rays, views.positions)
    picture = np.zeros((2, *views.mask.shape))
    for light, (seen, values) in enumerate(zip(expected.T, views.values.T, strict=True)):
        telling = (seen > TELLING * HALF_STEP * views.noise) & (values != 0.0)
        picture[:, views.mask] = telling & (values < 0.0), telling
        dark, told = (gaussian_filter(one, SHADOW_REACH)[views.mask] for one in picture)
        expected[:, light] = (dark + USUAL_SHADOW * USUAL_WEIGHT) / (told + USUAL_WEIGHT)
    return expected


def pooled(
    mask: NDArray[np.bool_], pixels: NDArray[np.int64], told: NDArray[np.float64], precision: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what the pixels around say together of an unknown, and its precision, (N,) each.

    Parameters
    ----------
    mask : (H, W) bool
    pixels : (N,) int64
        Which of its pixels tell.
    told, precision : (N,) float64
        What each says, and its precision, 1 / variance; 0 where it says nothing.

    Returns
    -------
    mean, precision : (N,) float64
        Precision of the pooled mean and of the scatter between pixels together; 0 where too few tell.
    """
    places = tuple(np.argwhere(mask)[pixels].T)

    def around(values: NDArray[np.float64]) -> NDArray[np.float64]:
        picture = np.zeros(mask.shape)
        picture[places] = values
        return np.asarray(gaussian_filter(picture, LOBE_REACH, mode="constant")[places])

    tells = precision > 0.0
    variance = 1.0 / np.where(tells, precision, 1.0)
    share = around(tells.astype(float))
    between = np.zeros(len(told))
    for _ in range(POOLINGS):
        weight = np.where(tells, 1.0 / (variance + between), 0.0)
        total = np.maximum(around(weight), 1e-300)
        mean = around(weight * told) / total
        scatter = around(weight * told**2) - total * mean**2
        between = np.maximum(between + (scatter - share) / total, 0.0)
    pixels_around = 4.0 * np.pi * LOBE_REACH**2  # as which a Gaussian's weights average
    enough = share > ENOUGH
    return np.where(enough, mean, 0.0), np.where(enough, 1.0 / (between + 1.0 / (pixels_around * total)), 0.0)


@kernel
def everywhere(state, glossy, ray, positions, roots, jacobian):  # type: ignore[no-untyped-def]
    """Fill the cube roots that the model predicts, 0 where a light is behind the surface, and their derivatives."""
    count = len(positions)
    nothing = np.zeros(UNKNOWNS)
    plain = Pixel(ray, 0.0, 0.0, count, positions, np.zeros(count), np.ones(count), 1.0, 0.0, False, nothing, nothing)
    evaluate(state, glossy, plain, 1.0, roots, jacobian)


@parallel_kernel
def predicted(states, kinds, rays, positions):  # type: ignore[no-untyped-def]
    """Return the values over intensity that the model predicts, (P, L) float32; 0 for pixels that are not solved."""
    found = np.zeros((len(states), len(positions)), np.float32)
    for p in prange(len(states)):
        if kinds[p] != joint.NONE:
            roots = np.empty(len(positions))
            everywhere(states[p], kinds[p] == joint.GLOSSY, rays[p], positions, roots, np.empty((0, UNKNOWNS)))
            found[p] = roots**3
    return found


@kernel
def truncated(mean, variance, low, high):  # type: ignore[no-untyped-def]
    """Return mass, mean and variance of a Gaussian between two limits."""
    spread = math.sqrt(variance)
    a, b = (low - mean) / spread, (high - mean) / spread
    if a > 0.0:  # differences of upper tails, which are small numbers
        mass = 0.5 * (math.erfc(a * math.sqrt(0.5)) - math.erfc(b * math.sqrt(0.5)))
    else:
        mass = 0.5 * (math.erfc(-b * math.sqrt(0.5)) - math.erfc(-a * math.sqrt(0.5)))
    if not mass > 1e-12:
        return 1e-12, (low if mean < low else high), 1e-4 * variance
    at_a = math.exp(-0.5 * a * a) / math.sqrt(2.0 * math.pi) if a > -30.0 else 0.0
    at_b = math.exp(-0.5 * b * b) / math.sqrt(2.0 * math.pi) if b < 30.0 else 0.0
    shift = (at_a - at_b) / mass
    bent = ((a * at_a if a > -30.0 else 0.0) - (b * at_b if b < 30.0 else 0.0)) / mass
    return mass, mean + spread * shift, max(variance * (1.0 + bent - shift * shift), 1e-6 * variance)


@kernel
def propagate(jacobian, value, low, high, lit, shadow, slack, mean, covariance):  # type: ignore[no-untyped-def]
    """Turn mean and covariance of the unknowns' prior, in place, into those given all limits of N values.

    Parameters
    ----------
    jacobian : (N, U) float64
    value, low, high : (N,) float64
        Where the unknowns are 0, and the limits.
    lit : int
        How many values are lit; the others may be shadow.
    shadow : (N,) float64
        By which probability.
    slack : float
        Standard deviation of the model.
    """
    count = len(value)
    tau, nu = np.zeros(count), np.zeros(count)
    for _ in range(SWEEPS):
        for i in range(count):
            along = covariance @ jacobian[i]
            variance = jacobian[i] @ along
            if variance <= 1e-18 * slack * slack:  # as where a light is behind the surface
                continue
            now = jacobian[i] @ mean + value[i]
            without = 1.0 / variance - tau[i]
            if without <= 1e-12 / variance:
                continue
            rest = 1.0 / without
            centre = rest * (now / variance - nu[i])
            whole = rest + slack * slack
            mass, inside, narrow = truncated(centre, whole, low[i], high[i])
            gain = rest / whole
            inside = centre + gain * (inside - centre)
            narrow = rest - gain * gain * (whole - narrow)
            other = OUTLIER if i < lit else shadow[i]
            share = (1.0 - other) * mass
            share /= share + other * (OUTSIDE if i < lit else 1.0)
            both = share * inside + (1.0 - share) * centre
            spread = share * (narrow + (inside - both) ** 2) + (1.0 - share) * (rest + (centre - both) ** 2)
            new_tau = max(1.0 / spread - without, 0.0)
            new_nu = both / spread - centre * without if new_tau > 0.0 else 0.0
            by_tau, by_nu = (1.0 - KEPT) * (new_tau - tau[i]), (1.0 - KEPT) * (new_nu - nu[i])
            scale = 1.0 + by_tau * variance
            if scale <= 1e-6:
                continue
            mean += along * ((by_nu - by_tau * now) / scale)
            covariance -= (by_tau / scale) * np.outer(along, along)
            tau[i] += by_tau
            nu[i] += by_nu


@kernel
def allowed(state, glossy, pixel, shadow, told, told_precision):  # type: ignore[no-untyped-def]
    """Move a state to the mean of what a pixel's roundings allow; return the spread of its depth [m].

    Fills ``told`` and ``told_precision``, (5,) each, with what the roundings alone say of the lobe, and its precision.
    """
    count = len(pixel.roots)
    half = HALF_STEP * pixel.noise
    roots, jacobian = np.empty(count), np.empty((count, UNKNOWNS))
    low, high = np.full(count, -1e30), pixel.roots**3
    low[: pixel.lit] = high[: pixel.lit] - half
    high[: pixel.lit] += half
    everywhere(state, glossy, pixel.ray, pixel.lights, roots, jacobian)
    by_value = 3.0 * (roots * roots).reshape(-1, 1) * jacobian[:, :DIRECT_UNKNOWNS]
    before, spread = beforehand(state, glossy, pixel)
    mean, covariance = before.copy(), np.diag(spread * spread)
    propagate(by_value, roots**3, low, high, pixel.lit, shadow, SLACK * half, mean, covariance)
    for j in range(LOBE, DIRECT_UNKNOWNS):
        known = 1.0 / (spread[j] * spread[j])
        own = 1.0 / covariance[j, j] - known
        if glossy and own > TELLS * known:
            told_precision[j - LOBE] = own
            told[j - LOBE] = state[PLACES[j]] + (mean[j] / covariance[j, j] - before[j] * known) / own
    step, moved_state = np.zeros(UNKNOWNS), np.empty(STATE)
    step[:DIRECT_UNKNOWNS] = mean
    moved(state, step, pixel, moved_state)
    state[:] = moved_state
    return math.sqrt(max(covariance[0, 0], 0.0))


@kernel
def beforehand(state, glossy, pixel):  # type: ignore[no-untyped-def]
    """Return mean, over the state, and standard deviation of the unknowns before the pictures are looked at."""
    mean, spread = np.zeros(DIRECT_UNKNOWNS), PRIOR.copy()
    spread[0] = DEPTH_PRIOR * (pixel.far - pixel.near)
    diffuse = max(state[DIFFUSE], FAINT * (state[SPECULAR] + state[RISE]), 1e-30)
    spread[5] *= diffuse
    spread[6], spread[7] = max(state[SPECULAR], spread[6] * diffuse), max(state[RISE], spread[7] * diffuse)
    for j in range(LOBE, DIRECT_UNKNOWNS):
        if glossy and pixel.precision[j] > 0.0:
            spread[j] = 1.0 / math.sqrt(pixel.precision[j])
            mean[j] = pixel.expected[j] - state[PLACES[j]]
        elif not glossy and j != 5:
            spread[j] = 1e-9
    return mean, spread


@parallel_kernel
def sweep_allowed(  # type: ignore[no-untyped-def]
    pixels, states, kinds, rays, near, far, values, positions, noise, shadow, expected, precision
):
    """Move the states of some pixels in place to the means of what is allowed.

    Returns the spreads of their depths, (N,), and what their lobes are told to be and by which precision, (N, 5) each.
    """
    spreads = np.empty(len(pixels))
    told = np.zeros((len(pixels), DIRECT_UNKNOWNS - LOBE))
    told_precision = np.zeros_like(told)
    for i in prange(len(pixels)):
        own = pixels[i]
        pixel = joint.gather(
            values[own], rays[own], near[own], far[own], positions, noise[own], False, expected[i], precision[i], 1
        )
        known = np.concatenate((np.flatnonzero(values[own] > 0.0), np.flatnonzero(values[own] < 0.0)))
        dark = shadow[own][known].astype(np.float64)
        spreads[i] = allowed(states[own], kinds[own] == joint.GLOSSY, pixel, dark, told[i], told_precision[i])
    return spreads, told, told_precision
