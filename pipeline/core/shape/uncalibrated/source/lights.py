"""Directions of the lights by Newton's method, their strengths by least squares; each light by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .state import HIGHLIGHT, TINY, State

Array = NDArray[np.float64]

DIFFERENCE = 1e-4  # of a direction, by which derivatives are taken
DAMPING = 1e-3
LARGEST = 0.2  # turn in one step [rad]
HALVINGS = 4


def turn(state: State) -> None:
    """Turn every light that is not known by a step of Gauss and Newton, halved until its share of the sum falls."""
    directions = state.directions
    tangents = np.linalg.svd(directions[:, None])[2][:, 1:]
    sure, rest = state.certainty(), state.pictures.values - state.shown(*state.parts())
    slopes, bends = [], []
    for along in (tangents[:, 0], tangents[:, 1]):
        ends = [replace(state, directions=_unit(directions + by * along)) for by in (DIFFERENCE, -DIFFERENCE)]
        shown, halves = [end.shown(*end.parts()) for end in ends], [end.halves() for end in ends]
        slopes.append((shown[0] - shown[1]) / (2.0 * DIFFERENCE))
        bends.append((halves[0] - halves[1]) / (2.0 * DIFFERENCE))
    bright = HIGHLIGHT * state.highlights
    off = state.normals[:, None] - state.halves()
    system, right = np.empty((len(directions), 2, 2)), np.empty((len(directions), 2))
    for i in range(2):
        right[:, i] = np.einsum("pl,plc,plc->l", sure, slopes[i], rest, optimize=True)
        right[:, i] += np.einsum("pl,plc,plc->l", bright, bends[i], off, optimize=True)
        for j in range(2):
            system[:, i, j] = np.einsum("pl,plc,plc->l", sure, slopes[i], slopes[j], optimize=True)
            system[:, i, j] += np.einsum("pl,plc,plc->l", bright, bends[i], bends[j], optimize=True)
    system += (DAMPING * np.trace(system, axis1=1, axis2=2) + TINY)[:, None, None] * np.eye(2)
    step = np.linalg.solve(system, right[..., None])[..., 0]
    step *= np.minimum(1.0, LARGEST / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), TINY))
    step[state.held] = 0.0
    move = np.einsum("lt,lti->li", step, tangents)
    state.directions = _halved(
        state, lambda share: replace(state, directions=_unit(directions + share * move))
    ).directions


def strengthen(state: State) -> None:
    """Find every light's strength by linear least squares, that of the logarithm's scatter being linearised."""
    strengths = state.strengths
    sure, shown = state.certainty(), state.shown(*state.parts()) / strengths[:, None]
    above = np.einsum("pl,plc,plc->l", sure, shown, state.pictures.values, optimize=True)
    below = np.einsum("pl,plc,plc->l", sure, shown, shown, optimize=True)
    trust = 1.0 / (strengths * state.scatter) ** 2
    found = (above + trust * strengths * (1.0 - np.log(strengths))) / (below + trust)
    change = np.log(np.maximum(found, 0.5 * strengths) / strengths)
    state.strengths = _halved(
        state, lambda share: replace(state, strengths=strengths * np.exp(share[:, 0] * change))
    ).strengths


def _halved(state: State, changed: Callable[[Array], State]) -> State:
    """Return the state that lights (L,) changed by shares (L, 1) of a step make, none of whose costs rises."""
    before, share = state.light_costs(), np.ones((len(state.strengths), 1))
    for _ in range(HALVINGS):
        worse = changed(share).light_costs() > before
        if not worse.any():
            break
        share[worse] /= 2.0
    share[changed(share).light_costs() > before] = 0.0
    return changed(share)


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), TINY))
