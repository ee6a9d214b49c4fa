"""The basis BRDFs for given normals and weights: a sparse least squares with non-negative, monotone tables.

With the normals and weights fixed the model is linear in the table's nodes x. Minimised is ::

    1/2 sum certainty (y - cos(theta_i) sum_k w_k B_k)^2 + smoothness of x / reference in theta_h and theta_d

subject to B >= 0, not rising with theta_h (Alldrin, Zickler and Kriegman 2008, sections 3.2 and 3.3). The normal
matrix is a band; the inequalities are met by a primal-dual interior point method (Mehrotra 1992), every step of which
is one banded Cholesky factorisation. Nodes that no value reaches follow from smoothness alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ...compiled import kernel, parallel_kernel
from ...reflectance.angles import cell, half_coordinate
from .sight import Sight, directions

PARTS = 4  # pieces of the sum that run side by side
CLOSE = 1e-6  # duality gap over the objective at which the search ends
MOST_STEPS = 60
INWARDS = 0.995  # share of the way to the boundary that a step goes
OWN = 1e-9  # of the largest diagonal: what keeps nodes in place that nothing else determines


@dataclass(frozen=True)
class Equations:
    """Normal equations of the table.

    Parameters
    ----------
    band : (N, W) float64
        ``band[i, d]`` is the matrix at (i, i + d); node (i, j) of basis k is number ``(i TD + j) K + k`` of N.
    moments : (N, S) float64
        Right-hand sides, one per colour of the table.
    """

    band: NDArray[np.float64]
    moments: NDArray[np.float64]


def gather(
    sight: Sight,
    certainty: NDArray[np.float32],
    normals: NDArray[np.float64],
    weights: NDArray[np.float64],
    shape: tuple[int, int, int, int],
) -> Equations:
    """Sum up the normal equations over all values of all pixels.

    Parameters
    ----------
    certainty : (P, L) float32
    normals : (P, 3) float64
    weights : (P, K, M) float64
    shape : TH, TD, K, S
    """
    nodes_h, nodes_d, bases, colours = shape
    count = nodes_h * nodes_d * bases
    band = np.zeros((PARTS, count, (nodes_d + 2) * bases))
    moments = np.zeros((PARTS, count, colours))
    _gather(
        sight.lights, sight.near, sight.points, sight.views, sight.values, certainty, normals, weights,
        nodes_h, nodes_d, band, moments,
    )  # fmt: skip
    return Equations(band.sum(axis=0), moments.sum(axis=0))


@parallel_kernel
def _gather(
    lights: NDArray[np.float64],
    near: bool,
    points: NDArray[np.float64],
    views: NDArray[np.float64],
    values: NDArray[np.float32],
    certainty: NDArray[np.float32],
    normals: NDArray[np.float64],
    weights: NDArray[np.float64],
    nodes_h: int,
    nodes_d: int,
    band: NDArray[np.float64],
    moments: NDArray[np.float64],
) -> None:
    count, pixels = lights.shape[0], points.shape[0]
    bases, sets = weights.shape[1:]
    colours = moments.shape[2]
    parts = band.shape[0]
    corners_d = 2 if nodes_d > 1 else 1
    for part in prange(parts):
        to_light, half, difference = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
        index, share = np.empty(4, np.int64), np.empty(4)
        outer = np.empty((bases, bases))
        for p in range(part * pixels // parts, (part + 1) * pixels // parts):
            directions(points[p], views[p], lights, near, to_light, half, difference)
            normal = normals[p]
            for q in range(bases):
                for r in range(bases):
                    outer[q, r] = 0.0
                    for m in range(sets):
                        outer[q, r] += weights[p, q, m] * weights[p, r, m]
            for k in range(count):
                cosine = normal[0] * to_light[k, 0] + normal[1] * to_light[k, 1] + normal[2] * to_light[k, 2]
                if certainty[p, k] <= 0.0 or cosine <= 0.0:
                    continue
                middle = normal[0] * half[k, 0] + normal[1] * half[k, 1] + normal[2] * half[k, 2]
                i, a = cell(half_coordinate(middle), nodes_h)
                j, b = cell(difference[k], nodes_d)
                size = 0
                for di in range(2):
                    for dj in range(corners_d):
                        index[size] = ((i + di) * nodes_d + j + dj) * bases
                        share[size] = cosine * (a if di else 1.0 - a) * (b if dj else 1.0 - b)
                        size += 1
                for s in range(size):
                    left = certainty[p, k] * share[s]
                    for q in range(bases):
                        for c in range(colours):
                            value = 0.0
                            if sets > 1:
                                for m in range(sets):
                                    value += weights[p, q, m] * values[p, k, m]
                            else:
                                value = weights[p, q, 0] * values[p, k, c]
                            moments[part, index[s] + q, c] += left * value
                        for t in range(s, size):
                            product = left * share[t]
                            for r in range(bases):
                                offset = index[t] + r - index[s] - q
                                if offset >= 0:
                                    band[part, index[s] + q, offset] += product * outer[q, r]


def smoothness(
    reference: NDArray[np.float64],
    weight: NDArray[np.float64],
    strength_h: float,
    strength_d: float,
    slope_d: float,
) -> NDArray[np.float64]:
    """Return the band of the weighted squared second differences of x / reference.

    Parameters
    ----------
    reference : (TH, TD, K) float64, positive
        What changes are measured by.
    weight : (TH, TD, K) float64, positive
        What a relative change costs at each node.
    strength_h, strength_d : float
        Factors of the second differences along theta_h and theta_d.
    slope_d : float
        Factor of the first differences along theta_d, which keeps nodes beyond the last light's constant.
    """
    nodes_d, bases = reference.shape[1:]
    count = reference.size
    band = np.zeros((count, 2 * nodes_d * bases + 1))
    inverse, cost = 1.0 / reference.ravel(), weight.ravel()
    node = np.arange(count).reshape(reference.shape)

    def add(places: list[NDArray[np.int64]], factors: tuple[float, ...], strength: float) -> None:
        flat = [place.ravel() for place in places]
        least = strength * np.minimum.reduce([cost[place] for place in flat])
        for first in range(len(flat)):
            for second in range(first, len(flat)):
                a, b = flat[first], flat[second]
                band[a, b - a] += least * factors[first] * factors[second] * inverse[a] * inverse[b]

    add([node[:-2], node[1:-1], node[2:]], (1.0, -2.0, 1.0), strength_h)
    if nodes_d > 1:
        add([node[:, :-1], node[:, 1:]], (-1.0, 1.0), slope_d)
    if nodes_d > 2:
        add([node[:, :-2], node[:, 1:-1], node[:, 2:]], (1.0, -2.0, 1.0), strength_d)
    return band


def total(*bands: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sum of bands of different width."""
    widest = np.zeros((len(bands[0]), max(band.shape[1] for band in bands)))
    for band in bands:
        widest[:, : band.shape[1]] += band
    widest[:, 0] += OWN * widest[:, 0].max()
    return widest


