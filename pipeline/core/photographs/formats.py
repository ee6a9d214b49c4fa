"""What lies in a path: a DiLiGenT folder, an RTI list, a plain folder, near lights, a stack, or photographs alone."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from ..errors import LightsphereError
from . import diligent, folder, near, stack
from .photographs import Photographs, Reader
from .settings import ImportSettings

STACKS = (".npz", ".npy")
CAPTURE = "capture.json"


def find(path: Path, settings: ImportSettings, reader: Reader) -> Photographs:
    """Describe the photographs in a path by its files, or by the format that the settings name.

    Raises
    ------
    LightsphereError
        When nothing is there that can be imported, naming what is missing.
    """
    if not path.exists():
        raise LightsphereError(f"{path} does not exist; give a folder of photographs, an .lp list or an .npz stack")
    kind = settings.format if settings.format != "auto" else recognised(path, settings)
    if kind == "stack":
        return stack.read(path, settings)
    if path.suffix.lower() == ".lp":
        settings = dataclasses.replace(settings, lights=settings.lights or str(path))
        path = path.parent
    if not path.is_dir():
        raise LightsphereError(f"{path} is no folder; as {kind} give the folder of the photographs")
    if kind in ("diligent", "near", "uncalibrated"):
        read = {"diligent": diligent.read, "near": near.read, "uncalibrated": folder.uncalibrated}[kind]
        return read(path, settings, reader)
    source = folder.light_list(path, settings.lights)
    if source is None:
        raise LightsphereError(f"{path} has no list of lights; give one by --lights")
    return folder.read(path, source, settings, reader)


def recognised(path: Path, settings: ImportSettings) -> str:
    """Return the format of a path; raise LightsphereError when it is none."""
    if path.suffix.lower() in STACKS:
        return "stack"
    if path.suffix.lower() == ".lp":
        return "lp"
    if not path.is_dir():
        raise LightsphereError(
            f"{path} is of no known format; give a folder of photographs, an .lp list or an .npz stack"
        )
    if (path / CAPTURE).is_file():
        raise LightsphereError(f"{path} is a capture already; open it with lightsphere shape")
    if (path / diligent.NAMES).is_file() and (path / diligent.INTENSITIES).is_file():
        return "diligent"
    if near.is_here(path):
        return "near"
    return "folder" if folder.light_list(path, settings.lights) else "uncalibrated"
