"""The reflectance of every texel from one picture: the photograph over what a white surface would show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.ndimage import distance_transform_edt, gaussian_filter

from . import LEAST, MOST

Array = NDArray[np.float64]
SMOOTH = 1.5  # standard deviation over which the rendered light is averaged [px]
COVERED = 0.6  # of a pixel at the edge by its group, that it counts
FINER = 1.5  # texels along a pixel's side
SIDES = (8, 1024)  # of the texture [texels]


def light_on(white: Array, mask: NDArray[np.bool_]) -> Array:
    """Return the light that a group's surface gets, (H, W, 3), from a noisy render of it white: smoothed within a mask.

    Pixels beside the mask get what those near them have.
    """
    return smoothed(white, mask, SMOOTH)


def smoothed(values: Array, mask: NDArray[np.bool_], width: float) -> Array:
    """Return values (H, W, 3) averaged over a Gaussian of a width [px], those in a mask alone."""
    share = gaussian_filter(mask.astype(np.float64), width)
    return np.asarray(gaussian_filter(values * mask[..., None], (width, width, 0)) / np.maximum(share, 1e-9)[..., None])


def seen_reflectance(
    photograph: Array, light: Array, dark: Array, plain: Array, inner: NDArray[np.bool_]
) -> tuple[Array, NDArray[np.bool_]]:
    """Return what a group's pixels reflect, (P, 3), and which of them tell, (P,): the photograph over the light.

    Modelled shadows go out with the light that they are missing. A pixel at the group's edge shows other things, too:
    those are taken off, and it counts where the group covers most of it.

    Parameters
    ----------
    photograph, light : (P, 3) float64
    dark : (P, 3) float64
        Rendered with the group black: what else the pixels show.
    plain : (P, 3) float64
        Rendered with the group white, less dark.
    inner : (P,) bool
        Pixels that show nothing else.
    """
    cover = np.where(inner, 1.0, np.clip((plain / np.maximum(light, 1e-12)).mean(axis=-1), 0.0, 1.0))[:, None]
    values = np.clip((photograph - dark) / np.maximum(cover * light, 1e-12), LEAST, MOST)
    return np.asarray(values), np.asarray(cover[:, 0] > COVERED)


def sharpened(values: Array, wanted: Array, shown: Array) -> Array:
    """Return reflectances of pixels corrected by how a render of them differs from what was wanted (Van Cittert 1931).

    A pixel of a photograph is a mean over what its filter covers; rendered again, it would be smoothed twice.

    Parameters
    ----------
    values : (P, 3) float64
        Those that the render was made of.
    wanted, shown : (P, 3) float64
        Of the photograph and of the render.
    """
    return np.clip(values * wanted / np.maximum(shown, LEAST), LEAST, MOST)


def reflectance_map(values: Array, uv: Array) -> NDArray[np.float32]:
    """Return the texture of reflectances at some places; texels between are linear, others have the nearest value.

    Parameters
    ----------
    values : (P, 3) float64
    uv : (P, 2) float64
        Texture coordinates.

    Returns
    -------
    (S, S, 3) float32
        Rows top-down.
    """
    extent = np.ptp(uv, axis=0).max()
    side = int(np.clip(FINER * np.sqrt(len(uv)) / max(extent, 1e-6), *SIDES))
    centres = (np.arange(side) + 0.5) / side
    u, v = np.meshgrid(centres, centres[::-1])
    texture = np.asarray(LinearNDInterpolator(uv, values)(u, v))
    unknown = ~np.isfinite(texture[..., 0])
    nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return np.asarray(texture[tuple(nearest)], np.float32)
