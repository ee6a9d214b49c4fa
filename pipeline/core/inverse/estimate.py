"""Estimates from renders that are noisy: two seeds are each other's instrument.

Least squares on noisy basis pictures is biased (errors in variables): noise adds to A^T A. Two renders A1, A2 of the
same with other seeds have independent noise, and ::

    x = [ (A1^T W A2 + A2^T W A1) / 2 ]^-1  (A1^T W y2 + A2^T W y1) / 2

has none in the mean. The error of a model is the mean of r1 r2, the product of both seeds' residuals: render noise does
not count, and where the model is right it is 0 in the mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

Array = NDArray[np.float64]
AGREEING = 0.03  # correlation of two seeds' pictures, above which they are more than noise
SURE = 2.5  # standard deviations
SINGULAR = 1e-9  # of the largest eigenvalue of scaled normal equations


@dataclass(frozen=True)
class Fit:
    """What a linear model of basis pictures explains.

    Parameters
    ----------
    factors : (N, 3) float64
        Of the basis pictures, per colour.
    error : float
        Mean square of the weighted residual, see :func:`unexplained`.
    noise : float
        Its standard deviation.
    """

    factors: Array
    error: float
    noise: float

    @property
    def surely_below(self) -> float:
        """What the error is below, noise considered: an error that is mostly noise is no small one."""
        return self.error + SURE * self.noise


def unexplained(residuals: Array, weight: Array) -> tuple[float, float]:
    """Return the mean square of weighted residuals without what render noise adds, and its standard deviation.

    The mean of the product of both seeds' residuals; negative where noise says so. Its variance is that of render noise
    alone, s^4 + 2 m^2 s^2 a pixel of noise s and true residual m: where a model is wrong in a few pixels only it is
    wrong all the same. A pixel's two seeds tell s^2, but not s^4: squared, they say thrice too much of it by Gaussian
    noise, and anything by fireflies. The next pixel has noise of its own that is alike.

    Parameters
    ----------
    residuals : (2, P, 3) float64
        Of pixels in the picture's order.
    weight : (P, 3) float64
    """
    products = (weight * residuals[0] * residuals[1]).mean(axis=1)
    noise = (weight * (residuals[0] - residuals[1]) ** 2).mean(axis=1) / 2
    beside = np.roll(noise, 1)
    variance = float(noise @ beside) + 2 * max(float(products @ beside), 0.0)
    return float(products.mean()), float(np.sqrt(variance)) / len(products)


def structured(residuals: Array, mask: NDArray[np.bool_]) -> float:
    """Return the mean product of what one seed leaves in a pixel and the other in the next one, in a mask (H, W).

    What is wrong reaches over neighbours, and noise does not: the photograph's own, too, which both seeds' residuals
    (2, H, W, 3) share in one pixel. Of a mask without neighbours, the mean product in its pixels.
    """
    first, second = residuals
    found = [np.zeros((0, 3))]
    for here, there in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        both = mask[here] & mask[there]
        found.append((first[here] * second[there] + second[here] * first[there])[both] / 2)
    products = np.concatenate(found)
    return float((products if len(products) else (first * second)[mask]).mean())


def fitting(shown: Array, wanted: Array, weight: Array) -> Array:
    """Return by what pixels (P, 3) are to be multiplied, per colour, to be wanted ones, (3,), by least squares."""
    power = (weight * shown**2).sum(axis=0)
    return np.asarray((weight * shown * wanted).sum(axis=0) / np.maximum(power, 1e-30))


def noiseless_rmse(residuals: Array, photograph: Array, used: NDArray[np.bool_]) -> float:
    """Return the root mean square of residuals by two seeds (2, H, W, 3) over the photograph's, render noise taken off.

    The photograph's own noise counts. Where noise says that nothing is wrong, 0.
    """
    mean_square = (residuals[0] * residuals[1])[used].mean()
    return float(np.sqrt(max(mean_square, 0.0) / (photograph[used] ** 2).mean()))


def agreed(first: Array, second: Array, weight: Array) -> NDArray[np.bool_]:
    """Return which of some pictures by two seeds (N, P) are more than noise, (N,).

    Those whose seeds correlate, be it in a few bright pixels, and those whose faint agreement is spread over so many
    pixels that it is no chance.

    Parameters
    ----------
    first, second : (N, P) float64
    weight : (P,) float64
    """
    products = first * second * weight
    power = np.sqrt((first**2 * weight).sum(axis=1) * (second**2 * weight).sum(axis=1))
    chance = np.sqrt((products**2).sum(axis=1))
    total = products.sum(axis=1)
    return np.asarray((total > AGREEING * power) | (total > SURE * chance))


def combined(bases: Array, photograph: Array, weight: Array) -> Fit:
    """Fit a photograph by basis pictures of two seeds, with factors that are not negative.

    What both seeds do not agree on is nothing that a photograph can tell, and has the factor 0: a mirror's picture of a
    lamp without size is all noise.

    Parameters
    ----------
    bases : (2, N, P, 3) float64
        Two seeds of N pictures.
    photograph : (P, 3) or (2, P, 3) float64
        Less what each seed shows beside the bases, if it does.
    weight : (P, 3) float64
    """
    factors = np.zeros((bases.shape[1], 3))
    wanted = np.broadcast_to(photograph, bases[:, 0].shape)
    for colour in range(3):
        first, second = bases[0, :, :, colour], bases[1, :, :, colour]
        y, w = wanted[..., colour], weight[:, colour]
        normal = (first * w) @ second.T
        right = (first * w) @ y[1] + (second * w) @ y[0]
        told = np.flatnonzero(agreed(first, second, w))
        symmetric = ((normal + normal.T) / 2)[np.ix_(told, told)]
        factors[told, colour] = _non_negative(symmetric, right[told] / 2)
    residuals = wanted - np.einsum("snpc,nc->spc", bases, factors)
    return Fit(factors, *unexplained(residuals, weight))


def _non_negative(normal: Array, right: Array) -> Array:
    """Solve normal x = right for x >= 0 of one or two unknowns, by trying which are 0."""
    best, least = np.zeros(len(right)), 0.0
    for chosen in range(1, 2 ** len(right)):
        kept = [i for i in range(len(right)) if chosen >> i & 1]
        part = normal[np.ix_(kept, kept)]
        if np.linalg.cond(part) > 1e12:
            continue
        x = np.linalg.solve(part, right[kept])
        if (x < 0).any():
            continue
        value = float(x @ part @ x - 2 * right[kept] @ x)
        if value < least:
            least = value
            best = np.zeros(len(right))
            best[kept] = x
    return best


def better(simple: Fit, rich: Fit, worth: float) -> bool:
    """Return whether a richer model explains more than render noise does, and by more than a worth (mean square)."""
    return simple.error - rich.error > max(SURE * float(np.hypot(simple.noise, rich.noise)), worth)


def normal_equations(jacobians: Array, weight: Array) -> Array:
    """Return J^T W J (U, U) of derivatives by two seeds (2, U, N), of either with the other's."""
    normal = (jacobians[0] * weight) @ jacobians[1].T
    return np.asarray((normal + normal.T) / 2)


