"""The picture of a surface under one distant light, by its normals and reflectance alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..shape import Shape
from .bivariate import Bivariate


def picture(shape: Shape, reflectance: Bivariate, direction: ArrayLike, irradiance: ArrayLike) -> NDArray[np.float32]:
    """Return the radiance (H, W, 3) of every pixel, L = f cos E; 0 where nothing was recovered.

    Parameters
    ----------
    shape : Shape
    reflectance : Bivariate
        Of its pixels.
    direction : (3,)
        Unit direction to the light, world.
    irradiance : (3,)
        On a surface that faces it [W/m^2].

    Not modelled: cast shadows and light from other surfaces.
    """
    known = shape.confidence > 0
    normal = shape.camera.normals_to_world(shape.normal[known].astype(np.float64))
    wi = np.broadcast_to(np.asarray(direction, np.float64), normal.shape)
    f, _ = reflectance.evaluate(reflectance.weights[known], normal, wi, -shape.camera.rays()[1][known])
    shown = np.zeros((*known.shape, 3), np.float32)
    shown[known] = f * np.maximum((normal * wi).sum(axis=1), 0.0)[:, None] * np.asarray(irradiance)
    return shown
