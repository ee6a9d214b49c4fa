"""A capture on disk: pictures under one light at a time, camera, lights, mask, and truth where it is known.

The folder holds ``capture.json``, one EXR per light, ``mask.exr`` (channel ``mask.V``) and, where truth is
known, ``truth.exr`` with the channels ``depth.V``, ``normal.X/Y/Z`` (camera space), ``position.X/Y/Z`` (world) and
``material.V``: all of them for rendered captures, the measured ones for photographed captures.
"""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import images
from .camera import Camera
from .errors import BROKEN_JSON, LightsphereError
from .lights import Lights

FILE = "capture.json"
FORMAT = "lightsphere-capture"
VERSION = 1


@dataclass(frozen=True)
class Truth:
    """What a renderer or a scan knows and a solver never sees; NaN where nothing is hit or nothing is known.

    Parameters
    ----------
    depth : (H, W) float32
        Distance along the ray [m].
    normal : (H, W, 3) float32
        Unit shading normal, camera space.
    position : (H, W, 3) float32
        Surface point, world space [m].
    material : (H, W) int32
        Material index, 0 where nothing is hit or it is not known.
    diameter : float
        Largest extent of the object [m]; depth errors are stated in per cent of it.
    """

    depth: NDArray[np.float32]
    normal: NDArray[np.float32]
    position: NDArray[np.float32]
    material: NDArray[np.int32]
    diameter: float


