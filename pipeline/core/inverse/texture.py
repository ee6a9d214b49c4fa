"""The reflectance of every texel from one picture: the photograph over what a white surface would show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.ndimage import distance_transform_edt, gaussian_filter

from . import LEAST, MOST

Array = NDArray[np.float64]
SMOOTH = 1.5  # standard deviation over which the rendered light is averaged [px]
FINER = 1.5  # texels along a pixel's side
SIDES = (8, 1024)  # of the texture [texels]


def reflectance_map(
    photograph: Array, white: Array, mask: NDArray[np.bool_], whole: NDArray[np.bool_], uv: Array
) -> NDArray[np.float32]:
    """Return the texture of a group that one picture shows.

    Modelled shadows go out with the light that they are missing. Texels that the picture does not show get the nearest
    value.

    Parameters
    ----------
    photograph, white : (H, W, 3) float64
        The picture, and a render of the same with the group white; its noise is smoothed within the group.
    mask, whole : (H, W) bool
        The group's trusted pixels, and all of them.
    uv : (H, W, 2) float64
        Texture coordinates.

    Returns
    -------
    (S, S, 3) float32
        Rows top-down.
    """
    share = gaussian_filter(whole.astype(np.float64), SMOOTH)
    light = gaussian_filter(white * whole[..., None], (SMOOTH, SMOOTH, 0)) / np.maximum(share, 1e-9)[..., None]
    values = np.clip(photograph[mask] / np.maximum(light[mask], 1e-12), LEAST, MOST)
    place = uv[mask]
    extent = np.ptp(place, axis=0).max()
    side = int(np.clip(FINER * np.sqrt(mask.sum()) / max(extent, 1e-6), *SIDES))
    centres = (np.arange(side) + 0.5) / side
    u, v = np.meshgrid(centres, centres[::-1])
    texture = np.asarray(LinearNDInterpolator(place, values)(u, v))
    unknown = ~np.isfinite(texture[..., 0])
    nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return np.asarray(texture[tuple(nearest)], np.float32)
