"""Materials, each a lobe: split, recluster, fit, and every pixel projected on them (Lensch et al. 2001)."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from ....brdf.parametric import STEEPEST
from .state import TINY, State

Array = NDArray[np.float64]

NARROWEST, WIDEST, TRIED = 0.02, 0.8, 12  # widths [rad] between which the best is sought, and how many are tried first
APART = 0.4  # of the logarithms of two lobes that one is split into
RECLUSTERED = 8  # times at most
WORTH = 0.005  # share of the sum that another material has to save
SWEEPS = 30  # over a pixel's albedo and weights


def albedo(state: State) -> None:
    """Find the albedo of every pixel by linear least squares."""
    sure, (matt, gloss) = state.certainty(), state.parts()
    rest = state.pictures.values - np.einsum("plk,pk,kc->plc", gloss, state.weights, state.tints, optimize=True)
    above = np.einsum("pl,pl,plc->pc", sure, matt, rest, optimize=True)
    state.albedo = np.maximum(above / np.maximum((sure * matt**2).sum(axis=1), TINY)[:, None], 0.0)


def project(state: State) -> None:
    """Find albedo and weights of every pixel by non-negative least squares, one unknown after the other.

    No lobe returns more light than a white surface: seen from above that is 2 pi sigma^2 times weight and tint.
    """
    sure, (matt, gloss), tints = state.certainty(), state.parts(), state.tints
    values, count = state.pictures.values, 3 + len(tints)
    system, right = np.zeros((len(matt), count, count)), np.empty((len(matt), count))
    system[:, range(3), range(3)] = (sure * matt**2).sum(axis=1)[:, None]
    between = np.einsum("pl,pl,plk->pk", sure, matt, gloss, optimize=True)
    system[:, 3:, :3] = between[:, :, None] * tints
    system[:, :3, 3:] = system[:, 3:, :3].swapaxes(1, 2)
    system[:, 3:, 3:] = np.einsum("pl,plk,plj->pkj", sure, gloss, gloss, optimize=True) * (tints @ tints.T)
    system[:, range(3, count), range(3, count)] += state.unseen() * (tints**2).sum(axis=1)
    right[:, :3] = np.einsum("pl,pl,plc->pc", sure, matt, values, optimize=True)
    right[:, 3:] = np.einsum("pl,plk,plc,kc->pk", sure, gloss, values, tints, optimize=True)
    found = np.concatenate([state.albedo, state.weights], axis=1)
    lobes = 2.0 * state.widths**2 * tints.max(axis=1, initial=0.0)
    most = np.append(np.full(3, np.inf), state.pictures.white / np.maximum(lobes, TINY))
    for _ in range(SWEEPS):
        for n in range(count):
            diagonal = system[:, n, n]
            other = np.einsum("pm,pm->p", system[:, n], found) - diagonal * found[:, n]
            best = np.clip((right[:, n] - other) / np.maximum(diagonal, TINY), 0.0, most[n])
            found[:, n] = np.where(diagonal > TINY, best, found[:, n])
    before = state.albedo, state.weights, state.cost()
    state.albedo, state.weights = np.ascontiguousarray(found[:, :3]), np.ascontiguousarray(found[:, 3:])
    if state.cost() > before[2]:
        state.albedo, state.weights = before[:2]


def fit(state: State) -> None:
    """Fit width and tint of one material after the other to what the others leave, as long as that lowers the sum."""
    for number in range(len(state.widths)):
        others = np.arange(len(state.widths)) != number
        tint, width = _Fit(state, others).best(state.weights[:, number])
        before = state.tints, state.widths, state.cost()
        state.tints, state.widths = state.tints.copy(), state.widths.copy()
        state.tints[number], state.widths[number] = tint, width
        if state.cost() > before[2]:
            state.tints, state.widths = before[:2]


def split(state: State) -> None:
    """Split the worst explained material, if the sum falls by that; the first one begins with all pixels."""
    everything = _Fit(state, np.zeros(len(state.widths), bool))
    if len(state.widths):
        owner = (state.weights * state.tints.mean(axis=1)).argmax(axis=1)
        costs = np.bincount(owner, state.value_costs().sum(axis=1), minlength=len(state.widths))
        worst = int(costs.argmax())
        members = everything.halved(owner == worst, state.tints[worst], float(state.widths[worst]))
    else:
        worst, members = 0, [np.ones(len(state.normals), bool)]
    lobes = [everything.best(own.astype(np.float64)) for own in members]
    kept = np.arange(len(state.widths)) != worst
    after = dataclasses.replace(
        state,
        weights=np.concatenate([state.weights[:, kept], np.stack(members, axis=1).astype(np.float64)], axis=1),
        tints=np.concatenate([state.tints[kept], [tint for tint, _ in lobes]]),
        widths=np.append(state.widths[kept], [width for _, width in lobes]),
    )
    project(after)
    if after.cost() < (1.0 - WORTH) * state.cost():
        state.albedo, state.weights, state.tints, state.widths = (
            after.albedo, after.weights, after.tints, after.widths,
        )  # fmt: skip


class _Fit:
    """One lobe fitted to many pixels, their albedo following.

    Values count by the cosine of the light, and not at all where light or view is more oblique than 80 degrees.
    """

    def __init__(self, state: State, others: NDArray[np.bool_]) -> None:
        self.state = state
        matt, gloss = state.parts()
        rest = np.einsum("plk,pk,kc->plc", gloss[..., others], state.weights[:, others], state.tints[others])
        self.rest = state.pictures.values - rest
        cosine = matt / state.strengths
        seen = (state.normals * state.pictures.views).sum(axis=1) > STEEPEST
        self.sure = np.where((cosine > STEEPEST) & seen[:, None], state.certainty() * cosine, 0.0)
        shaded = self.sure * matt
        self.shaded = shaded / np.sqrt(np.maximum((shaded * matt).sum(axis=1, keepdims=True), TINY))
        self.by_matt = np.einsum("pl,plc->pc", self.shaded, self.rest)

    def sums(self, width: float) -> tuple[Array, Array]:
        """Return num (P, 3) and den (P,): a tint t lowers a pixel's squared misfit by sum_c 2 t num - t^2 den."""
        gloss = dataclasses.replace(self.state, widths=np.array([width])).parts()[1][..., 0]
        across = (self.shaded * gloss).sum(axis=1)
        num = np.einsum("pl,plc->pc", self.sure * gloss, self.rest) - across[:, None] * self.by_matt
        return num, (self.sure * gloss**2).sum(axis=1) - across**2

    def best(self, weights: Array) -> tuple[Array, float]:
        """Return tint (3,) and width that lower the squared misfit the most, given the weights (P,)."""

        def tint(width: float) -> tuple[Array, float]:
            num, den = self.sums(width)
            above, below = weights @ num, max(float(weights**2 @ den), TINY)
            found = np.maximum(above / below, 0.0)
            return found, float((2.0 * found * above - found**2 * below).sum())

        tried = np.geomspace(NARROWEST, WIDEST, TRIED)
        gains = [tint(width)[1] for width in tried]
        at = int(np.argmax(gains))
        ends = np.log(tried[[max(at - 1, 0), min(at + 1, TRIED - 1)]])
        width = float(np.exp(minimize_scalar(lambda x: -tint(np.exp(x))[1], bounds=ends, method="bounded").x))
        return tint(width)[0], width

    def halved(self, members: NDArray[np.bool_], tint: Array, width: float) -> list[NDArray[np.bool_]]:
        """Return the members of each of two lobes: first those beside the one along what it leaves most open."""

        def gain(steps: Array) -> Array:
            num, den = self.sums(width * np.exp(steps[1]))
            lobe = tint * np.exp(steps[0])
            return np.asarray(2.0 * num @ lobe - den * (lobe**2).sum())

        def total(*steps: float) -> float:
            return float(gain(APART / 2.0 * np.array(steps))[members].sum())

        middle, cross = total(0, 0), total(1, 1) + total(-1, -1) - total(1, -1) - total(-1, 1)
        bend = -np.array([
            [total(1, 0) + total(-1, 0) - 2.0 * middle, cross / 4.0],
            [cross / 4.0, total(0, 1) + total(0, -1) - 2.0 * middle],
        ])  # fmt: skip
        along = APART * np.linalg.eigh(bend)[1][:, 0]
        owned = [members & (gain(along) >= gain(-along)), members & (gain(along) < gain(-along))]
        for _ in range(RECLUSTERED):
            if not all(own.any() for own in owned):
                break
            gains = []
            for own in owned:
                lobe, wide = self.best(own.astype(np.float64))
                num, den = self.sums(wide)
                gains.append(2.0 * num @ lobe - den * (lobe**2).sum())
            first = members & (gains[0] >= gains[1])
            if (first == owned[0]).all():
                break
            owned = [first, members & ~first]
        return owned
