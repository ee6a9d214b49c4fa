"""How per-pixel kernels are compiled: to machine code, cached on disk, without Python's checks."""

from __future__ import annotations

from typing import Any

from numba import njit

# Sums may be reordered and fused; infinities and NaN keep their meaning, solvers use them.
_ALLOWED = {"contract", "reassoc", "arcp", "nsz", "afn"}

kernel: Any = njit(cache=True, fastmath=_ALLOWED, error_model="numpy")
parallel_kernel: Any = njit(cache=True, fastmath=_ALLOWED, error_model="numpy", parallel=True)
