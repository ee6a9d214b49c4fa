"""What the stages capture and plan can be told."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import LightsphereError
from .settings import setting

#: Names of the effects that a user may decide.
SWITCHES = ("diffuse", "glossy", "caustics", "transmission")


@dataclass(frozen=True)
class CaptureSettings:
    """How a scene is captured; all but ``workers`` belong to the capture and cannot change when it is continued."""

    rig: str = setting(
        "double-sphere", "double-sphere, double-hemisphere, distant, scene (its rig object), or a file of lights"
    )
    inner: int = setting(320, "lights on the inner surface; all lights of a distant rig", low=4, high=100_000)
    outer: int = setting(80, "lights on the outer surface", low=4, high=100_000)
    radius_inner: float = setting(2.0, "radius of the inner sphere", unit="m", low=1e-6, high=1e6)
    radius_outer: float = setting(3.0, "radius of the outer sphere", unit="m", low=1e-6, high=1e6)
    power: float = setting(
        1.0,
        "strength of the lights: radiance of a white surface that faces one at the inner radius, or a distant one; "
        "rig objects and files have their own",
        low=1e-6,
        high=1e6,
    )
    resolution: int = setting(100, "width and height of the pictures", unit="px", low=4, high=16_384)
    effects: str = setting(
        "auto", "light transport to simulate, auto takes what the scene needs", choices=("auto", "direct", "full")
    )
    error: float = setting(
        3.0, "error asked of the pictures; auto leaves out what adds less than a third of it", unit="%", low=0, high=100
    )
    simulate: str = setting("", f"simulated whatever it adds; with commas: {', '.join(SWITCHES)}")
    leave_out: str = setting("", "left out whatever it adds; names as above")
    renderer: str = setting(
        "auto", "what renders direct light, auto takes closed forms where they are exact", choices=("auto", "cycles")
    )
    samples: int = setting(64, "samples a pixel where light bounces", low=1, high=1_000_000)
    seed: int = setting(0, "seed of the samples", low=0, high=2**31 - 1)
    pixel_type: str = setting("float", "numbers in the pictures", choices=("float", "half"))
    workers: int = setting(0, "processes that render, 0: one per processor core, or one on a GPU", low=0, high=1024)

    def __post_init__(self) -> None:
        """Raise LightsphereError for an override that is not an effect."""
        _overrides(self.simulate, self.leave_out)

    @property
    def overrides(self) -> dict[str, bool]:
        """Which effects the user decides, and how."""
        return _overrides(self.simulate, self.leave_out)


def _overrides(simulate: str, leave_out: str) -> dict[str, bool]:
    found: dict[str, bool] = {}
    for words, on in ((simulate, True), (leave_out, False)):
        for word in filter(None, (part.strip() for part in words.split(","))):
            if word not in SWITCHES or found.get(word, on) != on:
                raise LightsphereError(
                    f"{word!r} cannot be simulated or left out so; name each of {', '.join(SWITCHES)} once at most"
                )
            found[word] = on
    return found


@dataclass(frozen=True)
class PlanSettings(CaptureSettings):
    """The capture whose effects are planned, and how they are probed."""

    lights: str = setting(
        "auto", "whose light shines, auto takes the scene's own if it has any", choices=("auto", "rig", "own")
    )
    probes: int = setting(4, "lights of the rig that are tried", low=1, high=1000)
    probe_resolution: int = setting(40, "width and height of the trial pictures", unit="px", low=4, high=4096)
    probe_samples: int = setting(32, "samples a pixel of each half of a trial", low=1, high=1_000_000)
