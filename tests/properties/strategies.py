"""What properties are tried on: directions up to the horizon, colours, cameras, small matrices."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from pipeline.core.camera import Camera
from tests import oracles

HORIZON = 1e-6  # least cosine of a direction above the surface


@st.composite
def directions(draw: st.DrawFn) -> NDArray[np.float64]:
    """A unit direction (1, 3) above the surface, grazing ones included."""
    cosine = draw(st.one_of(st.floats(HORIZON, 1.0), st.floats(-6.0, 0.0).map(lambda power: 10.0**power)))
    azimuth = draw(st.floats(0.0, 2 * np.pi))
    sine = np.sqrt(1 - cosine**2)
    return np.array([[sine * np.cos(azimuth), sine * np.sin(azimuth), cosine]])


def vectors(least: float = -1e3, most: float = 1e3) -> st.SearchStrategy[NDArray[np.float64]]:
    """Three numbers."""
    return arrays.arrays(np.float64, 3, elements=st.floats(least, most))


def rounded(least: float, most: float) -> st.SearchStrategy[float]:
    """A number whose square does not vanish unless it is 0."""
    return st.floats(least, most).map(lambda value: round(value, 9))


@st.composite
def rotations(draw: st.DrawFn) -> NDArray[np.float64]:
    """A rotation (3, 3)."""
    numbers = arrays.arrays(np.float64, 4, elements=st.floats(-1, 1))
    q = draw(numbers.filter(lambda q: np.linalg.norm(q) > 0.1))
    w, x, y, z = oracles.unit(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@st.composite
def cameras(draw: st.DrawFn) -> Camera:
    """A camera somewhere."""
    to_world = np.eye(4)
    to_world[:3, :3], to_world[:3, 3] = draw(rotations()), draw(vectors())
    focal = draw(st.tuples(st.floats(10, 1e4), st.floats(10, 1e4)))
    centre = draw(st.tuples(st.floats(-50, 50), st.floats(-50, 50)))
    return Camera(draw(st.sampled_from(["pinhole", "orthographic"])), to_world, (8, 6), focal, centre)
