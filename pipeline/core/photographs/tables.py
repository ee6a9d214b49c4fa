"""Numbers from text and MATLAB files."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from ..errors import LightsphereError


def table(path: Path, columns: int) -> NDArray[np.float64]:
    """Read a text file of numbers with so many columns; raise LightsphereError naming the file."""
    try:
        values = np.loadtxt(path, delimiter="," if path.suffix.lower() == ".csv" else None, ndmin=2)
    except (OSError, ValueError) as error:
        raise LightsphereError(f"{path} is not a table of numbers ({error}); correct it") from error
    if values.shape[1] != columns or not np.isfinite(values).all():
        raise LightsphereError(f"{path} has {values.shape[1]} columns; it needs {columns} of finite numbers")
    return np.asarray(values, np.float64)


def matlab(path: Path) -> dict[str, Any]:
    """Read the variables of a MATLAB file before version 7.3; raise LightsphereError naming the file."""
    try:
        return dict(loadmat(path))
    except (OSError, ValueError, TypeError, NotImplementedError, MatReadError, zlib.error) as error:
        raise LightsphereError(f"{path} cannot be read ({error}); copy it again, or save it with -v7") from error
