"""What the albedo's being that of few paints says about the lights.

Of all that leaves a matt surface's pictures as they are, what shape itself hardly rules out is the generalised
bas-relief ambiguity: normals become n + (m . n) v with the view m and some v, albedos as much larger as that is longer,
lights the inverse of it. Where a body is painted in few colours, the right v is the one that leaves the albedos'
logarithms the least entropy (Alldrin, Mallick and Kriegman 2007). It is Parzen's estimate, of all three colours, so
that paints of other hues do not get in each other's way::

    E(v) = - sum_p log sum_q exp(-|u_p(v) - u_q(v)|^2 / (2 h^2)),  u_p(v) = log albedo_p + log |n_p + (m . n_p) v|

Paint that shades off along one hue can mislead: where the albedo goes with the slope, it passes for relief.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import prange
from numpy.typing import NDArray

from ...compiled import parallel_kernel

Array = NDArray[np.float64]

KERNELS = (0.2, 0.1, 0.05)  # h, one after the other
STEPS, HALVINGS = 5, 3  # with each, at most; how often a step that does not help is halved
FARTHEST = 0.3  # of a step
PIXELS, FEWEST = 800, 60  # so many are compared at most, and so many at least
DARK = 0.1  # of the median albedo; what is darker is told too badly
MATT = 0.5  # of a pixel's usual value; where its albedo is less, its light is that of lobes
FAR = 4.5  # kernels' widths beyond which pixels do not see each other
CERTAIN = 1e-6  # of the largest information; what is below is not told


@dataclass(frozen=True)
class Relief:
    """A bas-relief transformation.

    Parameters
    ----------
    view, change : (3,) float64
        m and v.
    curvature : (3, 3) float64
        Of E there, over the square of:
    albedos : float
        How many a hue then has: e to the entropy of the albedos less that of their hues.
    """

    view: Array
    change: Array
    curvature: Array
    albedos: float

    def cue(self, lights: Array) -> tuple[Array, Array]:
        """Return equations ``matrix @ s = target`` in the lights s (3 L,), of unit variance each.

        Parameters
        ----------
        lights : (L, 3) float64
            Those that belong to the normals as they were.
        """
        value, vector = np.linalg.eigh(self.curvature)
        told = value > CERTAIN * max(value[-1], 1.0)
        root = (vector[:, told] * np.sqrt(value[told])).T
        # S' = S (1 + v m^T)^-1 = S (1 - x m^T) with x = v / (1 + m . v), but for a scale, which is open
        back, view = np.linalg.pinv(lights), self.view
        across = back.T - np.outer(view @ back, view)
        change = 0.5 * view[:, None, None] * across - back[:, :, None] * view
        matrix = root @ change.reshape(3, -1)
        return matrix, root @ self.change / (1.0 + view @ self.change) + matrix @ lights.ravel()


def least_entropy(colours: Array, usual: Array, normals: Array, views: Array) -> Relief | None:
    """Return the change of the least entropy that a descent from none finds, or None where too few pixels are matt.

    Parameters
    ----------
    colours, usual : (P, 3), (P,) float64
        Albedos, and usual values under lights whose usual strength is 1.
    normals, views : (P, 3) float64
        Unit, camera space.
    """
    bright = colours.mean(axis=1)
    kept = np.flatnonzero((bright > np.maximum(DARK * np.median(bright), MATT * usual)) & (colours > 0).all(axis=1))
    if len(kept) < FEWEST:
        return None
    few = kept[:: -(-len(kept) // PIXELS)]
    view = views.mean(axis=0) / np.linalg.norm(views.mean(axis=0))
    logarithms, turned, change = np.log(colours[few]), normals[few] @ view, np.zeros(3)
    for width in KERNELS:
        least, slope, curvature = entropy(logarithms, normals[few], turned, change, width)
        for _ in range(STEPS):
            step = _downhill(slope, curvature)
            for _ in range(HALVINGS):
                tried = entropy(logarithms, normals[few], turned, change + step, width)
                if tried[0] < least:
                    break
                step = step / 2
            else:
                break
            change, (least, slope, curvature) = change + step, tried
    hues = logarithms - logarithms.mean(axis=1, keepdims=True)
    albedos = float(np.exp((least - entropy(hues, normals[few], turned, np.zeros(3), KERNELS[-1])[0]) / len(few)))
    return Relief(view, change, curvature * len(kept) / len(few) / albedos**2, albedos)


def _downhill(slope: Array, curvature: Array) -> Array:
    """Return Newton's step, downhill also where the curvature is negative, but no longer than :data:`FARTHEST`."""
    value, vector = np.linalg.eigh(curvature)
    value = np.abs(value)
    step = -vector @ (vector.T @ slope / np.maximum(value, CERTAIN * max(value.max(), 1.0)))
    return np.asarray(step * min(1.0, FARTHEST / max(np.linalg.norm(step), 1e-12)))


def entropy(
    logarithms: Array, normals: Array, turned: Array, change: Array, width: float
) -> tuple[float, Array, Array]:
    """Return E, its slope (3,), and its second derivatives (3, 3) as far as the logarithms are linear in v.

    Parameters
    ----------
    logarithms, normals, turned : (P, 3), (P, 3), (P,) float64
        Of the albedos, unit, and m . n.
    change : (3,) float64
        v.
    width : float
        h.
    """
    moved = normals + turned[:, None] * change
    squared = (moved**2).sum(axis=1, keepdims=True)
    found = np.zeros((len(normals), 13))
    _entropies(
        np.ascontiguousarray((logarithms + 0.5 * np.log(squared)) / width),
        np.ascontiguousarray(turned[:, None] * moved / squared / width),
        found,
    )
    total = found.sum(axis=0)
    return float(total[0]), total[1:4], total[4:].reshape(3, 3)


@parallel_kernel
def _entropies(colours: Array, slopes: Array, found: Array) -> None:
    """Fill in every pixel's part of E, its slope and its curvature (P, 13), in units of the kernel's width.

    Of -log sum exp(-f) they are the mean of f' and that of f'' less the variance of f'.
    """
    for p in prange(len(colours)):
        total, apart = 0.0, np.empty(3)
        mean, square = np.zeros(3), np.zeros((3, 3))
        for q in range(len(colours)):
            squared, along = 0.0, 0.0
            for c in range(3):
                off = colours[p, c] - colours[q, c]
                squared += off * off
                along += off
            if squared > FAR**2:
                continue
            weight = np.exp(-0.5 * squared)
            total += weight
            for i in range(3):
                apart[i] = slopes[p, i] - slopes[q, i]
                mean[i] += weight * along * apart[i]
                for j in range(i + 1):
                    square[i, j] += weight * (3.0 - along * along) * apart[i] * apart[j]
        found[p, 0] = -np.log(total)
        for i in range(3):
            found[p, 1 + i] = mean[i] / total
            for j in range(3):
                found[p, 4 + 3 * i + j] = square[max(i, j), min(i, j)] / total + mean[i] * mean[j] / total**2
