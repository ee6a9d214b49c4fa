"""The start of the alternation: every pixel by itself, as a diffuse and one glossy lobe.

Every roughness of a short list is tried from two normals: the robust Lambertian one and, since a mirror has
no other, the half-way vector of the brightest lights. The lobe is ``D(theta_h) / (4 cos(theta_d)^2)`` with the GGX
distribution D (Walter et al. 2007) and the shadowing of Kelemen and Szirmay-Kalos (2001): a bivariate BRDF.

The source's own start is there to compare with: the azimuth about which the pictures are symmetric, where that can be
trusted, and the slant of the Lambertian normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from ...progress import Progress, Work
from ...reflectance.angles import difference_angles, half_angles
from ..symmetry import azimuth, frames
from . import lambertian
from .foreseen import noise_of
from .pixel import misfit, refine, settle
from .sight import TINY, Sight

ALPHAS = (0.04, 0.1, 0.2, 0.35, 0.6)
STEPS = 4
NODES = (90, 16)
BRIGHTEST = 3  # lights whose half-way vectors are taken
WIDTH = 0.07  # relative misfit at which a value counts half
SEEN_AT = np.radians([0.0, 4.0, 8.0, 15.0, 30.0, 55.0])  # theta_h at which pixels are told apart
FLOOR = 0.02
TRUSTED = 0.3  # trust in the symmetry from which its azimuth is tried
MATT = np.full((2, 1, 1, 1), 1 / np.pi)


@dataclass(frozen=True)
class Start:
    """Normals and, for telling materials apart, the reflectance of every pixel.

    Parameters
    ----------
    lambert : (P, 3) float64
        Unit normals of the robust Lambertian fit; NaN where it has none.
    normals : (P, 3) float64
        Unit normals of the fit with a lobe; along the view where nothing was seen.
    certainty : (P, L) float32
    misfit : (P,) float64
        How badly the fit explains the pixel, 0 to 1 (:func:`.pixel.misfit`).
    albedo : (P,) float64
        Strength of both lobes together, mean of the colours.
    features : (P, 18) float64
        Log of the pixel's reflectance over its albedo at six half angles, three colours.
    """

    lambert: NDArray[np.float64]
    normals: NDArray[np.float64]
    certainty: NDArray[np.float32]
    misfit: NDArray[np.float64]
    albedo: NDArray[np.float64]
    features: NDArray[np.float64]


def begin(sight: Sight, known: NDArray[np.float64] | None = None, by_symmetry: bool = False) -> Work[Start]:
    """Fit a diffuse and one glossy lobe to every pixel, to known normals (P, 3) where they are given."""
    b = lambertian.robust(sight)
    length = np.linalg.norm(b, axis=1, keepdims=True)
    lambert = np.where(length > 0, b / np.maximum(length, 1e-30), np.nan)
    scale = sight.scale()
    pixels = len(lambert)
    steps = STEPS if known is None else 0
    candidates = _candidates(sight, b, scale, known, by_symmetry)
    unshadowed = candidates[0][1]
    least, chosen = np.full(pixels, np.inf), np.zeros(pixels, np.int64)
    normals, weights = np.empty((pixels, 3)), np.empty((pixels, 2, 3))
    for number, alpha in enumerate(ALPHAS):
        table = lobes(alpha)
        for candidate, certainty in candidates:
            tried, found = candidate.copy(), np.empty((pixels, 2, 3))
            left, stiffness = np.empty(pixels), np.empty(pixels)
            refine(*_geometry(sight), sight.values, certainty, table, steps, tried, found, left, stiffness)
            misfit(*_geometry(sight), sight.values, sight.usable, scale, table, tried, found, WIDTH, left)
            better = left < least
            least[better], chosen[better] = left[better], number
            normals[better], weights[better] = tried[better], found[better]
        yield Progress("start", number + 1, len(ALPHAS) + 1, "roughnesses")
    certainty = unshadowed
    albedo, features = np.empty(pixels), np.empty((pixels, 3 * len(SEEN_AT)))
    for number, alpha in enumerate(ALPHAS):
        own = np.flatnonzero(chosen == number)
        part, table = sight.select(own), lobes(alpha)
        n, w, left, trust = normals[own], weights[own], np.empty(len(own)), np.empty(part.usable.shape, np.float32)
        for _ in range(2):
            settle(*_geometry(part), part.values, part.usable, scale[own], table, n, w, WIDTH, trust)
            refine(*_geometry(part), part.values, trust, table, steps, n, w, left, np.empty(len(own)))
        misfit(*_geometry(part), part.values, part.usable, scale[own], table, n, w, WIDTH, left)
        normals[own], certainty[own], least[own] = n, trust, left
        gloss = _distribution(np.cos(SEEN_AT), alpha) / 4
        curve = w[:, :1] / np.pi + w[:, 1:] * gloss[None, :, None]
        albedo[own] = np.maximum(w.mean(axis=2).sum(axis=1), TINY)
        features[own] = np.log(np.pi * curve / albedo[own, None, None] + FLOOR).reshape(len(own), features.shape[1])
    yield Progress("start", len(ALPHAS) + 1, len(ALPHAS) + 1, "roughnesses")
    return Start(lambert, normals, certainty, least, albedo, features)


def _candidates(
    sight: Sight,
    b: NDArray[np.float64],
    scale: NDArray[np.float64],
    known: NDArray[np.float64] | None,
    by_symmetry: bool,
) -> list[tuple[NDArray[np.float64], NDArray[np.float32]]]:
    """Return the normals (P, 3) to start from, each with a certainty (P, L) of the values."""
    evenly = sight.usable / noise_of.py_func(sight.values.mean(axis=2) / scale[:, None]) / scale[:, None] ** 2
    length = np.linalg.norm(b, axis=1, keepdims=True)
    smooth = seen_from(np.where(length > 0, b / np.maximum(length, TINY), sight.views), sight)
    matt = np.repeat(np.linalg.norm(np.nan_to_num(b), axis=1)[:, None, None], 3, axis=2) * np.pi
    unshadowed = np.empty(evenly.shape, np.float32)
    settle(*_geometry(sight), sight.values, sight.usable, scale, MATT, smooth, matt, 0.0, unshadowed)
    if known is not None:
        return [(known, unshadowed), (known, evenly.astype(np.float32))]
    if by_symmetry and not sight.near:
        return [(_symmetric(sight, smooth), unshadowed)]
    return [(smooth, unshadowed), (half_way(sight), evenly.astype(np.float32))]


def _symmetric(sight: Sight, smooth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normals with the azimuth of the pictures' symmetry, where that can be trusted."""
    angle, trust = azimuth(sight.values.mean(axis=2), sight.lights, sight.views)
    cosine = (smooth * sight.views).sum(axis=1)
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
    turned = np.stack([sine * np.cos(angle), sine * np.sin(angle), cosine], axis=-1)
    normals = np.einsum("pij,pj->pi", frames(sight.views), turned)
    return np.ascontiguousarray(np.where(trust[:, None] > TRUSTED, normals, smooth))


