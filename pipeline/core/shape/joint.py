"""One pixel's joint fit of depth, normal and lobe: from its neighbours' solutions, or from blind starts."""

from __future__ import annotations

import numpy as np
from numba import prange

from ..compiled import kernel, parallel_kernel
from .fit import EXACT, diffuse_start, glossy_start, refine
from .lobe import DEPTH, NX, NY, NZ, STATE, UNKNOWNS, Pixel, evaluate

NONE, DIFFUSE_ONLY, GLOSSY = 0, 1, 2
SCORE_SCALE = 0.01  # share of the median root: residuals above it count as misfit when starts are compared
NO_SCALES = np.empty(0)
QUICK = np.array([2.0])
FULL = np.array([4.0, 2.0, 1.0])
STEPS = 12
QUICK_STEPS = 5
BLIND_DEPTHS = 6
MIRROR = (True, False, True, False)  # of the four lobes tried at each blind depth: about which normal,
ALPHAS = (0.12, 0.12, 0.4, 0.4)  # and how wide
LOBE_UNKNOWNS = 5.0
FINALISTS = 3
CONTRADICTION = 1.15  # what is expected of a lobe may raise the pictures' misfit by this factor


@kernel
def gather(values, ray, near, far, positions, noise, bounced, expected, precision, min_lit):  # type: ignore[no-untyped-def]
    """Return what one pixel knows: its lit lights, then those rounded to 0; none if fewer than ``min_lit`` are lit."""
    lit, rounded = np.flatnonzero(values > 0.0), np.flatnonzero(values < 0.0)
    if len(lit) < min_lit:
        lit, rounded = lit[:0], rounded[:0]
    known = np.concatenate((lit, rounded))
    lights = np.empty((len(known), 3))
    roots = np.empty(len(known))
    for i in range(len(known)):
        lights[i] = positions[known[i]]
        roots[i] = abs(values[known[i]])
    middle = np.median(roots[: len(lit)]) if len(lit) > 0 else 0.0
    return Pixel(
        ray, near, far, len(lit), lights, roots, np.ones(len(known)), middle, noise, bounced, expected, precision
    )


@kernel
def score_of(state, glossy, pixel):  # type: ignore[no-untyped-def]
    """Return the mean cost at a scale that is the same for all starts of a pixel."""
    residuals = np.empty(len(pixel.roots))
    nothing = np.empty((0, UNKNOWNS))
    return evaluate(state, glossy, pixel, SCORE_SCALE * pixel.middle, residuals, nothing)


@kernel
def compete(starts, count, glossy, quick, finalists, pixel, state, summary):  # type: ignore[no-untyped-def]
    """Refine the starts, the most promising ones to the end; write the best to ``state`` and return its score."""
    scores = np.full(count, np.inf)
    for k in range(count):
        if quick:
            refine(starts[k], glossy, pixel, QUICK, QUICK_STEPS, summary)
        scores[k] = score_of(starts[k], glossy, pixel)
    order = np.argsort(scores)
    best = np.inf
    for k in range(min(finalists, count)):
        trial = starts[order[k]]
        refine(trial, glossy, pixel, FULL, STEPS, summary)
        score = score_of(trial, glossy, pixel)
        if score < best:
            best = score
            state[:] = trial
        if summary[0] < EXACT * pixel.middle:
            break
    return best


@kernel
def blind(state, glossy, pixel, summary):  # type: ignore[no-untyped-def]
    """Fit from depths along the whole ray, with a lobe each from two normals and two widths; return the score."""
    kinds = len(ALPHAS) if glossy else 1
    starts = np.empty((BLIND_DEPTHS * kinds, STATE))
    upper = np.quantile(pixel.roots[: pixel.lit], 0.6 if glossy else 0.8)  # highlights are above it
    for k in range(BLIND_DEPTHS):
        depth = pixel.near + (k + 0.5) / BLIND_DEPTHS * (pixel.far - pixel.near)
        for j in range(kinds):
            start = starts[kinds * k + j]
            diffuse_start(start, depth, pixel, upper)
            if glossy:
                glossy_start(start, MIRROR[j], ALPHAS[j], pixel)
    return compete(starts, len(starts), glossy, True, FINALISTS if glossy else 1, pixel, state, summary)


@kernel
def carried(source, source_ray, pixel, out):  # type: ignore[no-untyped-def]
    """Write a neighbour's state with its depth carried to this ray along the neighbour's tangent plane."""
    out[:] = source
    ray = pixel.ray
    across = source[NX] * ray[3] + source[NY] * ray[4] + source[NZ] * ray[5]
    if across < -0.05:
        along = 0.0
        for i in range(3):
            along += source[NX + i] * (source_ray[i] + source[DEPTH] * source_ray[3 + i] - ray[i])
        depth = along / across
        if abs(depth - source[DEPTH]) < 0.2 * (pixel.far - pixel.near):
            out[DEPTH] = depth
    out[DEPTH] = min(pixel.far, max(pixel.near, out[DEPTH]))


