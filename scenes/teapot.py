"""The teapot on a Lambertian disk, in five materials; built from Newell's published control points."""

from __future__ import annotations

import bpy
import numpy as np

from . import newell, stage
from .surfaces import Mesh, bezier, evenly, lathe, mirrored_tube

DIAMETER = 2.4
LATHE_COLUMNS, TUBE_COLUMNS = 120, 64


def mesh() -> Mesh:
    """Return the teapot, about 74,000 triangles, largest extent 2.4 m, centred on the origin."""
    parts = [
        lathe(bezier(profile, evenly(profile, rows)), LATHE_COLUMNS)
        for profile, rows in ((newell.LID, 100), (newell.GAP, 3), (newell.BODY, 130))
    ]
    parts += [mirrored_tube(newell.HANDLE, 60, TUBE_COLUMNS), _spout()]
    return stage.centred(sum(parts[1:], parts[0]), DIAMETER)


def _spout() -> Mesh:
    """Return the spout with its mouth closed by a flat lid, so that the inside is not seen."""
    tube = mirrored_tube(newell.SPOUT, 90, TUBE_COLUMNS)
    rim = tube.vertices[-TUBE_COLUMNS:]
    index = np.arange(len(rim))
    centre = np.full(len(rim), len(rim))
    lid = Mesh(np.vstack([rim, rim.mean(axis=0)]), np.stack([index, centre, centre, np.roll(index, -1)], axis=-1))
    return tube + lid


def _build(scene: bpy.types.Scene, material: bpy.types.Material) -> None:
    surface = mesh()
    stage.add_object(scene, "Teapot", surface, material)
    stage.add_ground(scene, surface.vertices[:, 2].min())
    stage.add_camera(scene, 1.03 * DIAMETER, (0.35, -1.0, 0.33))


def lambert(scene: bpy.types.Scene) -> None:
    """Build the teapot with a Lambertian surface."""
    _build(scene, stage.material("Lambert", "ShaderNodeBsdfDiffuse", {"Color": (0.7, 0.5, 0.35, 1)}))


def plastic(scene: bpy.types.Scene) -> None:
    """Build the teapot in plastic: a Principled dielectric of roughness 0.3."""
    inputs = {"Base Color": (0.35, 0.5, 0.65, 1), "Roughness": 0.3, "Metallic": 0.0}
    _build(scene, stage.material("Plastic", "ShaderNodeBsdfPrincipled", inputs))


def metal(scene: bpy.types.Scene) -> None:
    """Build the teapot in rough metal: one GGX lobe of roughness 0.35."""
    inputs = {"Color": (0.8, 0.65, 0.45, 1), "Roughness": 0.35}
    _build(scene, stage.material("Metal", "ShaderNodeBsdfAnisotropic", inputs, distribution="GGX"))


def coat(scene: bpy.types.Scene) -> None:
    """Build the teapot half metallic under a clear coat: three lobes of different width."""
    inputs = {"Base Color": (0.6, 0.3, 0.25, 1), "Roughness": 0.45, "Metallic": 0.5}
    inputs |= {"Coat Weight": 0.8, "Coat Roughness": 0.2}
    _build(scene, stage.material("Coat", "ShaderNodeBsdfPrincipled", inputs))


def beckmann(scene: bpy.types.Scene) -> None:
    """Build the teapot with one Beckmann lobe of roughness 0.4 and nothing diffuse."""
    inputs = {"Color": (0.7, 0.7, 0.72, 1), "Roughness": 0.4}
    _build(scene, stage.material("Beckmann", "ShaderNodeBsdfAnisotropic", inputs, distribution="BECKMANN"))
