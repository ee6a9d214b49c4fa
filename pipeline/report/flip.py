"""How different two pictures look when one takes the place of the other."""

from __future__ import annotations

from typing import Any

import flip_evaluator
import numpy as np
from numpy.typing import NDArray


def flip(picture: NDArray[Any], reference: NDArray[Any]) -> NDArray[np.float64]:
    """Return the difference that a person sees at every pixel, seen from where a degree is 67 pixels wide.

    Parameters
    ----------
    picture, reference : (H, W, 3) float
        Display values (sRGB), 0 to 1.

    Returns
    -------
    (H, W) float64
        0 for what looks alike, to 1.

    References
    ----------
    Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom and Fairchild 2020, by the authors' own library.
    """
    pair = [np.ascontiguousarray(values, np.float32) for values in (reference, picture)]
    seen, _, _ = flip_evaluator.evaluate(*pair, "LDR", applyMagma=False, computeMeanError=False)
    return np.asarray(seen, np.float64)[..., 0]
