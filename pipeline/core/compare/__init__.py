"""Compare: a result with its truth, and a picture with another.

Truth enters nowhere else: no solver imports this package.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import setting


@dataclass(frozen=True)
class CompareSettings:
    """Under which lights and from where an asset is compared."""

    lights: int = setting(16, "lights of each kind under which the asset is rendered", low=1, high=10_000)
    turn: float = setting(
        20.0, "how far to the right the view stands that the capture did not have", unit="degrees", low=-90.0, high=90.0
    )
    bounces: int = setting(
        4, "bounces of the light with which every second new light is rendered, too; 0 leaves that out", low=0, high=64
    )
    samples: int = setting(64, "samples a pixel where light bounces", low=2, high=65536)
