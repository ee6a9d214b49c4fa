"""Recovered meshes as Blender's."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.shape.mesh import Mesh

UV_LAYER = "UVMap"


def add_mesh(scene: bpy.types.Scene, name: str, mesh: Mesh, material: bpy.types.Material) -> bpy.types.Object:
    """Add a recovered mesh to a scene as a smooth object with its own normals and UVs.

    Parameters
    ----------
    scene : bpy.types.Scene
    name : str
        Of object and mesh.
    mesh : Mesh
        In world space; the object stands at the origin of its centre, so that it turns about itself.
    material : bpy.types.Material
    """
    centre = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    data = bpy.data.meshes.new(name)
    data.vertices.add(len(mesh.vertices))
    data.vertices.foreach_set("co", _flat(mesh.vertices - centre))
    data.loops.add(3 * len(mesh.faces))
    data.loops.foreach_set("vertex_index", mesh.faces.astype(np.int32).ravel())
    data.polygons.add(len(mesh.faces))
    data.polygons.foreach_set("loop_start", np.arange(0, 3 * len(mesh.faces), 3, dtype=np.int32))
    data.update(calc_edges=True)
    layer = data.uv_layers.new(name=UV_LAYER)
    layer.uv.foreach_set("vector", _flat(mesh.uv[mesh.faces.ravel()]))
    data.shade_smooth()
    data.normals_split_custom_set_from_vertices(mesh.normals.tolist())
    data.materials.append(material)
    item = bpy.data.objects.new(name, data)
    item.location = centre
    scene.collection.objects.link(item)
    return item


def _flat(values: NDArray[Any]) -> NDArray[np.float32]:
    return np.ascontiguousarray(values, np.float32).ravel()
