"""Meshes that a user brings: read by Blender's importers, given UVs where they have none, hit by a camera's rays."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray

from ..core import images
from ..core.camera import Camera
from ..core.capture import Capture
from ..core.errors import INPUT_AT_FAULT, LightsphereError
from ..core.shape import Shape
from ..core.shape.scan import Scan, seen
from . import workers
from .output import caught_output
from .unwrap import PROJECTED, unwrap

COMMAND = "mesh-worker"
IMPORTERS: dict[str, Callable[..., Any]] = {
    ".ply": lambda path: bpy.ops.wm.ply_import(filepath=path),
    ".obj": lambda path: bpy.ops.wm.obj_import(filepath=path),
    ".gltf": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".glb": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".usd": lambda path: bpy.ops.wm.usd_import(filepath=path),
    ".usda": lambda path: bpy.ops.wm.usd_import(filepath=path),
    ".usdc": lambda path: bpy.ops.wm.usd_import(filepath=path),
    ".usdz": lambda path: bpy.ops.wm.usd_import(filepath=path),
}
KEPT = ("MESH", "EMPTY")  # of what a file brings; empties are parents of meshes
SHARP = np.radians(40)  # angle of two faces of a mesh without normals from which on the edge between them is sharp
BEHIND = 1e-4  # how far before a point its own surface may be hit, share of the mesh's extent


def load(path: Path, unit: float) -> list[bpy.types.Object]:
    """Read the meshes of a file into this Blender, replacing what is open.

    Parameters
    ----------
    path : Path
        PLY, OBJ, glTF or USD. Blender's importers turn glTF's and OBJ's y axis up to z.
    unit : float
        Of the file's lengths [m].

    Returns
    -------
    list of bpy.types.Object
        With their names, parents, materials and UVs. A mesh without normals is shaded smooth but for edges of 40
        degrees and more; one without UVs gets Blender's smart projection.

    Raises
    ------
    LightsphereError
        When the file is missing, of an unknown kind, damaged, or without faces.
    """
    bring(path)
    scene = bpy.context.scene
    for item in list(scene.objects):
        if item.type not in KEPT:
            bpy.data.objects.remove(item)
    meshes = [item for item in scene.objects if item.type == "MESH" and len(item.data.polygons)]
    if not meshes:
        raise LightsphereError(f"{path} holds no mesh with faces; export the surface, not its points or curves")
    scene.view_layers[0].update()
    for item in scene.objects:
        if item.parent is None:
            item.matrix_world = Matrix.Scale(unit, 4) @ item.matrix_world
    for item in meshes:
        if item.data.users > 1:
            item.data = item.data.copy()  # each copy has its own place on the textures
        _complete(scene, item)
    scene.view_layers[0].update()
    return meshes


def bring(path: Path) -> None:
    """Let Blender's importer read a file into an empty scene; raise LightsphereError where it cannot be read."""
    importer = IMPORTERS.get(path.suffix.lower())
    if importer is None:
        raise LightsphereError(f"{path} is no mesh that can be read; give one of {', '.join(IMPORTERS)}")
    if not path.is_file():
        raise LightsphereError(f"{path} does not exist; give the file of a mesh")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    try:
        with caught_output():
            importer(str(path.resolve()))
    except (RuntimeError, ValueError) as error:
        raise LightsphereError(f"{path} cannot be read ({' '.join(str(error).split())}); export it again") from error


def shape_of(capture: Capture, path: Path, unit: float) -> Shape:
    """Return the shape that a capture's camera sees of a mesh file; see :func:`load` and :func:`seen` for errors.

    Its notes name the method, the unit, the file's checksum and the objects that had no UVs. The file is read in a
    process of its own first, for Blender's importers end theirs over some damaged files.
    """
    _bring_apart(path)
    items = load(path, unit)
    scan = scan_of(items)
    shape = seen(capture, scan, Caster(scan).first(capture.camera))
    shape.notes.update(method="mesh", mesh_unit=unit, mesh_sha256=images.checksum(path), projected=without_uvs(items))
    return shape


def _bring_apart(path: Path) -> None:
    """Raise LightsphereError where Blender's importer does not survive a file; what it refuses, :func:`load` says."""
    command, environment = workers.command_line(COMMAND, str(path))
    done = subprocess.run(command, env=environment, capture_output=True, check=False)
    if done.returncode not in (0, INPUT_AT_FAULT):
        raise LightsphereError(
            f"{path} cannot be read (Blender's importer ended with status {done.returncode}); it is damaged, or too "
            "large for this machine's memory: export it again, or a coarser one"
        )