def _bounded(normal: Array, right: Array, low: Array, high: Array) -> Array:
    """Return the solution of normal equations within bounds, by bounded least squares (Stark and Parker 1995)."""
    size = np.sqrt(np.diag(normal))
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    root = np.sqrt(np.maximum(values, SINGULAR * values.max()))  # two seeds' noise may make one negative
    ends = low * size, high * size
    found = lsq_linear(root[:, None] * vectors.T, vectors.T @ (right / size) / root, ends, method="bvls")
    return np.asarray(found.x / size)


def newton(
    jacobians: Array,
    residuals: Array,
    weight: Array,
    damping: float = 1e-3,
    same_seeds: bool = False,
    bounds: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """Return a Gauss-Newton step and its standard deviation that render noise causes.

    Parameters
    ----------
    jacobians : (2, U, N) float64
        Derivatives of N values by U unknowns, by two seeds.
    residuals : (2, N) float64
        Photograph less render, by two other seeds, or the same: then each seed's derivatives meet the other's residual.
    weight : (N,) float64
    damping : float
        Share of the diagonal that is added.
    bounds : ((U,), (U,)) float64, optional
        Least and largest steps. What is held at one is no unknown any more: others must not move as if it had gone on.

    Returns
    -------
    (U,), (U,) float64
        An unknown whose derivatives are noise stays as it is, and has the deviation 1.
    """
    told = agreed(jacobians[0], jacobians[1], weight)
    step, deviation = np.zeros(len(told)), np.ones(len(told))
    first, second = jacobians = jacobians[:, told]
    normal = normal_equations(jacobians, weight)
    scale = np.maximum(np.diag(normal), 1e-30 + 1e-9 * np.abs(np.diag(normal)).max())
    normal = normal + np.diag(damping * scale)
    mean = (first + second) / 2
    if same_seeds:
        right = ((first * weight) @ residuals[1] + (second * weight) @ residuals[0]) / 2
    else:
        right = (mean * weight) @ residuals.mean(axis=0)
    if bounds is None:
        step[told] = np.linalg.solve(normal, right)
    elif told.any():
        step[told] = _bounded(normal, right, bounds[0][told], bounds[1][told])
    spread = np.linalg.solve(normal, mean * (weight * (residuals[0] - residuals[1]) / 2))
    deviation[told] = np.sqrt((spread**2).sum(axis=1))
    return step, deviation
