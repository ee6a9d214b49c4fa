"""Reflectance without a parametric model: K tabulated bivariate basis BRDFs and how much of each a pixel has.

On disk a folder with ``reflectance.json``, ``bases.npz`` (``table``, ``seen``) and ``weights.exr`` with the channels
``k.V``, or ``k.R/G/B`` where the weights carry the colour, and ``error.V``.
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import images
from ..arrays import read_npz
from ..errors import BROKEN_JSON, LightsphereError
from . import FILE, Reflectance
from .angles import difference_angles, half_angles

MODEL = "bivariate"


@dataclass(frozen=True)
class Bivariate:
    """``f(wi, wo) = sum_k w_k B_k(theta_h, theta_d)`` at every pixel.

    Parameters
    ----------
    table : (TH, TD, K, S) float64
        Basis BRDFs [1/sr] at the nodes of :mod:`.angles`, linear between; S = 3 colours, or 1.
    seen : (TH, TD, K) float64
        How much the pictures say about a node; 0 where no value reached it: there the table follows from
        smoothness alone.
    weights : (H, W, K, M) float32
        M = 1, or 3 where S = 1; NaN where nothing was recovered.
    error : (H, W) float32
        Relative RMS error of f cos over the values of the pixel.
    notes : dict
        Model, settings, capture, errors.
    """

    table: NDArray[np.float64]
    seen: NDArray[np.float64]
    weights: NDArray[np.float32]
    error: NDArray[np.float32]
    notes: dict[str, Any] = field(default_factory=dict)

    def evaluate(
        self, weights: NDArray[Any], normal: NDArray[Any], wi: NDArray[Any], wo: NDArray[Any]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the BRDF for pairs of directions, from any view.

        Parameters
        ----------
        weights : (N, K, M)
        normal, wi, wo : (N, 3)
            Unit vectors of one space.

        Returns
        -------
        f : (N, 3) float64
            [1/sr]; not 0 below the horizon: multiply by the clamped cosine.
        seen : (N,) bool
            Whether the pictures reached the table there, for every basis with a weight of its own. Elsewhere the
            value is an extrapolation.
        """
        half = wi + wo
        half = half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-12)
        place_h = np.maximum(1.0 - (normal * half).sum(-1), 0.0) ** 0.25 * (self.table.shape[0] - 1)
        nodes_d = self.table.shape[1]
        angle = np.arccos(np.clip((wi * half).sum(-1), 0.0, 1.0))
        place_d = angle / (np.pi / 2) * (nodes_d - 1)
        i = np.clip(place_h.astype(int), 0, self.table.shape[0] - 2)
        j = np.clip(place_d.astype(int), 0, max(nodes_d - 2, 0))
        beside = np.minimum(j + 1, nodes_d - 1)
        a, b = np.clip(place_h - i, 0, 1), np.clip(place_d - j, 0, 1)
        value = np.zeros((len(i), *self.table.shape[2:]))
        reached = np.ones((len(i), self.table.shape[2]), bool)
        for row, share_h in ((i, 1 - a), (i + 1, a)):
            for column, share_d in ((j, 1 - b), (beside, b)):
                share = share_h * share_d
                value += share[:, None, None] * self.table[row, column]
                reached &= (self.seen[row, column] > 0) | (share[:, None] < 1e-3)
        f = np.einsum("nks,nkm->nsm", value, np.asarray(weights, np.float64))
        f = f.reshape(len(i), f.shape[1] * f.shape[2])
        has = np.asarray(weights).max(axis=-1) > 0
        return np.broadcast_to(f, (len(i), 3)), np.asarray((reached | ~has).all(axis=1))

    def basis(self, number: int) -> Basis:
        """Return one of the K basis BRDFs as a function of two directions."""
        return Basis(self, number)

    def angles(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return theta_h (TH,) and theta_d (TD,) of the nodes [rad]."""
        return half_angles(self.table.shape[0]), difference_angles(self.table.shape[1])

    def save(self, folder: Path) -> None:
        """Write the reflectance's files into a folder, each atomically."""
        folder.mkdir(parents=True, exist_ok=True)
        data = io.BytesIO()
        np.savez_compressed(data, table=self.table, seen=self.seen)
        images.write_bytes(folder / "bases.npz", data.getvalue())
        letters = "RGB" if self.weights.shape[3] == 3 else "V"
        channels = {
            f"{k}.{letter}": self.weights[:, :, k, m]
            for k in range(self.weights.shape[2])
            for m, letter in enumerate(letters)
        }
        images.write_channels(folder / "weights.exr", {**channels, "error.V": self.error})
        images.write_text(folder / FILE, json.dumps({"notes": {**self.notes, "model": MODEL}}, indent=1))

    @classmethod
    def open(cls, folder: Path) -> Bivariate:
        """Open a folder; raise LightsphereError when it is no such reflectance or is damaged."""
        path = folder / FILE
        if not path.is_file():
            raise LightsphereError(f"{folder} is not a reflectance (it has no {FILE}); make one from a shape")
        try:
            notes = dict(json.loads(path.read_text(encoding="utf-8"))["notes"])
            if notes["model"] != MODEL:
                raise LightsphereError(f"{folder} holds the model {notes['model']}, not tables; use --model {MODEL}")
            bases = read_npz(folder / "bases.npz")
            table, seen = bases["table"], bases["seen"]
            channels = images.read_channels(folder / "weights.exr")
            letters = "RGB" if "0.R" in channels else "V"
            weights = np.stack(
                [np.stack([channels[f"{k}.{x}"] for x in letters], axis=-1) for k in range(table.shape[2])], axis=2
            )
            return cls(table, seen, weights, channels["error.V"], notes)
        except BROKEN_JSON as error:
            raise LightsphereError(f"{folder} is damaged ({error!r}); run the stage that made it again") from error


@dataclass(frozen=True)
class Basis:
    """One basis BRDF in the frame of its surface (:class:`pipeline.core.brdf.Brdf`)."""

    reflectance: Bivariate
    number: int
    isotropic = True

    def evaluate(self, wi: NDArray[Any], wo: NDArray[Any]) -> NDArray[np.float64]:
        """Return f [1/sr], (N, 3), for unit directions (N, 3); grey where the weights carry the colour."""
        weights = np.zeros((len(wi), *self.reflectance.weights.shape[2:]))
        weights[:, self.number] = 1.0
        return self.reflectance.evaluate(weights, np.array([0.0, 0.0, 1.0]), wi, wo)[0]


def open_reflectance(folder: Path) -> Reflectance | Bivariate:
    """Open a reflectance folder of either model; raise LightsphereError when it is none or is damaged."""
    return Bivariate.open(folder) if read_notes(folder)["model"] == MODEL else Reflectance.open(folder)


def read_notes(folder: Path) -> dict[str, Any]:
    """Return the notes of a reflectance folder, its model among them; raise LightsphereError as opening it does."""
    try:
        notes: dict[str, Any] = dict(json.loads((folder / FILE).read_text(encoding="utf-8"))["notes"])
        notes["model"]  # one without is damaged
    except BROKEN_JSON as error:
        raise LightsphereError(f"{folder} is no reflectance, or damaged ({error!r}); make one from a shape") from error
    return notes
