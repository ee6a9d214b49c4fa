"""What is told of photographs as they pass: where the object may be, what is saturated, which lights are at fault."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import LightsphereError
from ..lights import Lights

NEEDED = 3  # lights that determine a normal
SHADOW = 0.01  # share of the bright pixels' value from which a pixel is lit
CLIPPED_PIXELS = 16  # this many equal largest values below full scale are where a sensor of fewer bits clips
COINCIDENT = 2e-3  # [rad], or share of the rig's extent
FLAT = 0.05  # smallest over largest singular value of the directions below which they lie in a plane
NOTABLE = 1.0  # share of the object's pixels that deserves a word [%]


class Survey:
    """Statistics over linear pictures that are shown one after the other and not kept."""

    def __init__(self) -> None:
        self.count = 0
        self._brightest = np.zeros((NEEDED, 0, 0), np.float32)
        self._saturated = np.zeros((0, 0), np.int32)
        self._largest = -np.inf
        self._at_largest = np.zeros((0, 0), np.int32)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width [px]."""
        return self._saturated.shape[0], self._saturated.shape[1]

    def add(self, linear: NDArray[np.float32], limit: float) -> None:
        """Take in a picture (H, W, 3) that is saturated from a limit on."""
        value = np.maximum(np.maximum(linear[..., 0], linear[..., 1]), linear[..., 2])
        if not self.count:
            self._brightest = np.full((NEEDED, *value.shape), -np.inf, np.float32)
            self._saturated = np.zeros(value.shape, np.int32)
        self.count += 1
        passed_on = value
        for i in reversed(range(NEEDED)):  # the largest first; each place passes the smaller value on to the next
            kept = np.maximum(self._brightest[i], passed_on)
            passed_on = np.minimum(self._brightest[i], passed_on)
            self._brightest[i] = kept
        self._saturated += value >= limit
        highest = float(value.max())
        if highest > self._largest:
            self._largest, self._at_largest = highest, np.zeros(value.shape, np.int32)
        if highest == self._largest:
            self._at_largest += value == highest

    def saturation(self, limit: float) -> float:
        """Return the value from which a pixel is saturated: full scale, or less where a sensor clips below it.

        Sensors of 12 or 14 bits in files of 16 clip below the file's full scale: many pixels share the largest value.
        In 8 bits many do so by chance; there, and for floats, the limit stays.
        """
        below = np.isfinite(limit) and limit > 0.999 and self._largest < limit
        if below and int(np.minimum(self._at_largest, 1).sum()) >= CLIPPED_PIXELS:
            self._saturated = self._at_largest
            return self._largest * (1 - 1e-6)
        return limit

    def lit(self) -> NDArray[np.bool_]:
        """Return the pixels that at least three lights (or all, of fewer) make brighter than a shadow."""
        third = self._brightest[max(NEEDED - self.count, 0)]
        return np.asarray(third > SHADOW * max(float(np.percentile(third, 99)), 0.0))

    def saturated_pct(self, mask: NDArray[np.bool_]) -> float:
        """Return the share of the object's observations that are saturated [%]."""
        return 100.0 * float(self._saturated[mask].mean()) / self.count

    def check(self, mask: NDArray[np.bool_], source: Path) -> None:
        """Raise LightsphereError for an object of which nothing can be seen."""
        if not mask.any():
            raise LightsphereError(f"the photographs in {source} show no object; give a mask by --mask")
        if not float(self._brightest[-1][mask].max()) > 0:
            raise LightsphereError(f"the object is black in every photograph in {source}; expose longer")
        if 100 * self._blown(mask) >= 50:
            raise LightsphereError(
                f"{100 * self._blown(mask):.0f} % of the object in {source} are saturated in nearly every photograph; "
                "expose shorter, or add shorter exposures"
            )

    def warnings(self, mask: NDArray[np.bool_]) -> list[str]:
        """Return in words what lowers the quality of a result."""
        share = 100 * self._blown(mask)
        return [f"{share:.1f} % of the object is saturated in nearly every photograph"] if share >= NOTABLE else []

    def _blown(self, mask: NDArray[np.bool_]) -> float:
        """Return the share of the object that fewer than three photographs show unsaturated."""
        return float((self.count - self._saturated[mask] < min(NEEDED, self.count)).mean())


def light_warnings(lights: Lights) -> list[str]:
    """Return in words which lights are of little use; raise LightsphereError when all stand behind the object."""
    found = []
    if len(lights) < NEEDED:
        found.append(f"{len(lights)} lights do not determine a normal; photograph at least {NEEDED}")
    if lights.kind == "unknown":
        return found
    if len(lights) > 1:
        extent = 1.0 if lights.kind == "distant" else float(np.ptp(lights.position, axis=0).max())
        distance, nearest = cKDTree(lights.position).query(lights.position, k=2)
        first = int(np.argmin(distance[:, 1]))
        if distance[first, 1] <= COINCIDENT * extent:
            other = next(int(light) for light in nearest[first] if light != first)
            found.append(f"lights {min(first, other) + 1} and {max(first, other) + 1} coincide")
    if lights.kind == "distant":
        unit = lights.position
        behind = np.flatnonzero(unit[:, 2] < 0)
        if len(behind) == len(lights):
            raise LightsphereError(
                "every light stands behind the object; directions point to the light, z to the viewer"
            )
        if behind.size:
            found.append(f"light {behind[0] + 1} stands behind the object ({behind.size} do)")
        if len(lights) >= NEEDED:
            spread = np.linalg.svd(unit, compute_uv=False)
            if spread[-1] < FLAT * spread[0]:
                found.append("the lights lie in one plane with the object; normals are not determined across it")
    return found
