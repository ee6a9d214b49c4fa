"""A triangulated surface over the pixels, by successive linearisation and conjugate gradients.

Its vertices are the pixels' points, its unknown u is the logarithm of the length of a pinhole camera's rays, or the
length of an orthographic one's. Minimised is, over facets f and vertices p, ::

    sum_f |N_f(u) - m_f|^2 + lambda sum_p (Laplacian u)_p^2

with a facet's normal N and the mean m of the normals of its three vertices. N is linear in u but for its length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ...tangents import neighbour_pairs
from ..pictures import Pictures

Array = NDArray[np.float64]

STEPS, HALVINGS = 4, 6  # linearisations at a time, and halvings of a step that does not lower the sum
ITERATIONS = 200  # of conjugate gradients
RIDGE = 1e-9


@dataclass(frozen=True)
class Surface:
    """The triangles over the P pixels of some pictures.

    Parameters
    ----------
    origins, rays : (P, 3) float64
    pinhole : bool
    facets : (F, 3) int
        Vertices, so that the normal looks to the camera.
    laplacian : (P, P) sparse
        A pixel's unknown less the mean of its four neighbours', in pixels; nothing where it lacks one.
    smoothness : float
        lambda.
    """

    origins: Array
    rays: Array
    pinhole: bool
    facets: NDArray[np.int64]
    laplacian: sparse.csr_array
    smoothness: float

    def points(self, unknown: Array) -> Array:
        """Return the vertices (P, 3), camera space."""
        length = np.exp(unknown) if self.pinhole else unknown
        return np.asarray(self.origins + length[:, None] * self.rays)

    def normals(self, unknown: Array) -> Array:
        """Return the facets' unit normals (F, 3)."""
        area = self._areas(self.points(unknown))
        return np.asarray(area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300))

    def cost(self, unknown: Array, normals: Array) -> float:
        """Return what is minimised, for the vertices' normals (P, 3)."""
        apart = self.normals(unknown)[:, None] - normals[self.facets]
        return float((apart**2).sum() / 3.0 + self.smoothness * ((self.laplacian @ unknown) ** 2).sum())

    def pulls(self, unknown: Array) -> Array:
        """Return (P, 3): the cost changes with a vertex's normal as -2 n . pull."""
        pull, own = np.zeros((len(self.rays), 3)), self.normals(unknown) / 3.0
        for corner in self.facets.T:
            np.add.at(pull, corner, own)
        return pull

    def fitted(self, unknown: Array, normals: Array) -> Array:
        """Return the unknowns (P,) after some linearised steps, none of which raises the cost."""
        cost = self.cost(unknown, normals)
        for _ in range(STEPS):
            step, share = self._step(unknown, normals), 1.0
            for _ in range(HALVINGS):
                after = self.cost(unknown + share * step, normals)
                if after < cost:
                    unknown, cost = unknown + share * step, after
                    break
                share /= 2.0
            else:
                break
        return unknown

    def _step(self, unknown: Array, normals: Array) -> Array:
        points = self.points(unknown)
        area = self._areas(points)
        length = np.maximum(np.linalg.norm(area, axis=1), 1e-300)[:, None]
        unit = area / length
        along = self.rays * (np.exp(unknown)[:, None] if self.pinhole else 1.0)
        entries = []
        for corner in range(3):
            across = points[self.facets[:, (corner + 2) % 3]] - points[self.facets[:, (corner + 1) % 3]]
            change = np.cross(across, along[self.facets[:, corner]])
            entries.append((change - (change * unit).sum(axis=1, keepdims=True) * unit) / length)
        rows = np.repeat(np.arange(3 * len(self.facets)), 3)
        columns = np.repeat(self.facets, 3, axis=0).ravel()
        slope = sparse.csr_array(
            (np.stack(entries, axis=2).ravel(), (rows, columns)), shape=(len(rows) // 3, len(unknown))
        )
        off = (unit - normals[self.facets].mean(axis=1)).ravel()
        rough = self.smoothness * self.laplacian.T
        system = (slope.T @ slope + rough @ self.laplacian).tocsr()
        diagonal = system.diagonal()
        system = system + sparse.diags_array(np.full(len(unknown), RIDGE * diagonal.max()))
        right = -(slope.T @ off) - rough @ (self.laplacian @ unknown)
        scale = sparse.diags_array(1.0 / (diagonal + RIDGE * diagonal.max()))
        return np.asarray(sparse.linalg.cg(system, right, rtol=1e-4, maxiter=ITERATIONS, M=scale)[0])

    def _areas(self, points: Array) -> Array:
        a, b, c = points[self.facets].swapaxes(0, 1)
        return np.cross(b - a, c - a)


def triangulated(pictures: Pictures, smoothness: float) -> Surface:
    """Return two triangles over every four pixels that are neighbours, and one where one of the four is missing."""
    pixels = len(pictures.values)
    number = np.full(pictures.mask.shape, -1)
    number[pictures.mask] = np.arange(pixels)
    one, two, three, four = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    whole = [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((one, three, two), (two, three, four))]
    halves = [np.stack((one, four, two), axis=-1)[three < 0], np.stack((one, three, four), axis=-1)[two < 0]]
    facets = np.concatenate(whole + halves)
    pairs = np.concatenate(neighbour_pairs(pictures.mask))
    around = sparse.coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(pixels, pixels))
    around = (around + around.T).tocsr()
    inner = (around.sum(axis=1) == 4) * pictures.camera.focal[0]
    laplacian = sparse.diags_array(inner) @ (sparse.eye_array(pixels) - around / 4.0)
    return Surface(
        pictures.rays[:, :3],
        pictures.rays[:, 3:],
        pictures.pinhole,
        facets[(facets >= 0).all(axis=1)],
        laplacian.tocsr(),
        smoothness,
    )
