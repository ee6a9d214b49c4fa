"""Reflectance: what every pixel of a known shape does with light.

Tables are in :mod:`.bivariate`. A diffuse and one GGX lobe are here; on disk a folder with ``reflectance.json`` (model,
settings, shape folder, errors) and ``reflectance.exr`` with the channels ``albedo.R/G/B``, ``specular.R/G/B``,
``edge.V``, ``roughness.V`` and ``error.V``.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import images
from ..capture import Capture
from ..errors import BROKEN_JSON, LightsphereError
from ..settings import setting
from ..shape import Shape

FILE = "reflectance.json"
MODELS = ("bivariate", "ggx")


@dataclass(frozen=True)
class ReflectanceSettings:
    """How a reflectance is fitted; see :func:`pipeline.core.reflectance.tables.fit` and :func:`.fit.fit`.

    ``bases`` belongs to bivariate, ``clusters`` to ggx.
    """

    model: str = setting(
        "bivariate",
        "bivariate: basis BRDFs as tables and a weight map of each, for any isotropic material; "
        "ggx: a diffuse and one GGX lobe per pixel, which is nearer where the material is that",
        choices=MODELS,
    )
    bases: int = setting(3, "most basis BRDFs that bivariate tells apart", low=1, high=4)
    clusters: int = setting(3, "most roughnesses that the pixels of ggx share", low=1, high=16)
    held_out: int = setting(
        8, "every how many-th light is kept from the fit to state the error on", unit="lights", low=3, high=1000
    )
    memory: float = setting(512.0, "observations held at once; the pixels are tiled accordingly", unit="MB", low=1.0)


def recovered_pixels(shape: Shape, capture: Capture) -> NDArray[np.bool_]:
    """Return the mask (H, W) of the pixels whose reflectance a capture can tell.

    Raises
    ------
    LightsphereError
        When the shape is of another capture, or has no recovered pixel.
    """
    if shape.camera.resolution != capture.camera.resolution:
        raise LightsphereError("the shape is not of this capture's resolution; give the capture it was made from")
    known = np.isfinite(shape.depth) & np.isfinite(shape.normal).all(-1) & (shape.confidence > 0)
    if not known.any():
        raise LightsphereError("the shape has no recovered pixel; recover the shape first")
    return np.asarray(known)


@dataclass(frozen=True)
class Reflectance:
    """A diffuse and one GGX lobe per pixel, in closed forms that Cycles' closures share.

    ``f = albedo / pi + (specular + edge (1 - h.wo)^5) D(alpha) G / (4 cos_i cos_o)``, ``alpha = roughness^2``.
    With ``edge = 1 - specular`` the bracket is Schlick's Fresnel factor; with ``edge = 0`` there is none.

    Parameters
    ----------
    albedo, specular : (H, W, 3) float32
        Non-negative; NaN where the shape is not known.
    edge, roughness : (H, W) float32
        One value per cluster of pixels; ``edge`` from 0 to 1.
    error : (H, W) float32
        ``material_rel_rms`` of the pixel: RMS over the held-out lights of the error of f cos, over the RMS of f cos.
    notes : dict
        Model, settings, shape folder, seconds, errors of the whole.
    """

    albedo: NDArray[np.float32]
    specular: NDArray[np.float32]
    edge: NDArray[np.float32]
    roughness: NDArray[np.float32]
    error: NDArray[np.float32]
    notes: dict[str, Any] = field(default_factory=dict)

    def save(self, folder: Path) -> None:
        """Write the reflectance's files into a folder, each atomically."""
        folder.mkdir(parents=True, exist_ok=True)
        channels = {"edge.V": self.edge, "roughness.V": self.roughness, "error.V": self.error}
        for name, colour in (("albedo", self.albedo), ("specular", self.specular)):
            channels.update({f"{name}.{letter}": colour[..., i] for i, letter in enumerate("RGB")})
        images.write_channels(folder / "reflectance.exr", channels)
        images.write_text(folder / FILE, json.dumps({"notes": self.notes}, indent=1))

    @classmethod
    def open(cls, folder: Path) -> Reflectance:
        """Open a reflectance folder; raise LightsphereError when it is none or is damaged."""
        path = folder / FILE
        if not path.is_file():
            raise LightsphereError(f"{folder} is not a reflectance (it has no {FILE}); make one from a shape")
        try:
            notes = dict(json.loads(path.read_text(encoding="utf-8"))["notes"])
            channels = images.read_channels(folder / "reflectance.exr")
            albedo, specular = (
                np.stack([channels[f"{name}.{letter}"] for letter in "RGB"], axis=-1) for name in ("albedo", "specular")
            )
            return cls(albedo, specular, channels["edge.V"], channels["roughness.V"], channels["error.V"], notes)
        except BROKEN_JSON as error:
            raise LightsphereError(f"{folder} is damaged ({error!r}); fit the reflectance again") from error
