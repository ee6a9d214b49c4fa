"""Numbers from text files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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
