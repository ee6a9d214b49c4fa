"""The asset of a mesh that a user brought: that very mesh, with its names and UVs, and baked textures."""

from __future__ import annotations

import dataclasses
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core import images
from ..core.errors import LightsphereError
from ..core.material import MaterialSettings
from ..core.material.principled import Principled
from ..core.reflectance.bake import Visible, bake, texture_size
from ..core.shape import Shape
from ..core.shape.scan import Scan
from . import asset, pixels, scans
from .materials import Recovered, surface_material

Maps = TypeVar("Maps", bound=Recovered | Principled)


def write(
    path: Path,
    shape: Shape,
    mesh: Path,
    reflectance: Recovered,
    settings: MaterialSettings = asset.PLAIN,
    principled: Principled | None = None,
    pbr: Path | None = None,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Write an asset.blend with the user's mesh; what is open in this Blender is replaced by it.

    Every material slot that the pictures show gets a material of its own with textures in the mesh's UVs; others keep
    what they have.

    Parameters
    ----------
    path : Path
        The file.
    shape : Shape
        Made by :func:`pipeline.blender.scans.shape_of`.
    mesh : Path
        The mesh's file.
    reflectance : Reflectance or Surface
        Of the shape's pixels.
    settings : MaterialSettings
        Where textures go, and which version is shown; the mesh stays as it is.
    principled : Principled, optional
        The Principled version of the shape's pixels, which is kept, too.
    pbr : Path, optional
        A folder for its maps as plain textures, in a folder of their own for every slot.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    dict
        ``vertices``, ``triangles``, ``texels`` (the sides of the textures) and ``texels_seen`` (how many have values).

    Raises
    ------
    LightsphereError
        When the mesh is not the one that the shape was made from, or the file cannot be written.
    """
    asset.check_free(path, overwrite)
    if not mesh.is_file() or images.checksum(mesh) != shape.notes["mesh_sha256"]:
        raise LightsphereError(f"{mesh} is missing or changed; run lightsphere shape --mesh again")
    items = scans.load(mesh, shape.notes["mesh_unit"])
    scan = scans.scan_of(items)
    caster = scans.Caster(scan)
    face = caster.first(shape.camera, np.isfinite(shape.depth))
    sizes, texels_seen = [], 0
    for part, (item, slot) in enumerate(scans.slots(items)):
        own = np.flatnonzero(scan.part == part)
        shown = np.searchsorted(own, face[np.isin(face, own)])
        if not len(shown):
            continue
        chosen = scan.select(part)
        asset.mark(bpy.context.scene, item)
        sizes.append(texture_size(chosen, shown))
        visible = partial(caster.visible, shape.camera)
        baked, confidence = _baked(reflectance, shape, chosen, sizes[-1], visible)
        texels_seen += int((confidence > 0).sum())
        material = _textured(f"{item.name} {slot + 1}", baked, confidence)
        if len(item.data.materials):
            item.data.materials[slot] = material
        else:
            item.data.materials.append(material)
        if principled is not None:
            version, _ = _baked(principled, shape, chosen, sizes[-1], visible)
            folder = None if pbr is None else pbr / material.name
            asset.keep_principled(item, slot, version, None, settings.principled, folder)
    asset.furnish(bpy.context.scene, shape.camera, scan.corners.reshape(-1, 3))
    asset.save(path, settings.textures)
    vertices = sum(len(item.data.vertices) for item in items)
    return {"vertices": vertices, "triangles": len(scan.part), "texels": sizes, "texels_seen": texels_seen}


def _baked(
    reflectance: Maps, shape: Shape, scan: Scan, size: int, visible: Visible
) -> tuple[Maps, NDArray[np.float32]]:
    """Return a dataclass of maps with its maps in a texture space, and their confidence."""
    maps = {
        item.name: value
        for item in dataclasses.fields(reflectance)
        if isinstance(value := getattr(reflectance, item.name), np.ndarray)
    }
    planes = [value.reshape(*value.shape[:2], -1) for value in maps.values()]
    texture, confidence = bake(np.concatenate(planes, axis=-1), shape, scan, size, visible)
    ends = np.cumsum([plane.shape[-1] for plane in planes])
    parts = np.split(texture, ends[:-1], axis=-1)
    shaped = {
        name: part.reshape(size, size, *value.shape[2:])
        for (name, value), part in zip(maps.items(), parts, strict=True)
    }
    return dataclasses.replace(reflectance, **shaped), confidence


def _textured(name: str, reflectance: Recovered, confidence: NDArray[np.float32]) -> bpy.types.Material:
    """Return the material of a reflectance, with its confidence as an image that nothing reads."""
    material = surface_material(name, reflectance)
    nodes = material.node_tree.nodes
    shown = nodes.new("ShaderNodeTexImage")
    shown.image = pixels.packed_image(f"{name} Confidence", confidence)
    shown.label, shown.location, shown.width = "Confidence: 0 where the pictures show nothing", (-420, -820), 260
    for node in nodes:
        if node.type == "TEX_IMAGE":
            node.extension = "REPEAT"
    return material
