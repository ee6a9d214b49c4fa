"""The lights of a capture: near point lights with position and radiant intensity, or distant ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import BROKEN_JSON, LightsphereError

KINDS = ("near", "distant", "unknown")
SURFACES = ("inner", "outer", "")


@dataclass(frozen=True)
class Lights:
    """All lights of a capture, of one kind.

    Parameters
    ----------
    kind : str
        ``"near"`` (points), ``"distant"`` (directions) or ``"unknown"``.
    position : (L, 3) float64
        Near: position in the world [m]. Distant: unit direction to the light. Unknown: zeros.
    intensity : (L, 3) float64
        Near: radiant intensity I per colour [W/sr]. Distant: irradiance E on a surface that faces the light [W/m^2].
    surface : (L,) int
        Index into :data:`SURFACES`: 0 on the inner surface, 1 on the outer one, 2 neither.
    """

    kind: str
    position: NDArray[np.float64]
    intensity: NDArray[np.float64]
    surface: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.position)

    def on(self, surface: str) -> NDArray[np.int64]:
        """Return the indices of the lights on ``"inner"`` or ``"outer"``, in order."""
        return np.flatnonzero(self.surface == SURFACES.index(surface))

    def select(self, indices: NDArray[np.int64]) -> Lights:
        """Return the lights of the given indices."""
        return Lights(self.kind, self.position[indices], self.intensity[indices], self.surface[indices])

    def as_json(self) -> list[dict[str, Any]]:
        """Return one plain JSON value per light."""
        return [
            {"position": p.tolist(), "intensity": i.tolist(), "surface": SURFACES[s]}
            for p, i, s in zip(self.position, self.intensity, self.surface, strict=True)
        ]

    @classmethod
    def from_json(cls, kind: str, values: list[dict[str, Any]]) -> Lights:
        """Make lights from :meth:`as_json`'s values; raise LightsphereError when they are not lights."""
        try:
            position = np.array([v["position"] for v in values], np.float64).reshape(len(values), 3)
            intensity = np.array([v["intensity"] for v in values], np.float64).reshape(len(values), 3)
            surface = np.array([SURFACES.index(v["surface"]) for v in values], np.int64)
        except BROKEN_JSON as error:
            raise LightsphereError(f"the lights are not readable ({error}); write the capture again") from error
        lights = cls(kind, position, intensity, surface)
        lights.check()
        return lights

    def check(self) -> None:
        """Raise LightsphereError for lights that cannot have made pictures."""
        if self.kind not in KINDS:
            raise LightsphereError(f"the kind of lights is {self.kind!r}; it must be one of {', '.join(KINDS)}")
        for name, values in (("position", self.position), ("intensity", self.intensity)):
            bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
            if len(bad):
                raise LightsphereError(f"light {bad[0]} has a {name} that is not a number; correct the lights")
        dark = np.flatnonzero(~(self.intensity >= 0).all(axis=1) | ~(self.intensity > 0).any(axis=1))
        if self.kind != "unknown" and len(dark):
            raise LightsphereError(f"light {dark[0]} has no positive intensity; correct or remove it")
