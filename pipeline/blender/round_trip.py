"""The full turn BRDF -> nodes -> Cycles -> BRDF: a material's bases on a sphere under single lights.

The sphere is seen orthographically, under suns without extent; where a pixel's normal n, view and sun are known, its
radiance over the irradiance is f cos(theta_i). Normals are those that Cycles itself shades with.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core import images
from ..core.brdf import Brdf
from ..core.camera import Camera
from ..core.lights import Lights
from ..core.material import Mixture
from ..core.material.surface import Surface
from ..core.progress import Progress, Work, retold
from . import truth, views
from .ball import ball_camera, ball_scene, dress
from .camera import add_camera
from .mixtures import mixture_material

Reflected = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
SIDE = 96  # pixels of the sphere's pictures
STEEPEST = 0.05  # cosine of view or light below which a triangle's own plane may hide what its normal shows
SUNS = 12


@dataclass(frozen=True)
class RoundTrip:
    """What Cycles made of a material's bases.

    Parameters
    ----------
    pictures : (K, L, H, W, 3) float32
        Radiance over irradiance.
    against_mixture, against_table : (K,) float64
        RMS of the difference over the RMS, over all suns and lit pixels: from the closed forms of the closures, and
        from the BRDF that the mixture was fitted to.
    """

    pictures: NDArray[np.float32]
    against_mixture: NDArray[np.float64]
    against_table: NDArray[np.float64]


def round_trip(mixture: Mixture, brdfs: Sequence[Brdf]) -> Work[RoundTrip]:
    """Render every basis of a mixture by Cycles and compare; what is open in this Blender is replaced.

    Yields
    ------
    Progress per picture.
    """
    scene, item = ball_scene()
    camera, suns = ball_camera(SIDE), _suns()
    pictures, errors = [], []
    add_camera(scene, camera)
    normal = _normals(scene, camera)  # of the bare ball: the pass shows what a material's closures make of it
    for number, brdf in enumerate(brdfs):
        weights = np.zeros((1, 1, len(brdfs), 1), np.float32)
        weights[..., number, :] = 1.0
        dress(item, mixture_material(f"Basis {number + 1}", Surface(mixture, weights)))
        shown = yield from _under(scene, camera, suns, number, len(brdfs))
        pictures.append(shown)
        pair = (partial(_mixed, mixture, number), partial(_tabulated, brdf))
        errors.append([compared(shown, normal, camera, suns, f_cos) for f_cos in pair])
    return RoundTrip(np.stack(pictures), *np.array(errors).T)


def _suns() -> Lights:
    """Suns from the view direction to the far side, on a spiral about the view."""
    angle = np.radians(np.linspace(0, 120, SUNS))
    turn = np.arange(SUNS) * np.pi * (3 - np.sqrt(5))
    towards = np.stack([np.sin(angle) * np.cos(turn), -np.cos(angle), np.sin(angle) * np.sin(turn)], axis=-1)
    return Lights("distant", towards, np.ones((SUNS, 3)), np.zeros(SUNS, int))


def _under(scene: bpy.types.Scene, camera: Camera, suns: Lights, number: int, count: int) -> Work[NDArray[np.float32]]:
    def told(step: Progress) -> Progress:
        return Progress("round trip", number * len(suns) + step.done, count * len(suns), "pictures")

    return (yield from retold(views.under_lights(scene, camera, suns), told))


def _normals(scene: bpy.types.Scene, camera: Camera) -> NDArray[np.float64]:
    with tempfile.TemporaryDirectory() as folder:
        truth.write(scene, camera, Path(folder))
        channels = images.read_channels(Path(folder) / "truth.exr")
    normal = np.stack([channels[f"normal.{axis}"] for axis in "XYZ"], axis=-1)
    return np.asarray(camera.normals_to_world(normal))


def compared(
    shown: NDArray[np.float32], normal: NDArray[np.float64], camera: Camera, suns: Lights, f_cos: Reflected
) -> float:
    """Return how far pictures of one ball under single suns are from f cos(theta_i): RMS over RMS of lit pixels.

    Parameters
    ----------
    shown : (L, H, W, 3) float32
        Radiance over irradiance.
    normal : (H, W, 3) float64
        In the world; NaN off the ball.
    f_cos : callable
        Of wi and wo (N, 3) in the frame of the surface, x along the ball's parallels.
    """
    seen = np.isfinite(normal).all(axis=-1)
    n, view = normal[seen], -camera.rays()[1][seen]
    squares = np.zeros(2)
    for picture, sun in zip(shown, suns.position, strict=True):
        good = ((n * view).sum(axis=-1) > STEEPEST) & (n @ sun > STEEPEST)
        frame = _frames(n[good])
        wi, wo = (np.einsum("nij,nj->ni", frame, np.broadcast_to(w, n.shape)[good]) for w in (sun, view))
        wanted = f_cos(wi, wo)
        squares += ((picture[seen][good] - wanted) ** 2).sum(), (wanted**2).sum()
    return float(np.sqrt(squares[0] / squares[1]))


def _mixed(mixture: Mixture, number: int, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
    return mixture.evaluate(wi, wo)[:, number]


def _tabulated(brdf: Brdf, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
    return brdf.evaluate(wi, wo) * wi[:, 2, None]


def _frames(n: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rows x, y, z (N, 3, 3) of frames whose z is the normal and whose x runs along the sphere's parallels."""
    x = np.stack([-n[:, 1], n[:, 0], 0 * n[:, 0]], axis=-1)
    x /= np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-9)
    return np.stack([x, np.cross(n, x), n], axis=1)