def clusters(features: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Return which of at most so many materials each pixel looks like, (P,), by k-means."""
    if len(features) <= count:
        return np.zeros(len(features), np.int64)
    _, owner = kmeans2(features, count, iter=30, minit="++", rng=np.random.default_rng(0))
    return np.asarray(np.unique(owner, return_inverse=True)[1], np.int64)


def lobes(alpha: float) -> NDArray[np.float64]:
    """Return the table (TH, TD, 2, 1) of the diffuse BRDF 1 / pi and of a glossy lobe of unit strength."""
    gloss = _distribution(np.cos(half_angles(NODES[0])), alpha)[:, None]
    gloss = gloss / (4 * np.maximum(np.cos(difference_angles(NODES[1])), 0.05) ** 2)
    return np.stack([np.full(gloss.shape, 1 / np.pi), gloss], axis=-1)[..., None]


def _distribution(cosine: NDArray[np.float64], alpha: float) -> NDArray[np.float64]:
    return np.asarray(alpha**2 / (np.pi * (cosine**2 * (alpha**2 - 1) + 1) ** 2))


def half_way(sight: Sight) -> NDArray[np.float64]:
    """Return the mean half-way vector (P, 3), unit, of each pixel's brightest lights; saturated ones count, too."""
    gray = sight.values.mean(axis=2)
    last = np.argsort(gray, axis=1)[:, -BRIGHTEST:]
    to_light = sight.lights[last] - (sight.points[:, None] if sight.near else 0.0)
    to_light /= np.linalg.norm(to_light, axis=2, keepdims=True)
    half = to_light + sight.views[:, None]
    half /= np.maximum(np.linalg.norm(half, axis=2, keepdims=True), 1e-12)
    mean = (half * np.take_along_axis(gray, last, axis=1)[..., None] ** 2).sum(axis=1)
    return seen_from(np.where(np.linalg.norm(mean, axis=1, keepdims=True) > 0, mean, sight.views), sight)


def seen_from(normals: NDArray[np.float64], sight: Sight, least: float = 0.05) -> NDArray[np.float64]:
    """Return the normals, unit, bent towards the camera where they face away from it."""
    along = (normals * sight.views).sum(axis=1, keepdims=True)
    bent = normals + np.maximum(least - along, 0.0) * sight.views
    return np.asarray(bent / np.linalg.norm(bent, axis=1, keepdims=True))


def _geometry(sight: Sight) -> tuple[NDArray[np.float64], bool, NDArray[np.float64], NDArray[np.float64]]:
    return sight.lights, sight.near, sight.points, sight.views
