"""Several exposures of one light merged into one picture of high dynamic range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FADE = (0.90, 0.98)  # stored values between which trust fades: cameras bend before they clip
SHOT_NOISE = 1e-4  # variance of a linear value of 1 by photon noise: a signal-to-noise ratio of 100 at full scale


def merge(
    linear: NDArray[np.float32],
    stored: NDArray[np.float32],
    rounding: NDArray[np.float32],
    seconds: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Merge exposures into the picture that the shortest one would be without noise and rounding.

    Each exposure's estimate of x, the value at the shortest time t_0, is z t_0 / t with the variance
    (r^2 + k x t / t_0) (t_0 / t)^2, r the rounding and k photon noise; the estimates are averaged with the inverse
    variances as weights, the x in them being a first such average (weights by observed noise: Granados et al.,
    "Optimal HDR reconstruction with linear digital cameras", 2010, eq. 6). Stored values near full scale fade out;
    where that leaves nothing, the shortest exposure stands. Moving objects and misaligned pictures are not modelled.

    Parameters
    ----------
    linear : (E, H, W, 3) float32
        Decoded exposures z.
    stored : (E, H, W, 3) float32
        The same before decoding, full scale being 1.
    rounding : (E, H, W, 3) float32
        Standard deviation of the rounding in the decoded values.
    seconds : (E,) float64
        Exposure times t [s].

    Returns
    -------
    (H, W, 3) float32
    """
    times = (seconds / seconds.min()).astype(np.float32)[:, None, None, None]
    trust = 1 - _smooth((stored - FADE[0]) / (FADE[1] - FADE[0]))
    shortest = linear[int(np.argmin(seconds))]
    merged = np.maximum(linear / times, 0)
    for _ in range(2):
        weight = trust * times**2 / (rounding**2 + SHOT_NOISE * np.maximum(merged * times, 0) + 1e-12)
        total = weight.sum(axis=0)
        mean = (weight * (linear / times)).sum(axis=0) / np.where(total > 0, total, 1)
        merged = np.where(total > 0, mean, shortest)
    return np.asarray(merged, np.float32)


def _smooth(x: NDArray[np.float32]) -> NDArray[np.float32]:
    x = np.clip(x, 0, 1)
    return np.asarray(x * x * (3 - 2 * x))