def without_uvs(items: list[bpy.types.Object]) -> list[str]:
    """Return the names of the objects whose UVs were projected."""
    return [item.name for item in items if _uvs(item).name == PROJECTED]


def slots(items: list[bpy.types.Object]) -> list[tuple[bpy.types.Object, int]]:
    """Return the objects' material slots, each of which has a texture space of its own; one where there are none."""
    return [(item, slot) for item in items for slot in range(max(1, len(item.data.materials)))]


def scan_of(items: list[bpy.types.Object]) -> Scan:
    """Return the triangles of objects in the world; parts are numbered as :func:`slots` orders them."""
    parts, first = [], 0
    for item in items:
        data, matrix = item.data, np.array(item.matrix_world, np.float64)
        data.calc_loop_triangles()
        corners = _read(data.loop_triangles, "vertices", 3, np.int32).reshape(-1, 3)
        loops = _read(data.loop_triangles, "loops", 3, np.int32).reshape(-1, 3)
        points = _read(data.vertices, "co", 3).reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
        normals = _read(data.corner_normals, "vector", 3).reshape(-1, 3) @ np.linalg.inv(matrix[:3, :3])
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30)
        uv = _read(_uvs(item).uv, "vector", 2).reshape(-1, 2)
        last = max(1, len(data.materials)) - 1
        slot = np.minimum(_read(data.loop_triangles, "material_index", 1, np.int32), last).astype(np.int64)
        parts.append(Scan(points[corners], normals[loops], uv[loops], first + slot))
        first += last + 1
    fields = ("corners", "normals", "uv", "part")
    return Scan(*(np.concatenate([getattr(part, name) for part in parts]) for name in fields))


class Caster:
    """Casts rays on triangles."""

    def __init__(self, scan: Scan) -> None:
        corners = scan.corners.reshape(-1, 3)
        self.tree = BVHTree.FromPolygons(corners.tolist(), np.arange(len(corners)).reshape(-1, 3).tolist())
        self.slack = BEHIND * float(np.ptp(corners, axis=0).max())

    def first(self, camera: Camera, mask: NDArray[np.bool_] | None = None) -> NDArray[np.int64]:
        """Return the first triangle that each pixel's ray meets, (H, W); -1 for none."""
        origins, directions = camera.rays()
        face = np.full(origins.shape[:2], -1, np.int64)
        for place in np.argwhere(np.ones_like(face, bool) if mask is None else mask):
            index = self.tree.ray_cast(Vector(origins[tuple(place)]), Vector(directions[tuple(place)]))[2]
            face[tuple(place)] = -1 if index is None else index
        return face

    def visible(self, camera: Camera, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points (K, 3) nothing hides from a camera."""
        place, distance = camera.project(points)
        width, height = camera.resolution
        inside = (place >= 0).all(axis=-1) & (place[:, 0] <= width) & (place[:, 1] <= height) & (distance > 0)
        origins, directions = camera.rays_at(place)
        reach = distance - self.slack
        for k in np.flatnonzero(inside):
            inside[k] = self.tree.ray_cast(Vector(origins[k]), Vector(directions[k]), reach[k])[2] is None
        return inside


def _complete(scene: bpy.types.Scene, item: bpy.types.Object) -> None:
    """Give a mesh normals and UVs where it has none."""
    import bmesh  # there is none before bpy

    data = item.data
    if not data.has_custom_normals and not any(polygon.use_smooth for polygon in data.polygons):
        whole = bmesh.new()
        whole.from_mesh(data)  # a format with one UV a vertex doubles vertices at the charts' borders
        bmesh.ops.remove_doubles(whole, verts=whole.verts, dist=1e-7 * max(item.dimensions))
        whole.to_mesh(data)
        whole.free()
        data.shade_smooth()
        data.set_sharp_from_angle(angle=SHARP)
    if data.uv_layers.active is None:
        unwrap(scene, [data])


def _uvs(item: bpy.types.Object) -> bpy.types.MeshUVLoopLayer:
    """Return the UVs that textures use."""
    return next(layer for layer in item.data.uv_layers if layer.active_render)


def _read(items: Any, name: str, width: int, kind: Any = np.float32) -> NDArray[Any]:
    flat = np.empty(width * len(items), kind)
    items.foreach_get(name, flat)
    return flat if kind == np.int32 else flat.astype(np.float64)
