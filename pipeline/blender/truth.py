"""What the renderer knows of the scene: first hits with their position, normal and material, and the object's mask."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core import images
from ..core.camera import Camera
from ..core.errors import LightsphereError
from . import cycles

BACKDROP = "lightsphere_backdrop"
PASSES = ("use_pass_position", "use_pass_normal", "use_pass_object_index", "use_pass_material_index")
OBJECT, SURROUNDING = 2, 1


def write(scene: bpy.types.Scene, camera: Camera, folder: Path) -> None:
    """Render ``truth.exr`` and ``mask.exr`` of a scene that is set up for measuring.

    Raises
    ------
    LightsphereError
        When the camera does not see the object.
    """
    layers = _passes(scene, folder)
    hit = layers["object"] > 0.5
    mask = layers["object"] > (OBJECT + SURROUNDING) / 2
    if not mask.any():
        raise LightsphereError(f"the camera of the scene {scene.name!r} does not see the object; aim it at the object")
    truth = {"depth.V": _ray_length(layers["position"], camera), "material.V": layers["material"]}
    normal = camera.normals_to_camera(layers["normal"])
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-30)
    for i, axis in enumerate("XYZ"):
        truth[f"normal.{axis}"] = normal[..., i]
        truth[f"position.{axis}"] = layers["position"][..., i]
    known = {name: np.where(hit, v, 0 if name == "material.V" else np.nan) for name, v in truth.items()}
    images.write_channels(folder / "truth.exr", {name: v.astype(np.float32) for name, v in known.items()})
    images.write_channels(folder / "mask.exr", {"mask.V": mask.astype(np.float32)})


def diameter(scene: bpy.types.Scene) -> float:
    """Return the largest extent of the object along a world axis [m]."""
    corners = []
    for item in visible_meshes(scene):
        if not item.get(BACKDROP):
            corners.append(np.array([item.matrix_world @ vertex.co for vertex in item.data.vertices]))
    if not corners:
        raise LightsphereError(f"the scene {scene.name!r} shows no mesh; add the object to capture")
    points = np.concatenate(corners)
    return float((points.max(axis=0) - points.min(axis=0)).max())


def visible_meshes(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the mesh objects that a render shows."""
    return [item for item in scene.objects if item.type == "MESH" and not item.hide_render]


def _ray_length(position: NDArray[Any], camera: Camera) -> NDArray[np.float64]:
    origins, directions = camera.rays()
    return np.asarray(((position - origins) * directions).sum(axis=-1))


def _passes(scene: bpy.types.Scene, folder: Path) -> dict[str, NDArray[Any]]:
    path = folder / ".passes.exr"
    layer = scene.view_layers[0]
    image = scene.render.image_settings
    with cycles.changed(layer, dict.fromkeys(PASSES, True)), _indices(scene):
        cycles.image_format(image, "OPEN_EXR_MULTILAYER", "RGBA", "32")
        cycles.render(scene, str(path))
        cycles.image_format(image, "OPEN_EXR", "RGB", "32")
    channels = images.read_channels(path)
    path.unlink()

    def find(name: str) -> NDArray[Any]:
        return next(values for key, values in channels.items() if key.endswith(name))

    return {
        "position": np.stack([find(f"Position.{axis}") for axis in "XYZ"], axis=-1).astype(np.float64),
        "normal": np.stack([find(f"Normal.{axis}") for axis in "XYZ"], axis=-1).astype(np.float64),
        "object": _first(channels, "IndexOB.X", "Object Index.X"),
        "material": _first(channels, "IndexMA.X", "Material Index.X"),
    }


def _first(channels: dict[str, NDArray[Any]], *names: str) -> NDArray[Any]:
    for key, values in channels.items():
        if key.endswith(names):
            return values
    raise KeyError(f"none of {names} in {list(channels)}")


@contextlib.contextmanager
def _indices(scene: bpy.types.Scene) -> Iterator[None]:
    """Number objects by whether they are the object, and materials from 1, for a while."""
    items = [*scene.objects, *bpy.data.materials]
    before = [item.pass_index for item in items]
    try:
        for item in scene.objects:
            item.pass_index = SURROUNDING if item.get(BACKDROP) else OBJECT
        for number, item in enumerate(bpy.data.materials, start=1):
            item.pass_index = number
        yield
    finally:
        for item, index in zip(items, before, strict=True):
            item.pass_index = index
