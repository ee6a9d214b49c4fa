"""What Cycles renders on: the processor, or a GPU that Blender's preferences know."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import bpy

from ..core.errors import LightsphereError
from .output import caught_output

CHOICES = ("auto", "cpu", "gpu")
KINDS = ("OPTIX", "CUDA", "HIP", "ONEAPI", "METAL")  # the first that has a device is taken


@dataclass(frozen=True)
class Device:
    """What this process renders on.

    Parameters
    ----------
    kind : str
        ``"CPU"``, or Cycles' name of a GPU's interface.
    name : str
        Of the hardware, as Blender shows it.
    missing : bool
        Whether a GPU was asked for and there is none.
    """

    kind: str
    name: str
    missing: bool = False

    @property
    def is_gpu(self) -> bool:
        """Whether it is no processor."""
        return self.kind != "CPU"


PROCESSOR = Device("CPU", "the processor")
_chosen = PROCESSOR


def choose(wanted: str) -> Device:
    """Let every later render of this process run on ``"cpu"``, on any ``"gpu"``, or, with ``"auto"``, on the GPU that
    is switched on in Blender's preferences, if one is.

    Raises
    ------
    LightsphereError
        For another word.
    """
    global _chosen
    if wanted not in CHOICES:
        raise LightsphereError(f"device is {wanted!r}; choose one of {', '.join(CHOICES)}")
    found = _gpu(switch_on=wanted == "gpu") if wanted != "cpu" else None
    _chosen = found or dataclasses.replace(PROCESSOR, missing=wanted == "gpu")
    return _chosen


def chosen() -> Device:
    """Return what this process renders on."""
    return _chosen


def cycles_values() -> dict[str, Any]:
    """Return what a scene's Cycles settings must say."""
    return {"device": "GPU" if _chosen.is_gpu else "CPU"}


def _gpu(switch_on: bool) -> Device | None:
    """Return the GPU that is switched on in the preferences; where none is, switch on the first, if that is wanted."""
    preferences = bpy.context.preferences.addons["cycles"].preferences
    kinds = (preferences.compute_device_type, *(KINDS if switch_on else ()))
    with caught_output():  # what Cycles says of libraries that this machine does not have
        preferences.refresh_devices()
        for kind in dict.fromkeys(kinds):
            found = _devices(preferences, kind)
            if not found:
                continue
            if switch_on and not any(device.use for device in found):
                found[0].use = True
            used = [device.name for device in found if device.use]
            if used:
                preferences.compute_device_type = kind
                return Device(kind, used[0])
    return None


def _devices(preferences: Any, kind: str) -> list[Any]:
    try:
        return [device for device in preferences.get_devices_for_type(kind) if device.type == kind]
    except (TypeError, ValueError):  # this Blender was built without it
        return []