def value(band: NDArray[np.float64], moments: NDArray[np.float64], x: NDArray[np.float64]) -> float:
    """Return x.A x / 2 - b.x."""
    return float(0.5 * x @ multiply(band, x) - moments @ x)


@kernel
def multiply(band: NDArray[np.float64], x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return A x."""
    count, width = band.shape
    out = np.zeros(count)
    for i in range(count):
        out[i] += band[i, 0] * x[i]
        for d in range(1, min(width, count - i)):
            out[i] += band[i, d] * x[i + d]
            out[i + d] += band[i, d] * x[i]
    return out


@kernel
def _factorise(band: NDArray[np.float64]) -> None:
    """Turn a positive definite band A into U with A = U^T U, in place.

    Small bands: the library's routine spends its time on waking threads.
    """
    count, width = band.shape
    for i in range(count):
        band[i] /= math.sqrt(band[i, 0])
        reach = min(width, count - i)
        for d in range(1, reach):
            for e in range(d, reach):
                band[i + d, e - d] -= band[i, d] * band[i, e]


@kernel
def _substitute(factor: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return A^-1 b from the factor U."""
    count, width = factor.shape
    x = right.copy()
    for i in range(count):
        x[i] /= factor[i, 0]
        for d in range(1, min(width, count - i)):
            x[i + d] -= factor[i, d] * x[i]
    for i in range(count - 1, -1, -1):
        for d in range(1, min(width, count - i)):
            x[i] -= factor[i, d] * x[i + d]
        x[i] /= factor[i, 0]
    return x


def minimise(band: NDArray[np.float64], moments: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float64]:
    """Minimise x.A x / 2 - b.x over tables that are non-negative and do not rise with theta_h.

    Parameters
    ----------
    band : (N, W) float64
        A, positive definite.
    moments : (N,) float64
        b.
    shape : TH, TD K
        N is their product; the constraint runs along the first.

    Returns
    -------
    x : (N,) float64
        Feasible exactly.
    """
    stride = shape[1]
    size = 1.0 / np.sqrt(band[:, 0])

    x = np.repeat(np.linspace(1.1, 1.0, shape[0]), stride) * float(np.median(np.maximum(moments * size**2, 1e-12)))
    slack = np.maximum(_falls(x, stride), 1e-3 * x)
    dual = max(1e-3 * abs(float(moments @ x)) / x.size, 1e-300) / slack
    for _ in range(MOST_STEPS):
        unmet = multiply(band, x) - moments - _falls_transposed(dual, stride)
        off = _falls(x, stride) - slack
        gap = float(slack @ dual)
        worth = abs(float(moments @ x)) + 1e-300
        if gap < CLOSE * worth and abs(float(unmet @ x)) < CLOSE * worth:
            break
        system = _System(band, slack, dual, stride)
        _, ds, dz = system.step(unmet, off, slack * dual)
        after = float((slack + _room(slack, ds) * ds) @ (dual + _room(dual, dz) * dz))
        centring = (after / gap) ** 3 * gap / x.size
        dx, ds, dz = system.step(unmet, off, slack * dual + ds * dz - centring)
        length = INWARDS * min(_room(slack, ds), _room(dual, dz))
        x, slack, dual = x + length * dx, slack + length * ds, dual + length * dz
    return _feasible(x, shape)


def _falls(x: NDArray[np.float64], stride: int) -> NDArray[np.float64]:
    """Return D x: by how much each node lies above the next along theta_h, the last one above 0."""
    y = x.copy()
    y[:-stride] -= x[stride:]
    return y


def _falls_transposed(z: NDArray[np.float64], stride: int) -> NDArray[np.float64]:
    """Return D^T z."""
    y = z.copy()
    y[stride:] -= z[:-stride]
    return y


class _System:
    """The linear system of one interior point: A + D^T diag(dual / slack) D, balanced to a unit diagonal."""

    def __init__(
        self, band: NDArray[np.float64], slack: NDArray[np.float64], dual: NDArray[np.float64], stride: int
    ) -> None:
        self.slack, self.dual, self.stride = slack, dual, stride
        pressure = dual / slack
        matrix = total(band, np.zeros((len(band), stride + 1)))
        matrix[:, 0] += pressure
        matrix[stride:, 0] += pressure[:-stride]
        matrix[:-stride, stride] -= pressure[:-stride]
        self.balance = 1.0 / np.sqrt(matrix[:, 0])
        padded = np.concatenate([self.balance, np.zeros(matrix.shape[1])])
        for offset in range(matrix.shape[1]):
            matrix[:, offset] *= self.balance * padded[offset : offset + len(matrix)]
        matrix[:, 0] = 1.0 + 1e-13
        _factorise(matrix)
        self.factor = matrix

    def step(
        self, unmet: NDArray[np.float64], off: NDArray[np.float64], complement: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the changes of x, slack and dual that meet the linearised conditions."""
        right = _falls_transposed((-complement - self.dual * off) / self.slack, self.stride) - unmet
        dx = self.balance * _substitute(self.factor, self.balance * right)
        ds = _falls(dx, self.stride) + off
        return dx, ds, (-complement - self.dual * ds) / self.slack


def _room(values: NDArray[np.float64], change: NDArray[np.float64]) -> float:
    """Return the largest step up to 1 that keeps positive values positive."""
    falling = change < 0
    return min(1.0, float((-values[falling] / change[falling]).min())) if falling.any() else 1.0


def _feasible(x: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return the table with the rest of rounding taken off: non-negative, not rising with theta_h."""
    rows = np.maximum(x, 0.0).reshape(shape)
    return np.asarray(np.maximum.accumulate(rows[::-1], axis=0)[::-1].ravel())
