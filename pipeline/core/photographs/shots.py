"""Photographs grouped into one set of exposures per light, and matched with the names of a list of lights."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path, PureWindowsPath

from ..errors import LightsphereError
from . import files
from .photographs import Reader, Shot

TIMES = "exposures.txt"
Group = tuple[str, tuple[Shot, ...]]  # the name that a list of lights may use, and the exposures


def groups(folder: Path, pattern: str, bracket: int, every: bool, read: Reader) -> list[Group]:
    """Return the photographs of each light, in natural order.

    Each subfolder is a light where the folder itself holds no pictures. Otherwise names that end in an exposure time,
    as ``light_003_exp_0.01.png`` or ``light_003_exp_1-60.jpg``, tell which belong together, or ``bracket`` says how
    many follow each other. Times come from the names, else from ``exposures.txt`` (lines of NAME SECONDS), else from
    the files themselves.

    Parameters
    ----------
    folder : Path
    pattern : str
        Of the photographs' names, empty for :func:`.files.series`.
    bracket : int
    every : bool
        Take every picture of the folder: a list of lights names those that count.
    read : Reader

    Raises
    ------
    LightsphereError
        When there are none, or they cannot be grouped.
    """
    if not folder.is_dir():
        raise LightsphereError(f"{folder} is no folder; give the folder of the photographs")
    inner = sorted((path for path in folder.iterdir() if path.is_dir() and files.pictures(path)), key=files.natural)
    if inner and not files.pictures(folder):
        return [(path.name, _shots(path, files.series(path, pattern), read)) for path in inner]
    paths = files.pictures(folder) if every and not pattern else files.series(folder, pattern)
    if bracket > 1:
        if len(paths) % bracket:
            raise LightsphereError(
                f"{folder} holds {len(paths)} photographs, which is no multiple of --bracket {bracket}"
            )
        chunks = [paths[i : i + bracket] for i in range(0, len(paths), bracket)]
        return [(chunk[0].name, _shots(folder, chunk, read)) for chunk in chunks]
    by_light: dict[str, list[Path]] = {}
    for path in paths:
        timed = files.SECONDS.search(path.stem)
        by_light.setdefault(path.stem[: timed.start()] if timed else path.name, []).append(path)
    return [(name, _shots(folder, chunk, read)) for name, chunk in by_light.items()]


def exposures(folder: Path, read: Reader) -> tuple[Shot, ...]:
    """Return the photographs of a folder as exposures of one thing; raise LightsphereError where there are none."""
    return _shots(folder, files.series(folder, ""), read)


def named(found: Sequence[Group], names: Sequence[str], source: Path) -> list[Group]:
    """Return the groups that a list names, in the list's order; folders and types in the names do not count.

    Raises
    ------
    LightsphereError
        Naming the first photograph that is missing or named twice.
    """
    by_name = {name.lower(): (name, shots) for name, shots in found}
    worst_first = sorted(found, key=lambda group: -_rank(group[0]))
    by_stem = {_stem(name): (name, shots) for name, shots in worst_first}
    chosen: list[Group] = []
    for name in names:
        plain = PureWindowsPath(name).name.lower()  # takes both / and \
        group = by_name.get(plain) or by_stem.get(_stem(plain))
        if group is None:
            raise LightsphereError(
                f"{source} names {name}, but no such photograph is there; add it or correct the list"
            )
        if any(group[0] == other for other, _ in chosen):
            raise LightsphereError(f"{source} names {group[0]} twice; every light needs a photograph of its own")
        chosen.append(group)
    return chosen


def shot(path: Path, read: Reader, seconds: float | None = None) -> Shot:
    """Return one file as a shot."""
    return Shot(path.name, partial(read, path), path, seconds)


def _shots(folder: Path, paths: Sequence[Path], read: Reader) -> tuple[Shot, ...]:
    listed = _times(folder / TIMES)
    return tuple(shot(path, read, _named_time(path) or listed.get(path.name.lower())) for path in paths)


def _named_time(path: Path) -> float | None:
    found = files.SECONDS.search(path.stem)
    if found is None:
        return None
    return (float(found[1]) / float(found[2] or 1)) or None


def _times(path: Path) -> dict[str, float]:
    if not path.is_file():
        return {}
    times: dict[str, float] = {}
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            name, seconds = " ".join(words[:-1]), float(words[-1])
        except ValueError:
            seconds = 0.0
        if not (words[:-1] and 0 < seconds < float("inf")):
            raise LightsphereError(f"{path} line {number} is not NAME SECONDS with a positive time; correct it")
        times[name.lower()] = seconds
    return times


def _stem(name: str) -> str:
    """Return a name without the ending of a picture, in small letters."""
    path = PureWindowsPath(name.lower())
    return path.stem if path.suffix in files.PREFERRED else path.name


def _rank(name: str) -> int:
    suffix = PureWindowsPath(name.lower()).suffix
    return files.PREFERRED.index(suffix) if suffix in files.PREFERRED else 0
