"""Relight: pictures under new lights, made of the pictures of a capture and the recovered depth.

:mod:`.emitters` turns every kind of light into points and directions that shine, :mod:`.lobes` is what is expected of
a pixel, :mod:`.stack` the pictures arranged by pixel over that expectation, :mod:`.interpolant` what a new light finds
between those of the capture, :mod:`.render` the picture. Pictures add up: each is linear in the lights' intensities.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import setting

INTERPOLATIONS = ("model", "source")


@dataclass(frozen=True)
class RelightSettings:
    """How a new light is interpolated between those of a capture; see :func:`pipeline.core.relight.render.relit`."""

    interpolation: str = setting(
        "model",
        "model: fitted lobes, corrected by the nearest lights of both surfaces, and shadow edges that move; "
        "source: linear between three lights of the inner surface (Magda et al. 2001, equation 6)",
        choices=INTERPOLATIONS,
    )
    pictures: int = setting(
        0, "most pictures that are used, of evenly spread lights, 0: all", unit="pictures", low=0, high=100_000
    )
    memory: float = setting(
        2048.0, "pictures above this size are kept in a file instead of in memory", unit="MB", low=16.0
    )
