"""Recovered meshes as Blender's."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.shape import Shape
from ..core.shape.mesh import Mesh

UV_LAYER = "UVMap"


def add_mesh(scene: bpy.types.Scene, name: str, mesh: Mesh, material: bpy.types.Material | None) -> bpy.types.Object:
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
    if material is not None:
        data.materials.append(material)
    item = bpy.data.objects.new(name, data)
    item.location = centre
    scene.collection.objects.link(item)
    return item


def decimated(mesh: Mesh, keep: float, shape: Shape) -> Mesh:
    """Return a relief with a share of its triangles, its contour kept best; normals are the pixels' where vertices are.

    Edges are collapsed in the order of the error that they make (Garland and Heckbert 1997, Blender's modifier).

    Parameters
    ----------
    mesh : Mesh
    keep : float
        Share of the triangles, above 0 to 1.
    shape : Shape
        What the mesh was made from.
    """
    scene = bpy.data.scenes.new("Decimate")
    item = add_mesh(scene, "Decimate", mesh, None)
    modifier = item.modifiers.new("Decimate", "DECIMATE")
    modifier.ratio, modifier.use_collapse_triangulate = keep, True
    layer = scene.view_layers[0]
    layer.update()
    simple = item.evaluated_get(layer.depsgraph).data
    vertices, faces = np.empty(3 * len(simple.vertices), np.float32), np.empty(3 * len(simple.polygons), np.int32)
    simple.vertices.foreach_get("co", vertices)
    simple.loops.foreach_get("vertex_index", faces)
    points = vertices.reshape(-1, 3).astype(np.float64) + np.array(item.location)
    data = item.data
    bpy.data.objects.remove(item)
    bpy.data.meshes.remove(data)
    bpy.data.scenes.remove(scene)
    place, _ = shape.camera.project(points)  # what collapsing makes of the coordinates is up to half a pixel off
    uv = np.stack([place[:, 0], shape.camera.resolution[1] - place[:, 1]], axis=-1) / shape.camera.resolution
    return Mesh(points, shape.normals_at(uv), uv, faces.reshape(-1, 3).astype(np.int64))


def _flat(values: NDArray[Any]) -> NDArray[np.float32]:
    return np.ascontiguousarray(values, np.float32).ravel()
