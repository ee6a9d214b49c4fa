"""How far equations magnify what is wrong of their right sides: condition numbers, and how they are noted."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BAD = 1e3  # of normal equations: noise of half a per cent of the values is one of a sixth of the unknowns


def condition(matrices: NDArray[np.float64], one_unit: bool = False) -> NDArray[np.float64]:
    """Return the condition numbers of symmetric, positive matrices of normal equations.

    Parameters
    ----------
    matrices : (..., N, N) float64
    one_unit : bool
        Whether all unknowns have the same unit. Else rows and columns are scaled to a diagonal of ones first (van der
        Sluis 1969), and unknowns that nothing depends on are left out.

    Returns
    -------
    (...) float64
        Largest over least eigenvalue; infinite where unknowns cannot be told apart, 1 where there are none.

    Examples
    --------
    >>> condition(np.diag([1e-6, 2.0, 3e6])).round(6).item()
    1.0
    >>> condition(np.array([[1.0, 0.98], [0.98, 1.0]])).round(6).item()
    99.0
    >>> condition(np.diag([1e-6, 2.0, 3e6]), one_unit=True).round().item()
    3000000000000.0
    """
    if one_unit:
        return _ratio(matrices)
    diagonal = np.einsum("...ii->...i", matrices)
    known = diagonal > 0
    scale = np.where(known, 1 / np.sqrt(np.where(known, diagonal, 1.0)), 0.0)
    scaled = matrices * scale[..., :, None] * scale[..., None, :]
    scaled = scaled + np.where(known, 0.0, 1.0)[..., None] * np.eye(matrices.shape[-1])
    return _ratio(scaled)


def _ratio(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    values = np.linalg.eigvalsh(matrices)
    least, largest = values[..., 0], values[..., -1]
    told = least > np.finfo(np.float64).eps * matrices.shape[-1] * largest
    return np.asarray(np.where(told, largest / np.where(told, least, 1.0), np.inf))


def noted(values: NDArray[np.float64]) -> dict[str, Any]:
    """Return condition numbers as a note: their median, the worst, and which share is above :data:`BAD`.

    None stands for an infinite one, which JSON does not have.
    """
    if not values.size:
        return {}
    found = {"median": float(np.median(values)), "worst": float(np.max(values))}
    finite = {name: value if np.isfinite(value) else None for name, value in found.items()}
    return {**finite, "bad_share": float((values > BAD).mean())}
