"""What was drawn for a sample as a Blender scene: object, ground, material, camera."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from ...core.camera import Camera
from ...core.dataset.draw import Sample, Stream
from ...core.dataset.recipe import OWN, SHAPES, Recipe
from .. import geometry, scans
from .. import scene as scenes
from ..camera import add_camera
from .materials import material_of

NAME = "Object"
GROUND = 3.0  # radius of the ground, in radii of the object
FAR = 4.0  # distance of a camera without perspective, in radii of the object
UP = np.array([0.0, 0.0, 1.0])


def build(recipe: Recipe, sample: Sample) -> tuple[bpy.types.Scene, str]:
    """Build a sample's scene without lights, in place of what is open; return it and the name of its material.

    Raises
    ------
    LightsphereError
        For a scene, mesh or BRDF file that cannot be read.
    """
    is_scene = False
    if sample.shape in SHAPES:
        scene = _made(sample)
    elif Path(sample.shape).suffix.lower() in scans.IMPORTERS:
        scene = _mesh(sample)
    else:
        scene, is_scene = scenes.load(sample.shape), True
    name = OWN
    if sample.material != OWN:
        material, name = material_of(recipe, sample)
        _clothe(scene, material)
    if recipe.shape.ground and not is_scene:
        low, high = bounds(geometry.object_triangles(scene))
        scenes.part("stage").add_ground(scene, float(low[2]), GROUND * float(np.linalg.norm(high - low)) / 2)
    return scene, name


def bounds(triangles: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lower and upper corner (3,) of triangles (T, 3, 3)."""
    return triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))


def ball_about(triangles: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return centre (3,) and radius of a ball about triangles [m]: the centre is that of their bounding box."""
    low, high = bounds(triangles)
    centre = (low + high) / 2
    return centre, float(np.linalg.norm(triangles - centre, axis=-1).max())


def place_camera(
    scene: bpy.types.Scene, recipe: Recipe, sample: Sample, centre: NDArray[np.float64], radius: float
) -> Camera:
    """Add the sample's camera, which frames a ball, and make it the scene's."""
    azimuth, elevation = np.radians((sample.azimuth, sample.elevation))
    flat = np.cos(elevation)
    direction = np.array([flat * np.sin(azimuth), -flat * np.cos(azimuth), np.sin(elevation)])
    side = recipe.camera.resolution
    half = np.radians(sample.field_of_view) / 2
    if recipe.camera.model == "pinhole":
        distance, focal = sample.margin * radius / np.sin(half), side / 2 / np.tan(half)
    else:
        distance, focal = FAR * radius, side / (2 * sample.margin * radius)
    to_world = np.array(Matrix.Translation(centre + distance * direction))
    to_world[:3, :3] = np.array(Vector(direction).to_track_quat("Z", "Y").to_matrix())
    camera = Camera(recipe.camera.model, to_world, (side, side), (focal, focal), (side / 2, side / 2))
    data = add_camera(scene, camera).data
    data.clip_start, data.clip_end = distance / 1000, 1000 * distance
    return camera


def light_axis(recipe: Recipe, camera: Camera, centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit direction (3,) that the lights' angles are counted from."""
    if recipe.shape.ground:
        return UP
    view = camera.to_world[:3, 3] - centre
    return np.asarray(view / np.linalg.norm(view))


def _made(sample: Sample) -> bpy.types.Scene:
    stage = scenes.part("stage")
    random = Stream(sample.shape_seed, 0, sample.shape).random
    mesh = stage.centred(scenes.part("shapes").SHAPES[sample.shape](sample.detail, random), sample.extent)
    scene = scenes.empty()
    stage.add_object(scene, NAME, mesh, bpy.data.materials.new(NAME))
    return scene


def _mesh(sample: Sample) -> bpy.types.Scene:
    """Read a mesh, and bring it to the sample's extent and the origin."""
    items = scans.load(Path(sample.shape), 1.0)
    scene = bpy.context.scene
    scene.world = None
    low, high = bounds(geometry.object_triangles(scene))
    placed = Matrix.Scale(sample.extent / max(float((high - low).max()), 1e-30), 4) @ Matrix.Translation(
        Vector(-(low + high) / 2)
    )
    for item in scene.objects:
        if item.parent is None:
            item.matrix_world = placed @ item.matrix_world
    for item in items:
        if not any(slot.material for slot in item.material_slots):
            item.data.materials.clear()
            item.data.materials.append(bpy.data.materials.get(NAME) or bpy.data.materials.new(NAME))
    scene.view_layers[0].update()
    return scene


def _clothe(scene: bpy.types.Scene, material: bpy.types.Material) -> None:
    """Give a material to all surfaces of the object."""
    for item in scene.objects:
        if item.type in geometry.RENDERED and not item.get(geometry.BACKDROP):
            item.data.materials.clear()
            item.data.materials.append(material)
