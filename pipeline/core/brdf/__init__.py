"""BRDFs as functions of two directions, in the frame of their surface.

The normal is z and the tangent x. Every model here has ``evaluate(wi, wo)`` for unit directions that leave the surface,
and everything that fits or draws a material needs no more than that.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


class Brdf(Protocol):
    """The reflectance of one material."""

    @property
    def isotropic(self) -> bool:
        """Whether turning both directions about the normal changes nothing."""
        ...

    def evaluate(self, wi: NDArray[Any], wo: NDArray[Any]) -> NDArray[np.float64]:
        """Return f [1/sr], (N, 3), for unit directions wi and wo (N, 3) above the surface."""
        ...
