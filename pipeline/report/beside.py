"""A picture and what it should be, in one: split at a line, beside each other, or as a map of their difference."""

from __future__ import annotations

import io

import numpy as np
from matplotlib import image
from numpy.typing import NDArray

from ..core.compare.pictures import picture_error
from . import figures, style

Picture = NDArray[np.float64]
Radiance = NDArray[np.float32]
LABEL = "difference, % of the reference's RMS"
GAP = 2  # columns between pictures that stand beside each other


def split(picture: Radiance, reference: Radiance, share: float) -> Picture:
    """Return the reference to the left of a line at a share of the width, and the picture to its right.

    Parameters
    ----------
    picture, reference : (H, W, 3) float32
        Linear radiance.
    share : float
        From 0, the picture alone, to 1, the reference alone.

    Returns
    -------
    (H, W, 3) float64
        What a screen shows, from 0 to 1, both of one exposure.
    """
    left, right = _displayed(picture, reference)
    column = round(share * left.shape[1])
    both = np.concatenate([left[:, :column], right[:, column:]], axis=1)
    if 0 < column < left.shape[1]:
        both[:, column] = 1.0
    return both


def side_by_side(picture: Radiance, reference: Radiance) -> Picture:
    """Return the reference and, to its right, the picture, as :func:`split` shows them, (H, 2 W + GAP, 3)."""
    left, right = _displayed(picture, reference)
    return np.concatenate([left, np.ones((len(left), GAP, 3)), right], axis=1)


def difference(picture: Radiance, reference: Radiance) -> Picture:
    """Return a map of the difference with its scale, as a picture of its own."""
    drawn = figures.heat(percent(picture, reference), LABEL)
    return np.asarray(image.imread(io.BytesIO(drawn))[..., :3], np.float64)


def percent(picture: Radiance, reference: Radiance) -> NDArray[np.float64]:
    """Return the difference of two pictures over the reference's RMS [%], (H, W); NaN where the reference is black."""
    return np.where((reference > 0).any(axis=-1), 100 * picture_error(picture, reference), np.nan)


def _displayed(picture: Radiance, reference: Radiance) -> tuple[Picture, Picture]:
    exposure = style.exposure_for(reference)
    return style.display(reference, exposure), style.display(picture, exposure)
