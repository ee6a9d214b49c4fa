"""Numbers per pixel and light in few bytes: a Karhunen-Loeve transform over the lights, one step for all coefficients.

With one step D the components that vary by less than it cost nothing, which is the best use of bits for a squared
error (reverse water-filling; Cover and Thomas 2006, section 10.3). Colours are turned to luminance and two opponents
first. What is left of a coefficient's bytes is taken out by the file's own compression.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..progress import Progress, Work

OPPONENT = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]], np.float32).T / np.sqrt([3, 2, 6], dtype=np.float32)
MOST = 256  # components
FINEST = 32767  # of a basis vector's entries
LARGEST = 2**22  # steps
ROWS = 4096
TRIES = 12
FITS = 0.95  # of the bytes that may be used, when the search for a step ends


@dataclass(frozen=True)
class Remainder:
    """Decoded numbers of P pixels under L lights.

    Parameters
    ----------
    basis : (L, K) float32
    coefficients : (K, 3, P) float32
        Of luminance and two opponent colours.
    """

    basis: NDArray[np.float32]
    coefficients: NDArray[np.float32]

    def of(self, light: int) -> NDArray[np.float32]:
        """Return the numbers (P, 3) under a light, or (1, 1) of 0 where nothing is left."""
        if not len(self.coefficients):
            return np.zeros((1, 1), np.float32)
        return np.asarray((OPPONENT @ np.tensordot(self.basis[light], self.coefficients, 1)).T)


NONE = Remainder(np.zeros((0, 0), np.float32), np.zeros((0, 3, 0), np.float32))


def coded(rest: NDArray[np.float32], size: float) -> Work[dict[str, NDArray[Any]]]:
    """Return what :func:`decoded` takes: numbers (P, L, 3) in at most so many bytes, none where nothing fits."""
    basis = yield from _basis(rest)
    coefficients = np.empty((basis.shape[1], 3, len(rest)), np.float32)
    for start in range(0, len(rest), ROWS):
        part = rest[start : start + ROWS] @ OPPONENT
        coefficients[..., start : start + ROWS] = np.tensordot(basis, part, ((0,), (1,))).transpose(0, 2, 1)
        yield Progress("transform", min(start + ROWS, len(rest)), len(rest), "pixels")
    spread = np.sqrt(np.square(coefficients).mean(axis=(1, 2)))
    best = _arrays(basis[:, :0], coefficients[:0], 1.0)
    low, high = 1e-6 * float(spread.max(initial=1e-30)), 4 * float(spread.max(initial=1e-30))
    for tried in range(TRIES):
        step = float(np.sqrt(low * high))
        kept = int((spread > step / 2).sum())  # they fall
        arrays = _arrays(basis[:, :kept], coefficients[:kept], step)
        used = sum(len(zlib.compress(array.tobytes(), 6)) for array in arrays.values())
        yield Progress("code", tried + 1, TRIES, "steps")
        if used > size:
            low = step
            continue
        high, best = step, arrays
        if used > FITS * size:
            break
    return best


def decoded(arrays: dict[str, NDArray[Any]]) -> Remainder:
    """Return what :func:`coded` made of its numbers."""
    steps = joined(arrays["low"], arrays["high"]).astype(np.float32)
    return Remainder(arrays["basis"].astype(np.float32) / np.float32(FINEST), steps * arrays["step"])


def apart(steps: NDArray[Any]) -> tuple[NDArray[np.int8], NDArray[np.int16]]:
    """Return whole numbers below 2^22 as bytes and what those miss: apart from noisy bytes, calm ones take no room."""
    high = (steps.astype(np.int32) + 128) >> 8
    return (steps - 256 * high).astype(np.int8), high.astype(np.int16)


def joined(low: NDArray[np.int8], high: NDArray[np.int16]) -> NDArray[np.int32]:
    """Return the numbers of :func:`apart`."""
    return 256 * high.astype(np.int32) + low


def _basis(rest: NDArray[np.float32]) -> Work[NDArray[np.float32]]:
    """Return the components (L, K), those that explain most first."""
    lights = rest.shape[1]
    gram = np.zeros((lights, lights))
    for start in range(0, len(rest), ROWS):
        part = (rest[start : start + ROWS] @ OPPONENT).transpose(0, 2, 1).reshape(-1, lights)
        gram += part.T.astype(np.float64) @ part
        yield Progress("components", min(start + ROWS, len(rest)), len(rest), "pixels")
    vectors = np.linalg.eigh(gram)[1][:, ::-1][:, :MOST]
    return np.asarray(np.round(FINEST * vectors) / FINEST, np.float32)


def _arrays(basis: NDArray[np.float32], coefficients: NDArray[np.float32], step: float) -> dict[str, NDArray[Any]]:
    """Return basis and coefficients in steps."""
    low, high = apart(np.clip(np.round(coefficients / np.float32(step)), -LARGEST, LARGEST))
    return {
        "basis": np.round(FINEST * basis).astype(np.int16),
        "low": low,
        "high": high,
        "step": np.array(step, np.float32),
    }
