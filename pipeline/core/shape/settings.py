"""The settings of the shape stage."""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import setting

METHODS = ("double-sphere",)
OBJECTIVES = ("joint", "source")


@dataclass(frozen=True)
class ShapeSettings:
    """How depth is recovered; see :func:`pipeline.core.shape.double_sphere.recover`."""

    method: str = setting("double-sphere", "how shape is recovered", choices=METHODS)
    objective: str = setting(
        "joint",
        "joint: one reflectance function fitted to both surfaces with the depth as an unknown; "
        "source: the squared differences of Magda et al. 2001, equation 5, ten candidates and a local search",
        choices=OBJECTIVES,
    )
    min_lit: int = setting(12, "fewest lit lights with which a pixel is recovered", unit="lights", low=6, high=1000)
    candidates: int = setting(10, "depths tried along each ray by the source's objective", low=3, high=1000)
    fuse: bool = setting(True, "repair depths that disagree with their neighbours' normals")
    memory: float = setting(
        1024.0, "observations above this size are kept in a file instead of in memory", unit="MB", low=16.0
    )
