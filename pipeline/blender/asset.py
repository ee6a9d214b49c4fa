"""The asset: recovered mesh and material, the capture's camera, a light and a faint sky in one .blend."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from ..core.camera import Camera
from ..core.errors import LightsphereError
from ..core.material import MaterialSettings
from ..core.material.principled import Principled
from ..core.shape import Shape
from ..core.shape.back import closed
from ..core.shape.mesh import relief
from . import exports, pixels
from . import scene as scenes
from .ball import ball_camera, ball_scene, dress
from .camera import add_camera
from .geometry import BACKDROP
from .materials import Recovered, surface_material
from .meshes import add_mesh, decimated
from .normal_maps import normal_map
from .output import caught_output
from .principled import principled_material

PLAIN = MaterialSettings()
MARK = "lightsphere_asset"  # property of the objects that an asset is made of: their matrix as they were captured
LONGER_SIDE = 720  # pixels of the picture that F12 makes
SKY = (0.055, 0.06, 0.07)
#: Name, direction in camera space, side in extents of the object, radiance of a white surface that faces it.
STUDIO = (("Key", (-0.7, 0.75, 1.0), 0.8, 1.0), ("Fill", (1.0, 0.1, 0.7), 1.6, 0.12))


def write(
    path: Path,
    shape: Shape | None,
    recovered: Recovered,
    name: str,
    settings: MaterialSettings = PLAIN,
    principled: Principled | None = None,
    pbr: Path | None = None,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Write an asset.blend that renders as it is opened; what is open in this Blender is replaced by it.

    Parameters
    ----------
    path : Path
        The file.
    shape : Shape or None
        Gives the mesh, the camera and, where they are known, the errors against truth; a ball shows the material where
        there is none.
    recovered : Reflectance or Surface
    name : str
        Of the object.
    settings : MaterialSettings
    principled : Principled, optional
        Is kept in the file beside the faithful material, or shown in its place where the settings say so.
    pbr : Path, optional
        A folder for the Principled version's maps as plain textures.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    dict
        ``vertices`` and ``triangles``.

    Raises
    ------
    LightsphereError
        When the file exists and may not be replaced, or cannot be written.
    """
    check_free(path, overwrite)
    if shape is None:
        scene, item = ball_scene()
        item.name, normals, seen_by = name, None, ball_camera(LONGER_SIDE)
    else:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        scene, seen_by = bpy.context.scene, shape.camera
        item, normals = add_relief(scene, shape, name, settings)
        for key, value in _figures(shape).items():
            item[key] = value
    dress(item, surface_material(name, recovered, normals))
    if principled is not None:
        keep_principled(item, 0, principled, normals, settings.principled, pbr)
    corners = np.array([item.bound_box[0], item.bound_box[6]]) + np.array(item.location)
    furnish(scene, seen_by, corners)
    save(path, settings.textures)
    return {"vertices": len(item.data.vertices), "triangles": len(item.data.polygons)}


def add_relief(
    scene: bpy.types.Scene, shape: Shape, name: str, settings: MaterialSettings = PLAIN
) -> tuple[bpy.types.Object, NDArray[np.float32]]:
    """Add the relief of a shape to a scene, as simple and as closed as asked; return it and its normal map."""
    mesh = relief(shape)
    if settings.keep < 1:
        mesh = decimated(mesh, settings.keep, shape)
    front = len(mesh.faces)
    if settings.back == "closed":
        mesh = closed(mesh, shape)
    item = add_mesh(scene, name, mesh, None)
    mark(scene, item)
    return item, normal_map(item, shape, front)


def keep_principled(
    item: bpy.types.Object,
    slot: int,
    principled: Principled,
    normals: NDArray[np.float32] | None,
    shown: bool,
    pbr: Path | None,
) -> None:
    """Keep the Principled version of a slot's material in the file; where it is shown, keep the faithful one.

    With a folder, its maps are written there as plain textures, too.
    """
    if pbr is not None:
        exports.write_textures(pbr, principled, normals)
    faithful = item.material_slots[slot].material
    version = principled_material(faithful.name, principled, normals)
    (faithful if shown else version).use_fake_user = True
    if shown:
        item.material_slots[slot].material = version


def mark(scene: bpy.types.Scene, item: bpy.types.Object) -> None:
    """Note that an object is part of an asset, and where it stands as captured, from where an artist may move it."""
    scene.view_layers[0].update()
    item[MARK] = [number for row in item.matrix_world for number in row]


def as_captured(item: bpy.types.Object) -> None:
    """Put an object back to where :func:`mark` noted it; one without a note stays."""
    if MARK in item:
        item.parent = None
        item.matrix_world = Matrix(np.reshape(item[MARK], (4, 4)).tolist())


