"""Lights from photographs of a sphere: directions from a mirror, directions and irradiances from a gray one.

The view is orthographic: the sphere is small against its distance to the camera, and the lights are far away against
its size. Sphere pictures are (L, H, W, 3), linear.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ..errors import LightsphereError
from .outlines import Circle

VIEW = np.array([0.0, 0.0, 1.0])
FACING = 0.95  # share of the radius within which a gray sphere is used: its rim is blurred and sees the room
HIGHLIGHT = 0.5  # share of the brightest change from which pixels belong to a highlight
RIM = 2  # [px] about a highlight
CLEAR = 8.0  # a highlight is this many times brighter than the usual change of the picture
RIVAL = 0.5  # a second blob with this share of the first one's light makes the direction doubtful
LIT = 0.15  # cosine from which a gray surface is surely lit


def mirrored(pictures: NDArray[np.float32], circle: Circle) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the direction to each light from its highlight in a mirror sphere.

    What all pictures share, the room, is taken off as the median over the lights. Of the parts that are then at least
    half as bright as the brightest, the one with the most light is the highlight. Each of its pixels mirrors the
    direction l = 2 (n.v) n - v, and since an orthographic mirror sphere maps equal areas to equal solid angles
    (dw_l = 4 dA / R^2), the mean of l over the light in the pixels is the direction to the middle of a lamp.

    Parameters
    ----------
    pictures : (L, H, W, 3) float32
    circle : Circle

    Returns
    -------
    direction : (L, 3) float64
        Unit, camera space.
    doubtful : (L,) bool
        Whether a second part has at least half as much light.

    Raises
    ------
    LightsphereError
        When a picture has no highlight.
    """
    gray = pictures.mean(axis=3)
    inside, normal = circle.normals(gray.shape[1:], 0.99)
    reflected = 2 * (normal @ VIEW)[:, None] * normal - VIEW
    room = np.median(gray, axis=0) if len(gray) > 2 else np.zeros_like(gray[0])
    direction = np.empty((len(gray), 3))
    doubtful = np.zeros(len(gray), np.bool_)
    for i, picture in enumerate(gray):
        change = np.where(inside, picture - room, 0)
        peak = change.max()
        if not peak > CLEAR * np.median(abs(change[inside])):
            raise LightsphereError(
                f"picture {i + 1} of the mirror sphere shows no highlight; leave it out or retake it"
            )
        parts, count = ndimage.label(change > HIGHLIGHT * peak, np.ones((3, 3)))
        light = ndimage.sum_labels(change, parts, np.arange(1, count + 1))
        best = 1 + int(np.argmax(light))
        doubtful[i] = bool((np.delete(light, best - 1) > RIVAL * light[best - 1]).any())
        blob = ndimage.binary_dilation(parts == best, iterations=RIM)  # with the pixels that it covers in part
        weight = np.where(blob, np.maximum(change, 0), 0)[inside]
        mean = weight @ reflected
        direction[i] = mean / np.linalg.norm(mean)
    return direction, doubtful


def shaded(pictures: NDArray[np.float32], circle: Circle, clipped: float) -> NDArray[np.float64]:
    """Return the direction to each light from the shading of a gray sphere, (L, 3) unit, camera space.

    Least squares of value = b . n over the pixels that are lit and not clipped, repeated as b tells which those are.
    A Lambertian sphere is assumed.
    """
    gray = pictures.mean(axis=3)
    inside, normal = circle.normals(gray.shape[1:], FACING)
    usable = (pictures < clipped).all(axis=3)[:, inside]
    direction = np.empty((len(gray), 3))
    for i, picture in enumerate(gray):
        value = picture[inside].astype(np.float64)
        lit = usable[i] & (value > LIT * np.percentile(value, 99))
        for _ in range(10):
            if lit.sum() < 3:
                raise LightsphereError(
                    f"picture {i + 1} of the gray sphere is black or saturated; leave it out or retake it"
                )
            b = np.linalg.lstsq(normal[lit], value[lit], rcond=None)[0]
            lit = usable[i] & (normal @ b > LIT * np.linalg.norm(b))
        direction[i] = b / np.linalg.norm(b)
    return direction


def irradiance(
    pictures: NDArray[np.float32], circle: Circle, direction: NDArray[np.float64], clipped: float
) -> tuple[NDArray[np.float64], float]:
    """Return the irradiance of each light from a gray sphere, and how well the lights predict the sphere's pictures.

    Parameters
    ----------
    pictures : (L, H, W, 3) float32
    circle : Circle
    direction : (L, 3) float64
    clipped : float
        Value from which a pixel is saturated, and left out.

    Returns
    -------
    irradiance : (L, 3) float64
        Per colour, in a unit in which the mean over all lights is pi; the sphere counts as gray.
    error_pct : float
        Root mean square of picture - E max(0, n.l) over that of the pictures, attached shadows included [%].
    """
    inside, normal = circle.normals(pictures.shape[1:], FACING)
    found = np.empty((len(pictures), 3))
    missed = power = 0.0
    for i, picture in enumerate(pictures):
        value = picture[inside].astype(np.float64)
        usable = (value < clipped).all(axis=1)
        cosine = np.maximum(normal @ direction[i], 0)
        lit = usable & (cosine > LIT)
        if not lit.any():
            raise LightsphereError(
                f"picture {i + 1} of the gray sphere is black or saturated; leave it out or retake it"
            )
        found[i] = cosine[lit] @ value[lit] / (cosine[lit] @ cosine[lit])
        missed += float(((value - cosine[:, None] * found[i])[usable] ** 2).sum())
        power += float((value[usable] ** 2).sum())
    return np.pi * found / found.mean(), 100 * float(np.sqrt(missed / power))


def angles(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angles between unit vectors (L, 3) [degrees]."""
    return np.asarray(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))))
