"""Settings as Blender shows them, made from the dataclasses of the core: names, defaults and limits live there."""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Callable, Mapping
from typing import Any

import bpy

from ..pipeline.core.settings import Limits, check, limits_of

LENGTH = "m"
RELATIVE = {"options": {"ANIMATABLE", "PATH_SUPPORTS_BLEND_RELATIVE"}}  # of a path: it may move with the file


def group(
    settings_type: type[Any], name: str, update: Mapping[str, Callable[..., None]] = types.MappingProxyType({})
) -> type[bpy.types.PropertyGroup]:
    """Return a PropertyGroup class with one property per field of a settings dataclass.

    Some fields call a function of the group and the context when they are changed.
    """
    properties = {item.name: _property(item, update.get(item.name)) for item in dataclasses.fields(settings_type)}
    members = {"__annotations__": properties, "__doc__": settings_type.__doc__}
    return type(name, (bpy.types.PropertyGroup,), members)


def values(shown: bpy.types.PropertyGroup, settings_type: type[Any]) -> Any:
    """Return the settings that a PropertyGroup shows; raise LightsphereError for one out of its limits."""
    chosen = {item.name: getattr(shown, item.name) for item in dataclasses.fields(settings_type)}
    # Blender keeps 32 bits of a float: seven digits are what the artist typed.
    return check(settings_type(**{k: float(f"{v:.7g}") if isinstance(v, float) else v for k, v in chosen.items()}))


def absolute(settings: Any) -> Any:
    """Return settings with the paths that an artist chose made absolute."""
    paths = {item.name for item in dataclasses.fields(settings) if limits_of(item).path}
    chosen = {name: getattr(settings, name) for name in paths}
    return dataclasses.replace(settings, **{name: bpy.path.abspath(path) for name, path in chosen.items() if path})


def options(settings: Any) -> list[str]:
    """Return settings as the words of the command line."""
    words: list[str] = []
    for item in dataclasses.fields(settings):
        name, value = item.name.replace("_", "-"), getattr(settings, item.name)
        if isinstance(value, bool):
            words.append(f"--{name}" if value else f"--no-{name}")
        else:
            words.append(f"--{name}={value}")
    return words


def _property(item: dataclasses.Field[Any], update: Callable[..., None] | None) -> Any:
    limits = limits_of(item)
    shared = {
        "name": item.name.replace("_", " ").title(),
        "description": limits.help[:1].upper() + limits.help[1:] + (f" [{limits.unit}]" if limits.unit else ""),
        "default": item.default,
        "update": update,
    }
    if limits.choices:
        choices = [(word, word.replace("-", " ").title(), "") for word in limits.choices]
        return bpy.props.EnumProperty(items=choices, **shared)
    if isinstance(item.default, bool):
        return bpy.props.BoolProperty(**shared)
    if isinstance(item.default, int):
        return bpy.props.IntProperty(**shared, **_range(limits, int))
    if isinstance(item.default, float):
        subtype = "DISTANCE" if limits.unit == LENGTH else "NONE"
        return bpy.props.FloatProperty(**shared, **_range(limits, float), subtype=subtype)
    if limits.path:
        subtype = {"file": "FILE_PATH", "folder": "DIR_PATH"}[limits.path]
        return bpy.props.StringProperty(**shared, subtype=subtype, **RELATIVE)
    return bpy.props.StringProperty(**shared)


def _range(limits: Limits, kind: type) -> dict[str, Any]:
    ends = {"min": limits.low, "max": limits.high}
    return {name: kind(value) for name, value in ends.items() if value is not None}