def append(scene: bpy.types.Scene, path: Path) -> list[bpy.types.Object]:
    """Append the objects of an asset, with their materials, to a scene; its camera and lights stay behind.

    Of a file in which nothing is marked as an asset, every mesh that renders.

    Raises
    ------
    LightsphereError
        When the file cannot be read or shows no mesh.
    """
    try:
        with caught_output(), bpy.data.libraries.load(str(path), link=False) as (there, here):
            here.objects = there.objects
    except OSError as error:
        raise LightsphereError(f"{path} cannot be opened ({error}); give the .blend of an asset") from error
    loaded = set(here.objects)
    meshes = [item for item in here.objects if item.type == "MESH" and not item.hide_render and not item.get(BACKDROP)]
    kept = [item for item in meshes if MARK in item] or meshes
    if not kept:
        raise LightsphereError(f"{path} shows no mesh; give the .blend of an asset")
    for item in kept:
        scene.collection.objects.link(item)
        loaded -= {item, *_above(item)}
    bpy.data.batch_remove(loaded)
    return kept


def _above(item: bpy.types.Object) -> Iterator[bpy.types.Object]:
    """Yield an object's parents, which carry it."""
    while item.parent is not None:
        item = item.parent
        yield item


def check_free(path: Path, overwrite: bool) -> None:
    """Raise LightsphereError when a file exists and may not be replaced."""
    if path.exists() and not overwrite:
        raise LightsphereError(f"{path} exists; choose another name, or replace it with --overwrite")


def save(path: Path, textures: str = "packed") -> None:
    """Save what is open in this Blender, seen through its camera; raise LightsphereError when it cannot be written.

    Textures are ``"packed"`` into the file, or ``"beside"`` it in the folder ``NAME_textures``.
    """
    _look_through_camera()
    if textures == "beside":
        pixels.unpack(path.with_name(f"{path.stem}_textures"))
    scenes.save(path)


def furnish(scene: bpy.types.Scene, seen_by: Camera, points: NDArray[np.float64]) -> None:
    """Add camera, lights and sky for an object of some points (V, 3) in the world, and set what a render needs."""
    camera = add_camera(scene, seen_by)
    low, high = points.min(axis=0), points.max(axis=0)
    centre, extent = Vector((low + high) / 2), float((high - low).max())
    for light, direction, size, radiance in STUDIO:
        add_light(scene, light, camera.matrix_world.to_3x3() @ Vector(direction), centre, extent, size, radiance)
    scene.world = sky()
    width, height = seen_by.resolution
    scale = LONGER_SIDE / max(width, height)
    scene.render.resolution_x, scene.render.resolution_y = round(width * scale), round(height * scale)
    for key, value in {
        "samples": 48,
        "max_bounces": 4,
        "use_adaptive_sampling": True,
        "adaptive_threshold": 0.02,
    }.items():
        setattr(scene.cycles, key, value)
    scene.render.engine = "CYCLES"
    scene.view_settings.view_transform = "Standard"


def add_light(
    scene: bpy.types.Scene, name: str, direction: Vector, target: Vector, extent: float, size: float, radiance: float
) -> bpy.types.Object:
    """Add a square area light that lights a white surface facing it to some radiance.

    Parameters
    ----------
    direction : Vector
        From the target to the light, world space.
    target : Vector
        What it points at [m].
    extent : float
        Size of the object [m]; the light stands 2.2 times as far away.
    size : float
        Side of the light in extents.
    radiance : float
        An area light of P watts gives an irradiance of P / (pi d^2) at the distance d along its axis,
        and a white diffuse surface turns an irradiance E into a radiance E / pi.
    """
    distance = 2.2 * extent
    data = bpy.data.lights.new(name, "AREA")
    data.size = size * extent
    data.energy = float(np.pi**2 * distance**2 * radiance)
    lamp = bpy.data.objects.new(name, data)
    lamp.location = target + distance * direction.normalized()
    lamp.rotation_euler = direction.to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(lamp)
    return lamp


def sky() -> bpy.types.World:
    """Make a faint, even sky."""
    world = bpy.data.worlds.new("Faint sky")
    if bpy.app.version < (5, 0):
        world.use_nodes = True
    background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (*SKY, 1.0)
    return world


def _figures(shape: Shape) -> dict[str, float]:
    errors: dict[str, Any] = shape.notes.get("errors", {})
    return {key: float(value) for key, value in errors.items() if isinstance(value, int | float)}


def _look_through_camera() -> None:
    """Let every 3D view of the file show the asset through the camera with its material."""
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                view = area.spaces.active
                view.region_3d.view_perspective = "CAMERA"
                view.shading.type = "MATERIAL"
