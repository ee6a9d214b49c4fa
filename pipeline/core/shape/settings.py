"""The settings of the shape stage."""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import setting

METHODS = ("double-sphere", "acls", "lambertian", "uncalibrated")
COLOURS = ("bases", "weights")
STARTS = ("lobe", "symmetry")
LAMPS = ("distant", "near")
STRENGTHS = {"similar": 0.2, "equal": 0.005, "unknown": 1.0}  # scatter of their logarithm
OBJECTIVES = ("joint", "source")


@dataclass(frozen=True)
class ShapeSettings:
    """How shape is recovered; see :mod:`pipeline.core.shape.double_sphere`, :mod:`~pipeline.core.shape.photometric`
    and :mod:`~pipeline.core.shape.uncalibrated`.

    ``candidates`` and ``min_lit`` belong to double covering.
    """

    method: str = setting(
        "double-sphere",
        "double-sphere: depth from lights on two surfaces; acls: normals, basis BRDFs and weight maps from known "
        "lights (on two surfaces depth, too); lambertian: normals by robust photometric stereo; "
        "uncalibrated: lights, normals and basis BRDFs from 10 to 15 photographs under unknown lights",
        choices=METHODS,
    )
    pictures: int = setting(
        0, "most pictures that are used, of evenly spread lights, 0: all", unit="pictures", low=0, high=100_000
    )
    bases: int = setting(3, "most basis BRDFs that acls and uncalibrated tell apart", low=1, high=4)
    colour: str = setting("bases", "where acls puts the colour: into the basis BRDFs or the weights", choices=COLOURS)
    start: str = setting(
        "lobe",
        "where acls begins: lobe fits a diffuse and a glossy lobe to every pixel; symmetry takes the azimuth about "
        "which distant lights' pictures are symmetric, as Alldrin and Kriegman 2007 do",
        choices=STARTS,
    )
    rounds: int = setting(10, "most rounds of acls once it has settled which values to trust", low=1, high=1000)
    held_out: int = setting(
        0,
        "acls keeps every so many-th light from the fit to state the error on, 0: none",
        unit="lights",
        high=1000,
        low=0,
    )
    lamps: str = setting(
        "distant",
        "what uncalibrated takes the lights for: distant ones, or lamps at arm's length, whose places and powers are "
        "found",
        choices=LAMPS,
    )
    strengths: str = setting(
        "similar",
        "what uncalibrated is told of the lights, of near ones of their powers: similar, within some 20 %; equal; or "
        "unknown",
        choices=tuple(STRENGTHS),
    )
    cues: str = setting(
        "",
        "what uncalibrated believes beside the pictures: some of outline, surface, strengths, highlights, shadows, "
        "albedo, commas between; empty: all",
    )
    known_lights: str = setting(
        "",
        "file of lights whose directions uncalibrated is told, NAME X Y Z a line with the photograph's name",
        path="file",
    )
    proxy: str = setting(
        "", "a rough mesh of the object or of a part of it in the capture's world: a cue for uncalibrated", path="file"
    )
    interreflections: int = setting(
        0,
        "times that acls and uncalibrated take the light that the object throws upon itself, rendered by Cycles from "
        "what they found, out of the pictures and begin anew; 3 for a hollow, 0: none",
        low=0,
        high=20,
    )
    objective: str = setting(
        "joint",
        "joint: one reflectance function fitted to both surfaces with the depth as an unknown; "
        "source: the squared differences of Magda et al. 2001, equation 5, ten candidates and a local search; of "
        "uncalibrated, joint moves all unknowns at once, source surface, normals, albedo, lights and Torrance-Sparrow "
        "lobes in turn",
        choices=OBJECTIVES,
    )
    min_lit: int = setting(12, "fewest lit lights with which a pixel is recovered", unit="lights", low=6, high=1000)
    candidates: int = setting(10, "depths tried along each ray by the source's objective", low=3, high=1000)
    fuse: bool = setting(True, "repair depths that disagree with their neighbours' normals")
    memory: float = setting(
        1024.0, "observations above this size are kept in a file instead of in memory", unit="MB", low=16.0
    )
