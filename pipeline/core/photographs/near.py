"""Near lights with a calibrated pinhole camera, as LUCES and the LED rigs of Quéau et al. describe them.

Two layouts are read. ``light.mat`` and ``camera.mat`` (here or in the folder above) hold S (L, 3), the lights'
positions in mm about the camera's centre with x right, y down, z forward; Phi (L, 3) or (L, 1), their intensities;
Dir (L, 3), their axes; mu (L,), their anisotropy; K (3, 3), the camera's intrinsics, with the first pixel's centre at
(1, 1). ``lights.json`` holds ``{"camera": {...}, "lights": [{"position", "intensity", "axis", "mu", "file"}]}`` in
metres and this program's axes (x right, y up, z to the viewer), the camera as in a ``capture.json``.

A source shines I cos(theta)^mu, theta from its axis (Quéau, Durix, Wu, Cremers, Lauze, Durou, "LED-based photometric
stereo: modeling, calibration and numerical solution", 2018, eq. 2.8). The capture's intensity is I, that on the axis;
axis and mu are kept in the notes under ``anisotropy``. Lens distortion is not modelled: undistort the pictures.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import light_file
from ..camera import Camera
from ..errors import BROKEN_JSON, LightsphereError
from ..lights import Lights
from . import matlab
from .folder import EQUAL_STRENGTH, described, matched
from .photographs import Photographs, Reader
from .settings import ImportSettings

LIGHT, CAMERA, JSON = "light.mat", "camera.mat", "lights.json"
MM = 1e-3
TO_OURS = np.array([1.0, -1.0, -1.0])  # y down, z forward to y up, z to the viewer


def is_here(folder: Path) -> bool:
    """Return whether a folder has near lights and a camera in one of the two layouts."""
    if _beside(folder, LIGHT) and _beside(folder, CAMERA):
        return True
    try:
        return "camera" in json.loads((folder / JSON).read_text(encoding="utf-8"))
    except BROKEN_JSON:  # said when the list is read as one without a camera
        return False


def read(folder: Path, settings: ImportSettings, reader: Reader) -> Photographs:
    """Describe photographs under near lights; raise LightsphereError naming what is wrong."""
    light = _beside(folder, LIGHT)
    if light:
        entries, mu, axis = _from_matlab(light)
        source = light
    else:
        source = folder / JSON
        entries, mu, axis = _from_json(source)
    found = matched(folder, settings, reader, entries, source)
    shots = tuple(group for _, group in found)
    if light:
        height, width = shots[0][0].read().pixels.shape[:2]
        camera = _camera(_beside(folder, CAMERA), width, height)
    else:
        camera = Camera.from_json(json.loads(source.read_text(encoding="utf-8"))["camera"])
    position = np.array([entry["position"] for entry in entries], np.float64)
    intensity = np.array([entry["intensity"] or [1.0] * 3 for entry in entries], np.float64)
    lights = Lights("near", position, intensity, np.full(len(entries), 2))
    try:
        lights.check()
    except LightsphereError as error:
        raise LightsphereError(f"{source}: {error}") from error
    assumed: tuple[str, ...] = () if all(entry["intensity"] for entry in entries) else (EQUAL_STRENGTH,)
    notes = {}
    if (mu > 0).any():
        notes["anisotropy"] = {"mu": mu.tolist(), "axis": axis.tolist()}
        assumed += ("anisotropy of the lights noted, not applied",)
    made = Photographs("near", shots, lights, camera=camera, assumed=assumed, notes=notes)
    return described(folder, settings, reader, made)


def _beside(folder: Path, name: str) -> Path | None:
    return next((place / name for place in (folder, folder.resolve().parent) if (place / name).is_file()), None)


def _from_json(path: Path) -> tuple[list[dict[str, Any]], NDArray[np.float64], NDArray[np.float64]]:
    entries = light_file.entries(path)
    try:
        listed = json.loads(path.read_text(encoding="utf-8"))["lights"]
        mu = np.array([float(light.get("mu", 0)) for light in listed])
        axis = np.array([light.get("axis", [0, 0, 0]) for light in listed], np.float64).reshape(-1, 3)
    except BROKEN_JSON as error:
        raise LightsphereError(f"{path}: an axis or mu is not readable ({error!r}); correct it") from error
    return entries, mu, axis


def _from_matlab(path: Path) -> tuple[list[dict[str, Any]], NDArray[np.float64], NDArray[np.float64]]:
    values = matlab.read(path)
    try:
        position = np.asarray(values["S"], np.float64) * MM * TO_OURS
        count = len(position)
        intensity = np.broadcast_to(np.asarray(values.get("Phi", np.ones((count, 1))), np.float64), (count, 3))
        mu = np.asarray(values.get("mu", np.zeros(count)), np.float64).reshape(count)
        axis = np.asarray(values.get("Dir", np.zeros((count, 3))), np.float64).reshape(count, 3) * TO_OURS
    except (KeyError, ValueError) as error:
        raise LightsphereError(f"{path} lacks or misshapes {error}; it needs S (L, 3), Phi, Dir and mu") from error
    return (
        [
            {"position": p.tolist(), "intensity": i.tolist(), "file": ""}
            for p, i in zip(position, intensity, strict=True)
        ],
        mu,
        axis,
    )


def _camera(path: Path | None, width: int, height: int) -> Camera:
    if path is None:
        raise LightsphereError(f"{CAMERA} is missing beside {LIGHT}; copy it there")
    try:
        k = np.asarray(matlab.read(path)["K"], np.float64).reshape(3, 3)
    except (KeyError, ValueError) as error:
        raise LightsphereError(f"{path} lacks or misshapes {error}; it needs the intrinsics K (3, 3)") from error
    k = k.T if k[0, 2] == 0 else k  # MATLAB's toolbox writes it transposed
    value = {"model": "pinhole", "to_world": np.eye(4), "resolution": (width, height)}
    return Camera.from_json(value | {"focal": (k[0, 0], k[1, 1]), "centre": (k[0, 2] - 0.5, k[1, 2] - 0.5)})
