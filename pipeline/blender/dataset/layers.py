"""What is known of a sample's surfaces at every pixel beside its truth: ``layers.exr``.

``diffuse.R/G/B`` and ``glossy.R/G/B`` are the colours of Cycles' diffuse and glossy closures, their weights summed up;
``roughness.V`` and ``share.1/2/3`` are what a drawn mixture of Principled materials has there, where that is the
material.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.camera import Camera
from .. import exr
from ..truth import render_passes
from .materials import ROUGHNESS, SHARES

FILE = "layers.exr"
PASSES = ("use_pass_diffuse_color", "use_pass_glossy_color")
# Blender 4.5 and 5.2 call passes differently.
COLOURS = {"diffuse": ("DiffCol", "Diffuse Color"), "glossy": ("GlossCol", "Glossy Color")}


def write(scene: bpy.types.Scene, camera: Camera, folder: Path, told: bool) -> None:
    """Render ``layers.exr`` of a scene whose lights are all hidden.

    Parameters
    ----------
    told : bool
        Whether the material tells its shares and roughness.
    """
    with _told(scene.view_layers[0]):
        found = render_passes(scene, camera, folder, PASSES)
    layers = {
        f"{name}.{channel}": _channel(found, [f"{word}.{channel}" for word in words])
        for name, words in COLOURS.items()
        for channel in "RGB"
    }
    if told:
        layers["roughness.V"] = _channel(found, [f"{ROUGHNESS}.{end}" for end in "VX"])
        layers |= {f"share.{k}": _channel(found, [f"{SHARES}.{channel}"]) for k, channel in enumerate("RGB", start=1)}
    exr.write(folder / FILE, layers)


@contextlib.contextmanager
def _told(layer: bpy.types.ViewLayer) -> Iterator[None]:
    """Let a layer render what materials tell, for a while."""
    added = []
    for name, kind in ((SHARES, "COLOR"), (ROUGHNESS, "VALUE")):
        aov = layer.aovs.add()
        aov.name, aov.type = name, kind
        added.append(aov)
    try:
        yield
    finally:
        for aov in reversed(added):
            layer.aovs.remove(aov)


def _channel(found: dict[str, NDArray[Any]], ends: list[str]) -> NDArray[Any]:
    return np.nan_to_num(next(v for name, v in found.items() if any(name.endswith(f".{end}") for end in ends)))
