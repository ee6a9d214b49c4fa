"""Normals, basis BRDFs and weight maps by alternating constrained least squares (Alldrin et al. 2008).

Minimised over the normals n, the weights w >= 0 and the tables B >= 0 that do not rise with theta_h is ::

    J = sum_p sum_l c_pl sum_colours (y_pl - cos(theta_i) sum_k w_pk B_k(theta_h, theta_d))^2 + smoothness of B

Each half of a round lowers J: the tables by one convex program (:mod:`.bases`), then every pixel's weights, exactly,
with its normal (:mod:`.pixel`). The certainty c of each value is settled in the first rounds, from what the model
foresees, and fixed from then on. Where the colour lies in the bases, S = 3 and M = 1; where it lies in the weights,
S = 1 and M = 3.

Not modelled: anisotropy, light from other surfaces, light through the surface.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...progress import Progress, Work
from . import bases
from .foreseen import noise_of
from .pixel import misfit, refine, settle
from .sight import Sight
from .start import WIDTH, Start, begin, clusters

HOLDING = 4  # rounds in which the normals stay where the start put them
SETTLING = 6  # rounds in which the certainty of the values is estimated anew
SMOOTH_H, SMOOTH_D, SLOPE_D = 1.0, 10.0, 1e-2  # times the squared misfit of the usual pixel
NOISE, LEAST_NOISE = 1e-3, 1e-6  # that squared misfit at the start, and at least
STRAY = 0.0
STEPS = 3
PROMISING, LITTLE = 5.0, 0.08  # one basis is tried when merging several does not raise the misfit further,
AS_WELL = 6e-4  # and taken when its own misfit is above theirs by no more
ENOUGH = 1e-3  # the last round lowers J by a smaller share than this
LEAST_REFERENCE = 1e-3  # of the largest: what changes of a dark table's nodes are measured by
LEAST_MISFIT = 1e-4
CLEARLY = 0.8  # share of a known normal's misfit that another one must reach to replace it


@dataclass(frozen=True)
class Options:
    """How the alternation runs.

    Parameters
    ----------
    bases : int
        K, 1 to 4.
    colour : str
        ``"bases"`` or ``"weights"``: where the colour lies.
    nodes_h, nodes_d : int
        Nodes of the tables along theta_h and theta_d.
    rounds : int
        Most rounds after the certainty is settled.
    by_symmetry : bool
        Start from the azimuth by symmetry, as the source does.
    """

    bases: int = 3
    colour: str = "bases"
    nodes_h: int = 64
    nodes_d: int = 6
    rounds: int = 10
    by_symmetry: bool = False


@dataclass(frozen=True)
class Decomposition:
    """What the alternation found.

    Parameters
    ----------
    normals : (P, 3) float64
        Unit, camera space.
    weights : (P, K, M) float64
    table : (TH, TD, K, S) float64
        [1/sr]
    seen : (TH, TD, K) float64
        Sum of certainty times squared share over the values that reached a node.
    misfit : (P,) float64
        How badly a pixel is explained, 0 to 1 (:func:`.pixel.misfit`).
    deviation : (P,) float64
        Standard deviation of the normal [rad] by the misfit and the curvature of the cost; a systematic error of the
        model is not in it.
    kept : (P,) bool
        Where the start explains the pictures better than the tables do, or the known normal was left.
    objective : tuple of float
        J after every half round with settled certainty.
    """

    normals: NDArray[np.float64]
    weights: NDArray[np.float64]
    table: NDArray[np.float64]
    seen: NDArray[np.float64]
    misfit: NDArray[np.float64]
    deviation: NDArray[np.float64]
    kept: NDArray[np.bool_]
    objective: tuple[float, ...]


class Alternation:
    """The state of the alternation: tables, weights, normals, certainty."""

    def __init__(self, sight: Sight, start: Start, options: Options) -> None:
        self.sight = sight
        self.scale = sight.scale()
        owner = clusters(start.features, options.bases)
        count = int(owner.max(initial=0)) + 1
        colours, sets = (3, 1) if options.colour == "bases" else (1, 3)
        self.shape = (options.nodes_h, options.nodes_d, count, colours)
        self.normals = start.normals.copy()
        self.weights = np.zeros((len(owner), count, sets))
        self.weights[np.arange(len(owner)), owner] = start.albedo[:, None]
        self.certainty = start.certainty
        self.table = np.zeros(self.shape)
        self.costs = np.zeros(len(owner))
        self.stiffness = np.zeros(len(owner))
        self.smooth = np.zeros((0, 1))
        self.seen = np.zeros(self.shape[:3])

    def settle(self) -> None:
        """Estimate every value's certainty from what the model foresees."""
        self.certainty = np.empty(self.sight.usable.shape, np.float32)
        settle(
            *self._sight(), self.sight.usable, self.scale, self.table, self.normals, self.weights, STRAY,
            self.certainty,
        )  # fmt: skip

    def measure_smoothness(self) -> None:
        """Fix what smoothness costs: relative to the tables as they are, beside the data's own weight per node.

        It grows with the squared misfit of the usual pixel, for what noisy values say about a table is believed less,
        and is as forgiving as the certainty where highlights rise above the usual value.
        """
        reference, noise = np.ones(self.shape[:3]), NOISE
        if self.table.any():
            mean = self.table.mean(axis=(2, 3))
            reached = self.seen.sum(axis=2)
            usual = float(np.average(mean, weights=reached / np.maximum(mean, 1e-30) ** 2))
            mean = np.maximum(mean, LEAST_REFERENCE * usual)
            reference = np.repeat((mean / usual)[..., None], self.shape[2], axis=2)
            noise = float(np.median(self.costs / np.maximum((self.certainty > 0).sum(axis=1), 1)))
        strength = reference**2 / noise_of.py_func(reference) * noise_of.py_func(1.0)
        data = self._information() * max(noise, LEAST_NOISE)
        steps = (self.shape[0] / 64.0) ** 3  # second differences of finer nodes are smaller
        self.smooth = data * bases.smoothness(reference, strength, SMOOTH_H * steps, SMOOTH_D, SLOPE_D)

    def _information(self) -> float:
        """Return what the values together say about the usual node."""
        weight = (self.weights**2).sum(axis=1).mean(axis=1)
        return float((self.certainty.sum(axis=1) * weight).sum()) / self.seen.size

    def normalise(self) -> None:
        """Give every basis weights of mean 1; the product of weight and table stays."""
        mean = self.weights.mean(axis=(0, 2))
        mean[mean <= 0] = 1.0
        self.weights /= mean[:, None]
        self.table *= mean[:, None]

    def improve_tables(self) -> None:
        """Minimise J over the tables."""
        equations = bases.gather(self.sight, self.certainty, self.normals, self.weights, self.shape)
        self.seen = equations.band[:, 0].reshape(self.shape[:3])
        band = bases.total(equations.band, self.smooth)
        nodes_h, nodes_d, count, colours = self.shape
        for s in range(colours):
            old = self.table[..., s].ravel()
            new = bases.minimise(band, equations.moments[:, s], (nodes_h, nodes_d * count))
            if not old.any() or bases.value(band, equations.moments[:, s], new) <= bases.value(
                band, equations.moments[:, s], old
            ):
                self.table[..., s] = new.reshape(self.shape[:3])

    def improve_pixels(self, steps: int = STEPS) -> None:
        """Minimise J over the weights, and go some steps down over the normals."""
        refine(
            *self._sight(), self.certainty, self.table, steps, self.normals, self.weights, self.costs, self.stiffness
        )

    def objective(self) -> float:
        """Return J after :meth:`improve_pixels`."""
        rough = sum(
            float(x @ bases.multiply(self.smooth, x)) for x in np.moveaxis(self.table, -1, 0).reshape(self.shape[3], -1)
        )
        return float(self.costs.sum()) + rough

    def misfit(self, normals: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how badly normals and weights explain the pixels under the tables, (P,)."""
        out = np.empty(len(normals))
        misfit(*self._sight(), self.sight.usable, self.scale, self.table, normals, weights, WIDTH, out)
        return out

    def deviation(self) -> NDArray[np.float64]:
        """Return the standard deviation of each normal [rad] after :meth:`improve_pixels` with steps."""
        free = (self.certainty > 0).sum(axis=1) - 2 - self.shape[2]
        variance = self.costs / np.maximum(free, 1) / np.maximum(self.stiffness, 1e-30)
        return np.where(free > 0, np.minimum(np.sqrt(variance), np.pi / 2), np.pi / 2)

    def merged(self) -> Alternation:
        """Return the state with one basis in the usual pixel's mixture of them, where colours lie in the bases."""
        one = copy.copy(self)
        share = np.median(self.weights / np.maximum(self.weights.sum(axis=1, keepdims=True), 1e-30), axis=0).mean(
            axis=1
        )
        one.shape = (*self.shape[:2], 1, self.shape[3])
        one.table = np.ascontiguousarray((self.table * share[:, None]).sum(axis=2, keepdims=True))
        one.seen = self.seen.sum(axis=2, keepdims=True)
        one.normals, one.costs, one.stiffness = self.normals.copy(), self.costs.copy(), self.stiffness.copy()
        one.weights = np.empty((len(self.normals), 1, self.weights.shape[2]))
        one.improve_pixels(0)
        return one

    def _sight(self) -> tuple[NDArray[np.float64], bool, NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]:
        s = self.sight
        return s.lights, s.near, s.points, s.views, s.values


def decompose(
    sight: Sight, options: Options, normals: NDArray[np.float64] | None = None, held: bool = False
) -> Work[Decomposition]:
    """Find normals, weights and tables of the pixels.

    Where one basis explains the usual pixel nearly as well as several, one is taken: what several could absorb by
    weights that vary with the slope belongs to the normals. The first rounds leave the normals where the start put
    them, so that the first tables do not spoil them.

    Parameters
    ----------
    sight : Sight
    options : Options
    normals : (P, 3) float64, optional
        Known normals. They are left where they are but for pixels that the tables in the end explain clearly better
        with another one.
    held : bool
        Whether known normals stay in any case.

    Yields
    ------
    Progress per roughness of the start and per round.
    """
    start = yield from begin(sight, normals, options.by_symmetry)
    state = Alternation(sight, start, options)
    objective = yield from alternate(state, options, normals is None, "alternate")
    if state.shape[2] > 1:
        single = state.merged()
        if usual(single) < PROMISING * usual(state) + LITTLE:
            descent = yield from alternate(single, options, normals is None, "one basis")
            if usual(single) < usual(state) + AS_WELL:
                state, objective = single, descent
    if held:
        return _finished(state, state.deviation(), np.zeros(len(state.normals), bool), objective)
    if normals is not None:
        return _corrected(state, start, objective)
    return _between(state, start, objective)


def alternate(state: Alternation, options: Options, free: bool, label: str) -> Work[list[float]]:
    """Run the rounds and return J after every one with settled certainty; without ``free`` the normals are held."""
    objective: list[float] = []
    total = SETTLING + options.rounds
    for done in range(total):
        if done <= SETTLING:
            if state.table.any():
                state.settle()
            state.normalise()
            state.measure_smoothness()
        state.improve_tables()
        state.improve_pixels(STEPS if free and done >= HOLDING else 0)
        objective.append(state.objective())
        yield Progress(label, done + 1, total, "rounds")
        if done > SETTLING and objective[-2] - objective[-1] < ENOUGH * objective[-1]:
            break
    yield Progress(label, total, total, "rounds")
    return objective[SETTLING:]


def usual(state: Alternation) -> float:
    """Return the median misfit of the pixels."""
    return float(np.median(state.misfit(state.normals, state.weights))) if len(state.normals) else 0.0


def _between(state: Alternation, start: Start, objective: list[float]) -> Decomposition:
    """Take each pixel's normal between the start's and the tables', the nearer to the one that explains it better.

    The two models err in different ways: the tables hold for all pixels alike, the start's lobe for one. Weighted by
    the inverse of their misfits, the mean is better than either on most of what was tried, and where the tables do not
    explain a pixel it falls back to the start.
    """
    own = state.misfit(state.normals, state.weights)
    deviation = state.deviation()
    shares = [1.0 / np.maximum(misfit, LEAST_MISFIT) for misfit in (start.misfit, own)]
    mean = shares[0][:, None] * start.normals + shares[1][:, None] * state.normals
    state.normals = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    state.improve_pixels(0)
    return _finished(state, deviation, start.misfit < own, objective)


def _corrected(state: Alternation, start: Start, objective: list[float]) -> Decomposition:
    """Leave known normals but where the tables explain the pixel clearly better with another."""
    known, before = state.normals.copy(), state.misfit(state.normals, state.weights)
    state.improve_pixels(STEPS)
    deviation = state.deviation()
    better = state.misfit(state.normals, state.weights) < CLEARLY * before
    state.normals = np.where(better[:, None], state.normals, known)
    state.improve_pixels(0)
    return _finished(state, deviation, ~better, objective)


def _finished(
    state: Alternation, deviation: NDArray[np.float64], kept: NDArray[np.bool_], objective: list[float]
) -> Decomposition:
    left = state.misfit(state.normals, state.weights)
    return Decomposition(state.normals, state.weights, state.table, state.seen, left, deviation, kept, tuple(objective))
