"""What the renderer knows of the scene: first hits with their position, normal and material, and the object's mask."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.camera import Camera
from ..core.errors import LightsphereError
from . import cycles, exr
from .geometry import BACKDROP

FILES = ("truth.exr", "mask.exr")
PASSES = ("use_pass_combined", "use_pass_position", "use_pass_normal", "use_pass_uv")
INDICES = ("use_pass_object_index", "use_pass_material_index")
# One letter a channel, as Blender 4.5 and 5.2 end their names.
SUFFIXES = {
    "combined": ("Combined.R", "Combined.G", "Combined.B"),
    "position": ("Position.X", "Position.Y", "Position.Z"),
    "normal": ("Normal.X", "Normal.Y", "Normal.Z"),
    "uv": ("UV.U", "UV.V"),
    "object": (("IndexOB.X", "Object Index.X"),),
    "material": (("IndexMA.X", "Material Index.X"),),
}
BACKDROP_INDEX, OBJECT_INDEX = 1, 2


def write(scene: bpy.types.Scene, camera: Camera, folder: Path) -> None:
    """Render ``truth.exr`` and ``mask.exr`` of a scene whose lights are all hidden.

    Raises
    ------
    LightsphereError
        When the camera does not see the object, or something in the scene shines by itself.
    """
    passes = _render(scene, camera, folder)
    hit = passes["object"][..., 0] > 0
    mask = passes["object"][..., 0] == OBJECT_INDEX
    if not mask.any():
        raise LightsphereError(f"the camera of the scene {scene.name!r} does not see the object; aim it at the object")
    if (shining := (passes["combined"] > 0).any(axis=-1)).any():
        raise LightsphereError(
            f"{shining.sum()} pixels of the scene {scene.name!r} shine without a light; remove the emission of its "
            "materials, a picture must show one light alone"
        )
    normal = camera.normals_to_camera(passes["normal"])
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-30)
    layers = {"depth.V": _depth(passes["position"], camera)}
    layers |= {f"normal.{axis}": normal[..., i] for i, axis in enumerate("XYZ")}
    layers |= {f"position.{axis}": passes["position"][..., i] for i, axis in enumerate("XYZ")}
    layers = {name: np.where(hit, values, np.nan) for name, values in layers.items()}
    exr.write(folder / "truth.exr", layers | {"material.V": passes["material"][..., 0]})
    exr.write(folder / "mask.exr", {"mask.V": mask})


def object_mask(scene: bpy.types.Scene, camera: Camera) -> NDArray[np.bool_]:
    """Return which pixels (H, W) of the scene's camera show the object; raises what :func:`write` does."""
    with tempfile.TemporaryDirectory() as folder, cycles.own_lights_hidden(scene):
        write(scene, camera, Path(folder))
        return np.asarray(exr.read(Path(folder) / "mask.exr")["mask.V"] > 0.5)


@dataclass(frozen=True)
class FirstHits:
    """What the pixels of a camera show.

    Parameters
    ----------
    is_object : (H, W) bool
        Whether a surface is hit that is not backdrop.
    material : (H, W) int
        Number of the group of surfaces, see :func:`groups`.
    position : (H, W, 3) float32
        In the world [m].
    uv : (H, W, 2) float32
        Texture coordinates by the mesh's active UV map.
    names : dict of int to str
        Of the groups.
    """

    is_object: NDArray[np.bool_]
    material: NDArray[np.int64]
    position: NDArray[np.float32]
    uv: NDArray[np.float32]
    names: dict[int, str]


def first_hits(scene: bpy.types.Scene, camera: Camera) -> FirstHits:
    """Return what the pixels of a camera show, whatever shines in the scene."""
    with tempfile.TemporaryDirectory() as folder, cycles.own_lights_hidden(scene):
        passes = _render(scene, camera, Path(folder))
    objects = passes["object"][..., 0]
    material, names = groups(scene, passes["material"][..., 0].astype(np.int64), objects > 0)
    return FirstHits(objects == OBJECT_INDEX, material, passes["position"], passes["uv"], names)


def groups(
    scene: bpy.types.Scene, material: NDArray[np.int64], surface: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], dict[int, str]]:
    """Return the group of surfaces that every pixel shows, by materials' numbers (H, W) and where a surface is (H, W).

    What has no material is a group, too; 0 where no surface is. With the groups' names.
    """
    names = {number: one.name for one, number in numbered(scene).items()}
    bare = len(names) + 1
    return np.where(surface, np.where(material > 0, material, bare), 0), names | {bare: "no material"}


def render_passes(
    scene: bpy.types.Scene, camera: Camera, folder: Path, passes: tuple[str, ...]
) -> dict[str, NDArray[Any]]:
    """Render a scene once with some passes switched on, by way of a file in a folder; return all channels (H, W)."""
    path = exr.partial_name(folder / "passes.exr")  # a killed run's is removed with its other partial files
    with (
        cycles.measuring(scene, camera, cycles.DIRECT),
        cycles.openexr(scene, layers=True),
        cycles.changed(scene.view_layers[0], dict.fromkeys(passes, True)),
    ):
        cycles.render(scene, path)
    channels = exr.read(path)
    path.unlink()
    return channels


def _depth(position: NDArray[Any], camera: Camera) -> NDArray[np.float64]:
    """Return the length of each pixel's ray; Blender's own depth is the distance from the camera's plane."""
    origins, directions = camera.rays()
    return np.asarray(((position.astype(np.float64) - origins) * directions).sum(axis=-1))


def _render(scene: bpy.types.Scene, camera: Camera, folder: Path) -> dict[str, NDArray[Any]]:
    with _indices(scene):
        channels = render_passes(scene, camera, folder, PASSES + INDICES)
    return {
        name: np.stack([next(v for key, v in channels.items() if key.endswith(end)) for end in ends], axis=-1)
        for name, ends in SUFFIXES.items()
    }


@contextlib.contextmanager
def _indices(scene: bpy.types.Scene) -> Iterator[None]:
    """Number all objects by whether they are the object, and all materials."""
    with contextlib.ExitStack() as stack:
        for item in bpy.data.objects:
            index = BACKDROP_INDEX if item.get(BACKDROP) else OBJECT_INDEX
            stack.enter_context(cycles.changed(item, {"pass_index": index}))
        for material, number in numbered(scene).items():
            stack.enter_context(cycles.changed(material, {"pass_index": number}))
        yield


def numbered(scene: bpy.types.Scene) -> dict[bpy.types.Material, int]:
    """Return all materials with their numbers, from 1 in the order of the scene's objects."""
    slots = [slot.material for item in scene.objects for slot in item.material_slots if slot.material]
    return {material: number for number, material in enumerate(dict.fromkeys([*slots, *bpy.data.materials]), start=1)}
