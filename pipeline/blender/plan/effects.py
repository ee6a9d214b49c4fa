"""The effects of light by name, and what is planned for each."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

from .. import cycles
from .probe import Difference

SHADOWS, FALL_OFF = "cast shadows", "near-light fall-off"
DIFFUSE, GLOSSY, CAUSTICS = "diffuse interreflection", "glossy interreflection", "caustics"
TRANSMISSION, VOLUMES, SUBSURFACE = "transmission", "volumes", "subsurface"
EMISSION, DEPTH_OF_FIELD, MOTION_BLUR = "emission", "depth of field", "motion blur"
NOISE, SATURATION = "sensor noise", "saturation"

#: Effects that can be switched off, and the switches of :class:`cycles.Transport`.
SWITCHES = {
    DIFFUSE: "diffuse",
    GLOSSY: "glossy",
    CAUSTICS: "caustics",
    TRANSMISSION: "transmission",
    DEPTH_OF_FIELD: "depth_of_field",
    MOTION_BLUR: "motion_blur",
}
#: Effects that come with a material and cannot be switched off.
INSIDE = (VOLUMES, SUBSURFACE, EMISSION)


@dataclass(frozen=True)
class Effect:
    """What one effect adds to the pictures of the object.

    Parameters
    ----------
    effect : str
    simulated : bool
    reason : str
    contribution_pct, uncertainty_pct : float or None
        How far the pictures without it are off, in the group that it changes most, and the standard deviation of
        that [%]; None where it was not measured.
    group : str
        The material whose surfaces change most; ``""`` where not measured.
    saves_pct : float or None
        Render time saved where it alone is left out of everything [%].
    """

    effect: str
    simulated: bool
    reason: str
    contribution_pct: float | None = None
    uncertainty_pct: float | None = None
    group: str = ""
    saves_pct: float | None = None


def measured(name: str, simulated: bool, reason: str, loss: Difference, saves: float | None = None) -> Effect:
    """Return an effect whose loss was measured; ``saves`` is the share of the time that it takes."""
    saves_pct = None if saves is None else round(100 * saves, 1)
    return Effect(
        name, simulated, reason, round(100 * loss.share, 4), round(100 * loss.deviation, 4), loss.group, saves_pct
    )


@dataclass(frozen=True)
class Plan:
    """The effects of a scene and the light paths that Cycles is to follow.

    Parameters
    ----------
    effects : tuple of Effect
    transport : cycles.Transport
    missing : Effect or None
        What the planned pictures lack of those with everything, and the time saved; None where nothing was measured.
    seconds : dict of str to float
        What a picture takes, ``"planned"`` and with ``"everything"``; empty where nothing was measured.
    """

    effects: tuple[Effect, ...]
    transport: cycles.Transport
    missing: Effect | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    def as_notes(self) -> dict[str, Any]:
        """Return what a capture writes down; times are left out, they change from run to run."""
        effects = [{k: v for k, v in dataclasses.asdict(e).items() if k != "saves_pct"} for e in self.effects]
        return {"effects": effects, "transport": dataclasses.asdict(self.transport)}
