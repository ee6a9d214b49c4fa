"""The outline of a sphere: the circle about its mask, or the one that stands out in its pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..errors import LightsphereError

TRIALS = 300  # circles through three points of an outline
NEAR_OUTLINE = 1.5  # [px]
SHARE_OF_OUTLINE = 0.5  # points of an outline that must lie near its circle
PAIRS = 60_000  # of edge pixels whose gradients are intersected
EDGES = 6000  # edge pixels at most
BLUR = 1.5  # [px]
RADII = (0.04, 0.6)  # of a sphere, in shares of the picture's smaller side
ALIGNED = 0.95  # cosine between an edge's gradient and the radius
CANDIDATES = 30
SECTORS = 90  # of a circle; one is seen when an edge lies in it


@dataclass(frozen=True)
class Circle:
    """The outline of a sphere: centre from the picture's top left corner and radius [px]."""

    x: float
    y: float
    radius: float

    def normals(self, shape: tuple[int, ...], share: float = 1.0) -> tuple[NDArray[Any], NDArray[np.float64]]:
        """Return which pixels (H, W) lie within a share of the radius, and their unit normals (P, 3), camera space."""
        row, column = np.indices(shape[:2]) + 0.5
        x, y = (column - self.x) / self.radius, (self.y - row) / self.radius
        inside = x**2 + y**2 < share**2
        x, y = x[inside], y[inside]
        return inside, np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1)


def outline(mask: NDArray[np.bool_]) -> Circle:
    """Return the circle about a sphere from its mask (H, W), also where a part is hidden or out of the picture.

    Circles through three random points of the mask's border are tried; the one that most points lie near is refined
    by least squares over those points.

    Raises
    ------
    LightsphereError
        When half of the border or more lies on no circle.
    """
    row, column = np.nonzero(mask[:, 1:] != mask[:, :-1])
    row2, column2 = np.nonzero(mask[1:] != mask[:-1])
    x = np.concatenate([column + 1.0, column2 + 0.5])
    y = np.concatenate([row + 0.5, row2 + 1.0])
    if len(x) < 12:
        raise LightsphereError("the mask of the sphere is empty or too small; give one that covers the sphere")
    rng = np.random.default_rng(0)
    best, most = None, 0
    for _ in range(TRIALS):
        chosen = rng.choice(len(x), 3, replace=False)
        circle = _through(x[chosen], y[chosen])
        near = int((abs(_distance(circle, x, y)) < NEAR_OUTLINE).sum())
        if near > most:
            best, most = circle, near
    if best is None or most < SHARE_OF_OUTLINE * len(x):
        raise LightsphereError(
            "the outline of the sphere is not a circle; give a mask of the sphere beside its pictures"
        )
    for _ in range(10):
        near_it = abs(_distance(best, x, y)) < NEAR_OUTLINE
        best = _through(x[near_it], y[near_it])
    return best


def _through(x: NDArray[np.float64], y: NDArray[np.float64]) -> Circle:
    """Return the circle through points: x^2 + y^2 = 2 a x + 2 b y + c, by least squares (Kasa 1976)."""
    a, b, c = np.linalg.lstsq(np.stack([2 * x, 2 * y, np.ones_like(x)], axis=1), x**2 + y**2, rcond=None)[0]
    return Circle(float(a), float(b), float(np.sqrt(max(c + a * a + b * b, 0.0))))


def _distance(circle: Circle, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.hypot(x - circle.x, y - circle.y) - circle.radius)


def sought(picture: NDArray[Any]) -> Circle:
    """Return the circle of a sphere in a picture (H, W) without a mask.

    On a circle the gradients of all edges point at one centre, from one distance. Random pairs of the strongest edge
    pixels vote for centre and radius; of the places with most votes, the circle that edges surround most completely
    is refined by least squares (a randomised Hough transform: Xu, Oja, Kultanen 1990).

    Raises
    ------
    LightsphereError
        When no circle is surrounded by half.
    """
    level = np.sqrt(np.maximum(ndimage.gaussian_filter(picture.astype(np.float64), BLUR), 0))
    slope = np.stack([ndimage.sobel(level, axis=1), ndimage.sobel(level, axis=0)], axis=-1)
    steep = np.linalg.norm(slope, axis=-1)
    count = min(EDGES, steep.size // 10)
    row, column = np.unravel_index(np.argpartition(steep.ravel(), -count)[-count:], steep.shape)
    place = np.stack([column, row], axis=-1) + 0.5
    toward = slope[row, column] / np.maximum(steep[row, column], 1e-12)[:, None]
    votes = _votes(place, toward, min(steep.shape))
    best, most = None, 0.0
    for circle in votes:
        share = 0.0
        for _ in range(5):
            offset = place - (circle.x, circle.y)
            distance = np.linalg.norm(offset, axis=1)
            along = abs((offset * toward).sum(axis=1)) / np.maximum(distance, 1e-9)
            on = (abs(distance - circle.radius) < 2 * NEAR_OUTLINE) & (along > ALIGNED)
            if on.sum() < 12:
                break
            angle = np.arctan2(offset[on, 1], offset[on, 0])
            share = len(np.unique((angle + np.pi) * SECTORS // (2 * np.pi))) / SECTORS
            circle = _through(place[on, 0], place[on, 1])
        if share > most:
            best, most = circle, share
    if best is None or most < SHARE_OF_OUTLINE:
        raise LightsphereError("no sphere stands out in its pictures; put a mask of the sphere beside them")
    return best


def _votes(place: NDArray[Any], toward: NDArray[Any], side: int) -> list[Circle]:
    """Return the circles that most pairs of edges agree on: p + s g = q + t g' with |s| = |t|."""
    rng = np.random.default_rng(0)
    first, second = rng.integers(0, len(place), (2, PAIRS))
    across = place[second] - place[first]
    g, h = toward[first], toward[second]
    turn = g[:, 0] * h[:, 1] - g[:, 1] * h[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (across[:, 0] * h[:, 1] - across[:, 1] * h[:, 0]) / turn
        t = (across[:, 0] * g[:, 1] - across[:, 1] * g[:, 0]) / turn
        good = (abs(turn) > 0.1) & (abs(s - t) < 0.05 * abs(s))
        good &= (abs(s) > RADII[0] * side) & (abs(s) < RADII[1] * side)
    centre = place[first][good] + s[good, None] * g[good]
    cell = max(3.0, side / 100)
    bins, number = np.unique(np.column_stack([centre, abs(s[good])]) // cell, axis=0, return_counts=True)
    best = bins[np.argsort(-number, kind="stable")[:CANDIDATES]] * cell + cell / 2
    return [Circle(float(x), float(y), float(r)) for x, y, r in best]