@dataclass(frozen=True)
class Capture:
    """An OLAT stack whose pictures are opened one at a time.

    Parameters
    ----------
    folder : Path
        Where the files are.
    camera : Camera
    lights : Lights
        L of them.
    files : tuple of str
        Name of each light's picture inside the folder, length L.
    checksums : tuple of str
        SHA-256 of each picture as it was written; ``""`` where not recorded yet.
    notes : dict
        Whatever else was written down: scene, rig, effects, seconds, diameter, ...
    """

    folder: Path
    camera: Camera
    lights: Lights
    files: tuple[str, ...]
    checksums: tuple[str, ...]
    notes: dict[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.files)

    def image(self, light: int) -> NDArray[np.float32]:
        """Read one picture as (H, W, 3) linear radiance; raise LightsphereError naming a bad file."""
        path = self.folder / self.files[light]
        image = images.read_rgb(path)
        width, height = self.camera.resolution
        if image.shape != (height, width, 3):
            raise LightsphereError(
                f"{path} is {image.shape[1]}x{image.shape[0]} pixels, the camera {width}x{height}; "
                "replace the picture or correct the camera"
            )
        return image

    def mask(self) -> NDArray[np.bool_]:
        """Read which pixels show the object, (H, W)."""
        path = self.folder / "mask.exr"
        mask = images.read_channels(path).get("mask.V")
        width, height = self.camera.resolution
        if mask is None or mask.shape != (height, width):
            raise LightsphereError(f"{path} does not fit the camera's {width}x{height} pixels; replace it")
        return np.asarray(mask > 0.5)

    def truth(self) -> Truth | None:
        """Read the truth layers, or return None where there are none. For figures only, never for solving."""
        path = self.folder / "truth.exr"
        if not path.is_file():
            return None
        channels = images.read_channels(path)
        width, height = self.camera.resolution

        def layer(name: str, axes: str, unknown: float) -> NDArray[np.float32]:
            """Return a layer; one of which no channel is there is not known."""
            names = [f"{name}.{axis}" for axis in axes]
            if not channels.keys() & set(names):
                return np.full((height, width, len(axes)), unknown, np.float32)
            return np.stack([channels[one] for one in names], axis=-1)

        if any(plane.shape != (height, width) for plane in channels.values()):
            raise LightsphereError(f"{path} does not fit the camera's {width}x{height} pixels; delete or replace it")
        try:
            return Truth(
                depth=layer("depth", "V", np.nan)[..., 0],
                normal=layer("normal", "XYZ", np.nan),
                position=layer("position", "XYZ", np.nan),
                material=layer("material", "V", 0)[..., 0].astype(np.int32),
                diameter=float(self.notes["diameter"]),
            )
        except KeyError as error:
            raise LightsphereError(f"{path} or {FILE} lacks {error}; delete {path.name} or capture again") from error

    def changed(self) -> list[str]:
        """Return the pictures whose bytes are not those recorded when they were written, or that are missing.

        Pictures whose checksum was never recorded are left out.
        """
        return [
            name
            for name, recorded in zip(self.files, self.checksums, strict=True)
            if recorded and not images.is_intact(self.folder / name, recorded)
        ]

    def damaged(self) -> list[str]:
        """Return all files, the layers beside the pictures, too, that are missing or not as they were written.

        Raises
        ------
        LightsphereError
            When it is not readable what was recorded.
        """
        try:
            beside = {str(name): str(recorded) for name, recorded in self.notes.get("sha256", {}).items()}
            layers = [name for name, recorded in beside.items() if not images.is_intact(self.folder / name, recorded)]
            return self.changed() + layers
        except BROKEN_JSON as error:
            raise LightsphereError(f"{self.folder / FILE} is damaged ({error!r}); capture again") from error

    def select(self, indices: NDArray[np.int64]) -> Capture:
        """Return the capture restricted to some of its lights."""
        return dataclasses.replace(
            self,
            lights=self.lights.select(indices),
            files=tuple(self.files[i] for i in indices),
            checksums=tuple(self.checksums[i] for i in indices),
        )

    def save(self) -> None:
        """Write ``capture.json`` atomically."""
        entries = [
            {"file": name, "sha256": digest, **light}
            for name, digest, light in zip(self.files, self.checksums, self.lights.as_json(), strict=True)
        ]
        value = {
            "format": FORMAT,
            "version": VERSION,
            "camera": self.camera.as_json(),
            "light_kind": self.lights.kind,
            "lights": entries,
            "notes": self.notes,
        }
        images.write_text(self.folder / FILE, json.dumps(value, indent=1))

    @classmethod
    def open(cls, folder: Path) -> Capture:
        """Open a capture folder.

        Raises
        ------
        LightsphereError
            When the folder is not a capture, or its description is damaged; pictures are checked when they are read.
        """
        path = folder / FILE
        if not path.is_file():
            raise LightsphereError(
                f"{folder} is not a capture (it has no {FILE}); make one with lightsphere capture or import"
            )
        try:
            value = json.loads(path.read_text(encoding="utf-8"))
            entries = value["lights"]
            if value["format"] != FORMAT or value["version"] != VERSION:
                raise LightsphereError(f"{path} is of format {value['format']} {value['version']}; capture again")
            return cls(
                folder=folder,
                camera=Camera.from_json(value["camera"]),
                lights=Lights.from_json(value["light_kind"], entries),
                files=tuple(str(entry["file"]) for entry in entries),
                checksums=tuple(str(entry.get("sha256", "")) for entry in entries),
                notes=dict(value.get("notes", {})),
            )
        except BROKEN_JSON as error:
            raise LightsphereError(
                f"{path} is damaged ({error!r}); capture again, finished pictures are kept"
            ) from error


def with_lights(capture: Capture, lights: Lights, folder: Path) -> Capture:
    """Write a capture of the same pictures, which stay where they are, under other lights.

    Raises
    ------
    LightsphereError
        When the folder is the capture's own.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if folder.samefile(capture.folder):
        raise LightsphereError(f"{folder} is the capture that is read; choose another folder for the result")
    for name in ("mask.exr", "truth.exr"):
        if (capture.folder / name).is_file():
            shutil.copyfile(capture.folder / name, folder / name)
    files = tuple(os.path.relpath(capture.folder / name, folder) for name in capture.files)
    made = dataclasses.replace(capture, folder=folder, lights=lights, files=files)
    made.save()
    return made
