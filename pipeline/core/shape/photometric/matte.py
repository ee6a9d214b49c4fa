"""Whether a matte surface explains the pictures: then richer models only follow the noise.

What a Lambertian surface leaves of the pictures is, where the object is one, noise: it differs from pixel to pixel.
Highlights, cast shadows and interreflections leave something that neighbouring pixels share. So the correlation of
the residuals r of neighbours p, q under the same light tells, with no knowledge of how strong the noise is::

    rho = sum_pq r_p r_q / sqrt(sum_pq r_p^2 sum_pq r_q^2)

Not modelled: noise that neighbours share (demosaicing, compression), which looks like structure; the richer model is
then taken, as always before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .sight import Sight

SHARED = 0.2  # correlation of neighbours above which the residual is not noise
EXACT = 1e-5  # of a pixel's albedo: what the rounding of float32 pictures leaves
FEWEST = 50  # pairs of values that can tell
FLAT = 0.1  # cosine below which light is too weak to tell


def deviation(sight: Sight, b: NDArray[np.float64], mask: NDArray[np.bool_]) -> NDArray[np.float64] | None:
    """Return the standard deviation of the normals (P,) [rad] where a matte surface explains the pictures, else None.

    It does where all that it leaves unexplained is noise. That noise s, alike in all values, moves n across itself by
    ``s / |b| sqrt(trace of the part of (D^T D)^-1 across n)``, D the directions of the lights that tell.

    Parameters
    ----------
    sight : Sight
        Of the mask's P pixels.
    b : (P, 3) float64
        (albedo / pi) n; where one is NaN nothing is explained.
    mask : (H, W) bool
    """
    size = np.linalg.norm(b, axis=1)
    if not (size > 0).all():
        return None
    p, q = neighbours(mask)
    sums, pairs, largest = np.zeros(3), 0, 0.0
    for light in range(len(sight.lights)):
        towards, tells = _lit(sight, b, light)
        left = np.where(tells, sight.values[:, light].mean(axis=1) - (b * towards).sum(axis=1), 0.0)
        largest = max(largest, float(np.max(np.abs(left) / size, initial=0.0)))
        both = tells[p] & tells[q]
        first, second = left[p[both]], left[q[both]]
        sums += [first @ second, first @ first, second @ second]
        pairs += int(both.sum())
    shared = sums[0] >= SHARED * np.sqrt(sums[1] * sums[2])
    if pairs < FEWEST or (largest >= EXACT and shared):
        return None
    return _of_least_squares(sight, b, float(sums[1]) / pairs)


def _of_least_squares(sight: Sight, b: NDArray[np.float64], left: float) -> NDArray[np.float64]:
    """Return the deviation of the normals (P,) [rad] by the mean square that is left of the values."""
    size = np.linalg.norm(b, axis=1)
    equations = np.zeros((len(b), 3, 3))
    for light in range(len(sight.lights)):
        towards, tells = _lit(sight, b, light)
        equations += np.where(tells, 1.0, 0.0)[:, None, None] * towards[:, :, None] * towards[:, None, :]
    across = np.eye(3) - np.einsum("pi,pj->pij", b, b) / size[:, None, None] ** 2
    inverse = np.linalg.pinv(equations, hermitian=True)
    lights = np.trace(equations, axis1=1, axis2=2).mean()  # of unit length: how many tell
    noise = np.sqrt(left * lights / max(lights - 3, 1.0))
    return np.asarray(noise / size * np.sqrt(np.einsum("pij,pji->p", across, inverse)))


def _lit(sight: Sight, b: NDArray[np.float64], light: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the unit directions to a light (P, 3), and whether its value tells something of each pixel (P,)."""
    place = sight.lights[light]
    towards = place - sight.points if sight.near else np.broadcast_to(place, b.shape)
    towards = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    foreseen = (b * towards).sum(axis=1)
    return towards, (foreseen > FLAT * np.linalg.norm(b, axis=1)) & (sight.usable[:, light] > 0)


def neighbours(mask: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the pairs of a mask's pixels that lie beside or below each other, numbered as the mask lists them."""
    number = np.full(mask.shape, -1)
    number[mask] = np.arange(int(mask.sum()))
    beside = np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()])
    below = np.stack([number[:-1].ravel(), number[1:].ravel()])
    p, q = np.concatenate([beside, below], axis=1)
    both = (p >= 0) & (q >= 0)
    return p[both], q[both]
