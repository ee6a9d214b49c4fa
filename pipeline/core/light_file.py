"""Measured lights from a file: an RTI .lp list, plain text, CSV, or JSON.

Text holds one light a line, blank lines and ``#`` comments aside::

    [NAME] X Y Z [I | I_R I_G I_B] [inner | outer]

X Y Z is a position [m], I a radiant intensity [W/sr]; in a .lp list the name must be there, and it may hold blanks.
Commas separate as blanks do; a first line of a .csv without numbers is its heading. A first line that is one number
states how many lights follow. Where every light is at distance 1 from the origin and none has a surface,
as in RTI's own lists, they are distant lights and X Y Z their directions.

JSON holds a list of ``{"position": [X, Y, Z], "intensity": [R, G, B], "surface": "inner", "file": NAME}``, of which
only the position is required; a ``capture.json`` can be given, too.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import BROKEN_JSON, LightsphereError
from .lights import SURFACES, Lights

UNIT_TOLERANCE = 2e-3  # RTI lists carry three or more digits


def read(path: Path, centre: NDArray[np.float64]) -> Lights:
    """Read lights from a file.

    Parameters
    ----------
    path : Path
    centre : (3,) float64
        Of the object, world [m]; where the file states no intensity, a white Lambertian surface there that faces a
        light at the median distance reflects a radiance of 1.

    Raises
    ------
    LightsphereError
        Naming the file and the line or light that is wrong.
    """
    found = entries(path)
    position = np.array([entry["position"] for entry in found], np.float64)
    surface = np.array([SURFACES.index(entry["surface"]) for entry in found], np.int64)
    radius = np.linalg.norm(position, axis=1)
    is_distant = bool((abs(radius - 1) < UNIT_TOLERANCE).all() and (surface == 2).all())
    usual = np.pi * (1.0 if is_distant else float(np.median(((position - centre) ** 2).sum(axis=1))))
    stated = [entry["intensity"] for entry in found]
    intensity = np.array([[usual] * 3 if value is None else value for value in stated], np.float64)
    if is_distant:
        position /= radius[:, None]
    lights = Lights("distant" if is_distant else "near", position, intensity, surface)
    try:
        lights.check()
    except LightsphereError as error:
        raise LightsphereError(f"{path}: {error}") from error
    return lights


def entries(path: Path) -> list[dict[str, Any]]:
    """Return what a file says of each light: ``position``, ``intensity`` or None, ``surface``, its picture's ``file``.

    Raises
    ------
    LightsphereError
        When the file is no list of lights, naming the line or light that is wrong.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise LightsphereError(f"{path} is not readable as text ({error}); give a list of lights") from error
    found = _from_json(path, text) if path.suffix.lower() == ".json" else _from_text(path, text)
    if not found:
        raise LightsphereError(f"{path} lists no lights; write one a line as X Y Z")
    return found


def _from_text(path: Path, text: str) -> list[dict[str, Any]]:
    rows = [(number, _words(line.split("#")[0])) for number, line in enumerate(text.splitlines(), start=1)]
    rows = [(number, words) for number, words in rows if words]
    if rows and path.suffix.lower() == ".csv" and not any(map(_is_number, rows[0][1])):
        rows = rows[1:]
    promised = None
    if rows and len(rows[0][1]) == 1:
        promised = _number(path, *rows[0])
        rows = rows[1:]
    if promised is not None and promised != len(rows):
        raise LightsphereError(f"{path} promises {promised:g} lights and lists {len(rows)}; correct its first line")
    return [_light(path, number, words) for number, words in rows]


def _light(path: Path, number: int, words: list[str]) -> dict[str, Any]:
    surface, name = "", ""
    if words[-1] in SURFACES:
        surface = words.pop()
    if path.suffix.lower() == ".lp":
        start = max([1, *(i + 1 for i, word in enumerate(words) if not _is_number(word))])
        name, words = " ".join(words[:start]), words[start:]
    elif not _is_number(words[0]):
        name, words = words[0], words[1:]
    values = [_number(path, number, [word]) for word in words]
    if len(values) not in (3, 4, 6):
        raise LightsphereError(
            f"{path} line {number} has {len(values)} numbers; a light is X Y Z, X Y Z I or X Y Z I_R I_G I_B"
        )
    intensity = {3: None, 4: values[3:] * 3, 6: values[3:]}[len(values)]
    return {"position": values[:3], "intensity": intensity, "surface": surface, "file": name}


def _words(line: str) -> list[str]:
    return [word.strip() for word in line.split(",")] if "," in line else line.split()


def _number(path: Path, number: int, words: list[str]) -> float:
    if not _is_number(words[0]):
        raise LightsphereError(f"{path} line {number}: {words[0]!r} is not a number; correct it")
    return float(words[0])


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _from_json(path: Path, text: str) -> list[dict[str, Any]]:
    try:
        value = json.loads(text)
        entries = value["lights"] if isinstance(value, dict) else value
        found: list[dict[str, Any]] = []
        for entry in entries:
            position = [float(x) for x in entry["position"]]
            intensity = entry.get("intensity")
            channels = None if intensity is None else [float(x) for x in np.broadcast_to(intensity, 3)]
            surface = str(entry.get("surface", ""))
            if len(position) != 3 or surface not in SURFACES:
                raise ValueError(f"light {len(found)}")
            name = str(entry.get("file", ""))
            found.append({"position": position, "intensity": channels, "surface": surface, "file": name})
    except BROKEN_JSON as error:
        raise LightsphereError(
            f"{path} is not a list of lights ({error!r}); each needs a position of three numbers"
        ) from error
    return found