@kernel
def from_neighbours(state, glossy, others, states, kinds, rays, pixel, summary):  # type: ignore[no-untyped-def]
    """Fit from the neighbours' solutions of the same kind; return the score, infinite where there is none."""
    starts = np.empty((len(others), STATE))
    count = 0
    for k in range(len(others)):
        other = others[k]
        if other >= 0 and kinds[other] == (GLOSSY if glossy else DIFFUSE_ONLY):
            carried(states[other], rays[other], pixel, starts[count])
            count += 1
    if count == 0:
        return np.inf
    return compete(starts, count, glossy, False, 2, pixel, state, summary)


@kernel
def solve_pixel(own, others, states, scores, kinds, rays, pixel, out, summary):  # type: ignore[no-untyped-def]
    """Solve one pixel from its neighbours and, where they do not explain it, from blind starts.

    The diffuse model is tried first; the lobe must pay for its unknowns (Schwarz 1978). Returns (score, kind), fills
    ``out`` with the state and ``summary`` with relative spread and the depth's standard deviation.
    """
    count = pixel.lit
    if count == 0:
        return np.inf, NONE
    best, kind = scores[own], kinds[own]
    first = kind == NONE
    out[:] = states[own]
    expected = np.inf
    seen = np.zeros(3, np.bool_)
    for k in range(len(others)):
        if others[k] >= 0:
            seen[kinds[others[k]]] = True
            expected = min(expected, scores[others[k]])
    good = 2.0 * expected + 1e-6
    trial = np.empty(STATE)
    exact = False  # one value that the model cannot explain spoils a score, but not the spread
    for glossy in (False, True):
        if exact or (not glossy and seen[GLOSSY] and not seen[DIFFUSE_ONLY]):
            continue
        score = from_neighbours(trial, glossy, others, states, kinds, rays, pixel, summary)
        exact = score < np.inf and summary[0] < EXACT * pixel.middle
        if first and not exact and not score < good:
            again = np.empty(STATE)
            blind_score = blind(again, glossy, pixel, summary)
            if blind_score < score:
                score = blind_score
                trial[:] = again
                exact = summary[0] < EXACT * pixel.middle
        price = LOBE_UNKNOWNS * np.log(count) / count if glossy and kind == DIFFUSE_ONLY else 0.0
        if score < best and (best == np.inf or np.log(best) - np.log(score + 1e-300) > price):
            best, kind = score, (GLOSSY if glossy else DIFFUSE_ONLY)
            out[:] = trial
    refine(out, kind == GLOSSY, pixel, NO_SCALES, 0, summary)
    summary[0] /= pixel.middle
    return score_of(out, kind == GLOSSY, pixel), kind


@parallel_kernel
def sweep(  # type: ignore[no-untyped-def]
    pixels, neighbours, states, scores, kinds, rays, near, far, values, positions, noise, bounced, min_lit
):
    """Solve some pixels in parallel, reading the others' states from the sweep before."""
    count = len(pixels)
    new_states = np.zeros((count, STATE))
    new_scores = np.empty(count)
    new_kinds = np.empty(count, np.int8)
    summaries = np.empty((count, 2))
    nothing = np.zeros(UNKNOWNS)
    for i in prange(count):
        own = pixels[i]
        pixel = gather(
            values[own], rays[own], near[own], far[own], positions, noise[own], bounced, nothing, nothing, min_lit
        )
        summary = np.full(2, np.inf)
        score, kind = solve_pixel(own, neighbours[i], states, scores, kinds, rays, pixel, new_states[i], summary)
        new_scores[i] = score
        new_kinds[i] = kind
        summaries[i] = summary
    return new_states, new_scores, new_kinds, summaries


@parallel_kernel
def sweep_known(  # type: ignore[no-untyped-def]
    pixels,
    states,
    scores,
    kinds,
    rays,
    near,
    far,
    values,
    positions,
    noise,
    bounced,
    expected,
    precision,
    contradiction,
):
    """Refine pixels in place with what is known of their unknowns beforehand.

    Returns relative spread and depth deviation of each; a pixel whose pictures contradict what is expected of it keeps
    its state, and its row is NaN.
    """
    summaries = np.full((len(pixels), 2), np.nan)
    for i in prange(len(pixels)):
        own = pixels[i]
        pixel = gather(
            values[own], rays[own], near[own], far[own], positions, noise[own], bounced, expected[i], precision[i], 1
        )
        summary = np.empty(2)
        trial = states[own].copy()
        glossy = kinds[own] == GLOSSY
        refine(trial, glossy, pixel, FULL[1:], STEPS, summary)
        score = score_of(trial, glossy, pixel)
        if score < contradiction * scores[own] + 1e-6:
            states[own] = trial
            scores[own] = score
            summaries[i, 0] = summary[0] / pixel.middle
            summaries[i, 1] = summary[1]
    return summaries
