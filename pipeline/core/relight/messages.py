"""Emitters as a line of JSON: how Blender's window tells a worker what shines."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import BROKEN_JSON, LightsphereError
from .emitters import Emitter, Profile, SpotProfile, across, cosine

PROFILES: dict[str, Profile] = {"cosine": cosine, "across": across}


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
    profile: Any = None
    if isinstance(emitter.profile, SpotProfile):
        profile = dataclasses.asdict(emitter.profile)
    elif emitter.profile is not None:
        profile = next(name for name, known in PROFILES.items() if known is emitter.profile)
    return {
        "place": emitter.place.tolist(),
        "intensity": emitter.intensity.tolist(),
        "distant": emitter.distant,
        "to_world": None if emitter.to_world is None else emitter.to_world.tolist(),
        "profile": profile,
    }


def _from_json(value: dict[str, Any]) -> Emitter:
    profile = value["profile"]
    if isinstance(profile, dict):
        profile = SpotProfile(profile["angle"], profile["blend"], tuple(profile["stretch"]))
    elif profile is not None:
        profile = PROFILES[profile]
    return Emitter(
        place=np.array(value["place"], np.float64),
        intensity=np.array(value["intensity"], np.float64),
        distant=bool(value["distant"]),
        to_world=None if value["to_world"] is None else np.array(value["to_world"], np.float64),
        profile=profile,
    )
