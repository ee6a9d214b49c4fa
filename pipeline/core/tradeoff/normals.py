"""Expected errors of normals: those of the richest settings on a few pixels are what others are told by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..compare.shapes import angles_deg
from ..progress import Work
from ..shape import Shape
from ..shape.photometric.recover import recover
from ..shape.settings import ShapeSettings
from .excerpt import Excerpt


@dataclass(frozen=True)
class Reference:
    """Normals of some pixels and how sure they are.

    Parameters
    ----------
    normal : (H, W, 3) float64
        NaN where there is none.
    deviation : (H, W) float64
        Standard deviation of these normals [degrees].
    shown : (H, W) bool
        The pixels.
    """

    normal: NDArray[np.float64]
    deviation: NDArray[np.float64]
    shown: NDArray[np.bool_]

    def errors(self, shape: Shape) -> dict[str, float]:
        """Return the error to be expected of a shape's normals: the angle to these, and the deviation of these.

        The median of ``sqrt(angle^2 + deviation^2)`` over the pixels that both know. What the model of these normals
        leaves out, light from other surfaces above all, is not in it.
        """
        known = self.shown & (shape.confidence > 0) & np.isfinite(self.deviation)
        recovered = {"recovered_pct": 100 * float(known.sum()) / max(int(self.shown.sum()), 1)}
        if not known.any():
            return {"normal_expected_deg": float("nan"), **recovered}
        angle = angles_deg(self.normal[known], shape.normal[known].astype(np.float64))
        return {"normal_expected_deg": float(np.median(np.hypot(angle, self.deviation[known]))), **recovered}


def reference(part: Excerpt) -> Work[Reference]:
    """Recover the normals of a few pixels with all lights and as many bases as there may be by default.

    To the deviation that they state is added what it does to them that the bases are told from these pixels: a second
    solve from fewer of them says how much.
    """
    settings = ShapeSettings(method="acls")
    shape = (yield from recover(part, settings)).shape
    fewer = (yield from recover(part.smaller(), settings)).shape
    normal, stated = shape.normal.astype(np.float64), shape.layers["normal_deviation"].astype(np.float64)
    both = (shape.confidence > 0) & (fewer.confidence > 0)
    apart = float(np.median(angles_deg(normal[both], fewer.normal[both].astype(np.float64)))) if both.any() else 0.0
    return Reference(normal, np.hypot(stated, apart / np.sqrt(2)), part.mask())
