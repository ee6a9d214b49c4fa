"""What the stages capture and plan can be told."""

from __future__ import annotations

from dataclasses import dataclass

from .settings import setting


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
    resolution: int = setting(100, "width and height of the pictures", unit="px", low=2, high=16_384)
    effects: str = setting(
        "auto", "light transport to simulate, auto takes what the scene needs", choices=("auto", "direct", "full")
    )
    samples: int = setting(64, "samples a pixel where light bounces", low=1, high=1_000_000)
    seed: int = setting(0, "seed of the samples", low=0, high=2**31 - 1)
    pixel_type: str = setting("float", "numbers in the pictures", choices=("float", "half"))
    workers: int = setting(0, "processes that render, 0: one per processor core, or one on a GPU", low=0, high=1024)


@dataclass(frozen=True)
class PlanSettings:
    """How the effects of a scene are probed, and when one is worth simulating."""

    threshold: float = setting(
        1.0, "an effect is simulated from this share of the picture's light on", unit="%", low=0.0, high=100.0
    )
    probes: int = setting(4, "lights of the rig that are tried", low=1, high=1000)
    probe_resolution: int = setting(40, "width and height of the trial pictures", unit="px", low=2, high=4096)
    probe_samples: int = setting(32, "samples a pixel of the trial pictures", low=1, high=1_000_000)
