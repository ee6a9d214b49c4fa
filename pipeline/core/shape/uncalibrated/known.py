"""What is known before the photographs are looked at: which cues are believed, some lights, normals of a rough mesh."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ... import light_file
from ...capture import Capture
from ...errors import LightsphereError
from .. import Shape

Array = NDArray[np.float64]

CUES = ("outline", "surface", "strengths", "highlights", "shadows", "albedo")


@dataclass(frozen=True)
class Known:
    """What is known, camera space.

    Parameters
    ----------
    cues : frozenset of str
        Of :data:`CUES`, those that are believed.
    lights : (N,) int
        Numbers of the lights whose direction is known.
    directions : (N, 3) float64
        Unit directions to them.
    normals : (H, W, 3) float64, optional
        Of a rough mesh, NaN where it has none.
    """

    cues: frozenset[str] = frozenset(CUES)
    lights: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    directions: Array = field(default_factory=lambda: np.zeros((0, 3)))
    normals: Array | None = None

    def without(self, cue: str) -> Known:
        """Return the same, one cue less believed."""
        return dataclasses.replace(self, cues=self.cues - {cue})


def known(capture: Capture, cues: str, lights: str, proxy: Shape | None) -> Known:
    """Return what a user says is known.

    Parameters
    ----------
    capture : Capture
    cues : str
        Names of :data:`CUES`, commas between; empty for all.
    lights : str
        File of lights, see :mod:`pipeline.core.light_file`, each with the name of its photograph; their places are
        directions in the capture's world. Empty for none.
    proxy : Shape, optional
        Of the same camera; its normals are taken.

    Raises
    ------
    LightsphereError
        For a cue or a photograph that there is not, or a file that is no list of lights.
    """
    believed = {word.strip() for word in cues.split(",") if word.strip()} or set(CUES)
    if not believed <= set(CUES):
        strange = ", ".join(sorted(believed - set(CUES)))
        raise LightsphereError(f"{strange} is no cue; name some of {', '.join(CUES)}, commas between")
    numbers, directions = _known_lights(capture, Path(lights)) if lights else (np.zeros(0, np.int64), np.zeros((0, 3)))
    normals = None if proxy is None else proxy.normal.astype(np.float64)
    if normals is not None and not np.isfinite(normals[capture.mask()]).any():
        raise LightsphereError("the proxy mesh is nowhere on the object's pixels; place it where the object stands")
    return Known(frozenset(believed), numbers, directions, normals)


def _known_lights(capture: Capture, path: Path) -> tuple[NDArray[np.int64], Array]:
    """Return number and unit direction, camera space, of every light of a file."""
    names = {name: number for number, name in enumerate(capture.files)}
    photographs = capture.notes.get("photographs", [])
    if len(photographs) >= len(capture) and len(capture.notes.get("exposures", [])) == len(capture):
        per_light = np.cumsum([0, *(max(len(times), 1) for times in capture.notes["exposures"])])
        names |= {photographs[first]["file"]: number for number, first in enumerate(per_light[:-1])}
    numbers, directions = [], []
    for entry in light_file.entries(path):
        if entry["file"] not in names:
            said = f"{entry['file']!r} is no photograph" if entry["file"] else "a light lacks its photograph's name"
            raise LightsphereError(
                f"{path}: {said} of {capture.folder}; write NAME X Y Z, as in {next(iter(names))} 0 0 1"
            )
        length = float(np.linalg.norm(entry["position"]))
        if not length > 0:
            raise LightsphereError(f"{path}: the direction of {entry['file']} has no length; correct it")
        numbers.append(names[entry["file"]])
        directions.append(np.array(entry["position"]) / length)
    if len(set(numbers)) < len(numbers):
        raise LightsphereError(f"{path} names a photograph twice; keep one direction of each")
    return np.array(numbers, np.int64), np.array(directions) @ capture.camera.to_world[:3, :3]
