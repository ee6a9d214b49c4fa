"""A folder of photographs with a list of lights beside them, or without one."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from .. import light_file
from ..errors import LightsphereError
from ..lights import Lights
from . import files
from .photographs import Photographs, Reader, distant, unknown
from .settings import ImportSettings
from .shots import Group, groups, named, shot

EQUAL_STRENGTH = "lights of equal strength"  # assumed where a list states no intensities
LISTS = ("lights.lp", "lights.txt", "lights.csv", "lights.json", "light_directions.txt")


def light_list(folder: Path, stated: str) -> Path | None:
    """Return the list of lights: the stated one, the only .lp of the folder, or one named as usual."""
    if stated:
        path = Path(stated)
        if not path.is_file():
            raise LightsphereError(f"the list of lights {path} is missing; correct --lights")
        return path
    lists = sorted(path for path in folder.iterdir() if path.suffix.lower() == ".lp")
    if len(lists) > 1:
        names = ", ".join(path.name for path in lists)
        raise LightsphereError(f"{folder} holds several lists of lights ({names}); choose one by --lights")
    return lists[0] if lists else next((folder / name for name in LISTS if (folder / name).is_file()), None)


def read(folder: Path, source: Path, settings: ImportSettings, reader: Reader) -> Photographs:
    """Describe a folder of photographs under distant lights that a file lists.

    A list that names pictures chooses and orders them; another one counts them in their natural order.

    Raises
    ------
    LightsphereError
        When list and photographs do not fit together.
    """
    entries = light_file.entries(source)
    lights, assumed = directions(entries, source)
    shots = tuple(exposures for _, exposures in matched(folder, settings, reader, entries, source))
    kind = "lp" if source.suffix.lower() == ".lp" else "folder"
    return described(folder, settings, reader, Photographs(kind, shots, lights, assumed=assumed))


def uncalibrated(folder: Path, settings: ImportSettings, reader: Reader) -> Photographs:
    """Describe a folder of photographs under unknown lights."""
    found = groups(folder, settings.pictures, settings.bracket, False, reader)
    shots = tuple(exposures for _, exposures in found)
    return described(folder, settings, reader, Photographs("uncalibrated", shots, unknown(len(shots))))


def matched(
    folder: Path, settings: ImportSettings, reader: Reader, entries: list[dict[str, Any]], source: Path
) -> list[Group]:
    """Return the photographs of each entry of a list of lights; raise LightsphereError when they do not fit."""
    names = [entry["file"] for entry in entries]
    found = groups(folder, settings.pictures, settings.bracket, all(names), reader)
    if all(names):
        return named(found, names, source)
    if len(found) != len(entries):
        raise LightsphereError(
            f"{source} lists {len(entries)} lights, but {folder} holds photographs of {len(found)}; add or remove "
            "some, say by --pictures which ones count, or by --bracket how many belong to a light"
        )
    return found


def directions(entries: list[dict[str, Any]], source: Path) -> tuple[Lights, tuple[str, ...]]:
    """Return listed lights as distant ones, and what had to be assumed for it."""
    position = np.array([entry["position"] for entry in entries], np.float64)
    length = np.linalg.norm(position, axis=1)
    if (zero := np.flatnonzero(~(length > 0))).size:
        raise LightsphereError(f"{source}: the direction of light {zero[0] + 1} is zero or not a number; correct it")
    stated = [entry["intensity"] for entry in entries]
    lights = distant(position, np.array([[np.pi] * 3 if e is None else e for e in stated], np.float64))
    try:
        lights.check()
    except LightsphereError as error:
        raise LightsphereError(f"{source}: {error}") from error
    assumed = []
    if (abs(length - 1) > light_file.UNIT_TOLERANCE).any():
        assumed.append(f"positions in {source.name} taken as directions")
    if all(e is None for e in stated):
        assumed.append(EQUAL_STRENGTH)
    return lights, tuple(assumed)


def described(folder: Path, settings: ImportSettings, reader: Reader, made: Photographs) -> Photographs:
    """Return the photographs with the mask and the ambient picture that lie beside them."""
    mask = Path(settings.mask) if settings.mask else files.special(folder, "mask")
    ambient = files.special(folder, "ambient")
    return dataclasses.replace(
        made,
        mask=shot(mask, reader) if mask else None,
        ambient=shot(ambient, reader) if ambient else None,
    )
