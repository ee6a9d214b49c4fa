"""The picture of a surface under one light, by its normals and reflectance alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..shape import Shape
from .bivariate import Bivariate


def picture(
    shape: Shape, reflectance: Bivariate, place: ArrayLike, intensity: ArrayLike, near: bool = False
) -> NDArray[np.float32]:
    """Return the radiance (H, W, 3) of every pixel, L = f cos E; 0 where nothing was recovered.

    Parameters
    ----------
    shape : Shape
    reflectance : Bivariate
        Of its pixels.
    place : (3,)
        Unit direction to a distant light, position of a near one [m], world.
    intensity : (3,)
        Irradiance on a surface that faces a distant light [W/m^2], radiant intensity of a near one [W/sr].
    near : bool

    Not modelled: cast shadows and light from other surfaces.
    """
    known = shape.confidence > 0
    normal = shape.camera.normals_to_world(shape.normal[known].astype(np.float64))
    towards = np.broadcast_to(np.asarray(place, np.float64), normal.shape)
    irradiance = np.asarray(intensity, np.float64)
    if near:
        towards = towards - shape.points()[known]
        irradiance = irradiance / (towards**2).sum(axis=1, keepdims=True)
    wi = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    f, _ = reflectance.evaluate(reflectance.weights[known], normal, wi, -shape.camera.rays()[1][known])
    shown = np.zeros((*known.shape, 3), np.float32)
    shown[known] = f * np.maximum((normal * wi).sum(axis=1), 0.0)[:, None] * irradiance
    return shown
