"""How per-pixel kernels are compiled: to machine code, cached on disk, without Python's checks."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

import numba
from numba import njit


def cache_folder() -> Path:
    """Return where compiled kernels are kept: a folder named after what all of them are compiled from.

    numba notices a change in a kernel's own file only, not in those of the kernels that it calls; those lie in files
    that make kernels, too, and constants of a kernel must stand in such a file. What is kept names its module, which
    has another name as a part of Blender's extension. The folder lies in ``NUMBA_CACHE_DIR`` where that is set, beside
    this file otherwise.
    """
    sources = hashlib.sha256(__name__.encode())
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        source = path.read_bytes()
        if b"compiled import" in source or path == Path(__file__):
            sources.update(source)
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    folder = Path(chosen) if chosen else Path(__file__).parent / "__pycache__"
    return folder / f"kernels-{sources.hexdigest()[:16]}"


numba.config.CACHE_DIR = str(cache_folder())  # type: ignore[attr-defined]

# Sums may be reordered and fused; infinities and NaN keep their meaning, solvers use them.
_ALLOWED = {"contract", "reassoc", "arcp", "nsz", "afn"}

kernel: Any = njit(cache=True, nogil=True, fastmath=_ALLOWED, error_model="numpy")
parallel_kernel: Any = njit(cache=True, fastmath=_ALLOWED, error_model="numpy", parallel=True)
