"""Emitters as a line of JSON: how Blender's window tells a worker what shines."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import BROKEN_JSON, LightsphereError
from .emitters import Emitter
from .profiles import SpotProfile, SpreadProfile, across

PROFILES = {one.__name__: one for one in (SpotProfile, SpreadProfile)}


def as_line(emitters: Sequence[Emitter]) -> str:
    """Return emitters as one line of JSON, numbers in full precision."""
    return json.dumps([_as_json(emitter) for emitter in emitters])


def of_line(line: str) -> list[Emitter]:
    """Return the emitters of a line; raise LightsphereError for any other."""
    try:
        return [_from_json(value) for value in json.loads(line)]
    except BROKEN_JSON as error:
        raise LightsphereError(f"{line[:60]!r} is no list of emitters; send one of Lightsphere's own") from error


def _as_json(emitter: Emitter) -> dict[str, Any]:
    profile: Any = emitter.profile
    if profile is across:
        profile = {"name": "across"}
    elif profile is not None:
        profile = {"name": type(profile).__name__, **dataclasses.asdict(profile)}
    return {
        "place": emitter.place.tolist(),
        "intensity": emitter.intensity.tolist(),
        "distant": emitter.distant,
        "facing": None if emitter.facing is None else emitter.facing.tolist(),
        "to_world": None if emitter.to_world is None else emitter.to_world.tolist(),
        "profile": profile,
    }


def _from_json(value: dict[str, Any]) -> Emitter:
    profile: Any = value["profile"]
    if profile is not None:
        name = profile.pop("name")
        profile = across if name == "across" else PROFILES[name](**profile)
    return Emitter(
        place=np.array(value["place"], np.float64),
        intensity=np.array(value["intensity"], np.float64),
        distant=bool(value["distant"]),
        facing=None if value["facing"] is None else np.array(value["facing"], np.float64),
        to_world=None if value["to_world"] is None else np.array(value["to_world"], np.float64),
        profile=profile,
    )
