"""What a material costs to render, beside one Principled BSDF with the same textures."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

from ..core.material import Mixture
from ..core.material.surface import Surface
from ..core.progress import Progress, Work
from . import asset, cycles
from .ball import ball_camera, ball_scene, dress
from .camera import add_camera
from .mixtures import mixture_material

SIDE, SAMPLES, BOUNCES = 128, 16, 3
REPEATS = 3
TEXELS = 64


def relative_cost(mixture: Mixture) -> Work[list[float]]:
    """Render a sphere with the diffuse closure, then with one lobe more at a time; what is open is replaced.

    Returns
    -------
    list of float
        Processor seconds over those of one Principled BSDF that reads the same weight map, for 0, 1, .. lobes.
    """
    parts = [Mixture(mixture.lobes[:n], mixture.curves[:, :n]) for n in range(1, len(mixture.lobes) + 1)]
    *seconds, principled = yield from render_seconds(parts)
    return [s / principled for s in seconds]


def render_seconds(mixtures: Sequence[Mixture]) -> Work[list[float]]:
    """Render a sphere with mixtures of the same number of bases, then with one Principled BSDF; replaces what is open.

    Returns
    -------
    list of float
        Processor seconds of each, the Principled BSDF last, which reads the same weight map: light bounces between
        sphere and sky. The least of a few turns, in which all materials are rendered one by one.
    """
    scene, item = ball_scene()
    camera = ball_camera(SIDE)
    add_camera(scene, camera)
    random = np.random.default_rng(0)
    weights = random.uniform(0, 1, (TEXELS, TEXELS, len(mixtures[0].curves), 1)).astype(np.float32)
    materials = [mixture_material(f"{number}", Surface(one, weights)) for number, one in enumerate(mixtures)]
    materials.append(_principled(materials[-1]))
    seconds = np.full((REPEATS, len(materials)), np.inf)
    transport = cycles.Transport(BOUNCES, samples=SAMPLES)
    with (
        tempfile.TemporaryDirectory() as folder,
        cycles.measuring(scene, camera, transport, world=asset.sky()),
        cycles.changed(scene.cycles, {"device": "CPU"}),  # whose seconds are counted
        cycles.openexr(scene),
    ):
        for turn in range(REPEATS):
            for number, material in enumerate(materials):
                dress(item, material)
                start = time.process_time()
                cycles.render(scene, Path(folder) / "cost.exr")
                seconds[turn, number] = time.process_time() - start
                yield Progress("cost", turn * len(materials) + number + 1, seconds.size, "pictures")
    return [float(s) for s in seconds.min(axis=0)]


def _principled(like: bpy.types.Material) -> bpy.types.Material:
    """Return a Principled BSDF whose base colour is a material's texture."""
    material = bpy.data.materials.new("Principled")
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    nodes = material.node_tree.nodes
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = next(node.image for node in like.node_tree.nodes if node.type == "TEX_IMAGE")
    material.node_tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    return material
