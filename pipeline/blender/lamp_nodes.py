"""What nodes make of a light - IES profiles, gobos, falloffs -, measured by Cycles itself.

The light stands alone in the middle of a large white ball; a panorama of the ball's radiance L says what the light
sends in every direction, I = pi L R^2 / rho with rho = 1.
"""

from __future__ import annotations

import contextlib
import dataclasses
import tempfile
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ..core.camera import Camera
from ..core.errors import LightsphereError
from . import cycles, exr
from .ball import ball
from .meshes import add_mesh
from .nodes import new_material

FORWARD = np.array([1.0, -1.0, -1.0])  # of a light's own axes, to those whose z it shines along: its own is -z
SIZE = (256, 128)  # pixels of the panorama
SAMPLES = 32
UNLIKE = 0.05  # of the power, between what two distances say
FAR = 200.0  # sizes of the light that the ball is away
# The camera's axes as columns: where :func:`pipeline.core.relight.environment.sky` has +z above and +x in the middle.
LOOKING = ((0.0, 0.0, -1.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, -1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
PLAIN = {"Color": (1.0, 1.0, 1.0, 1.0), "Strength": 1.0}


def shape_its_light(light: bpy.types.Light) -> bool:
    """Return whether a light has nodes that change what it sends."""
    if not (light.node_tree and light.use_nodes):
        return False
    nodes = light.node_tree.nodes
    if any(node.type not in ("EMISSION", "OUTPUT_LIGHT") for node in nodes):
        return True
    return any(
        tuple(np.atleast_1d(node.inputs[name].default_value)) != tuple(np.atleast_1d(plain))
        for node in nodes
        if node.type == "EMISSION"
        for name, plain in PLAIN.items()
    )


def intensity(item: bpy.types.Object) -> NDArray[np.float64]:
    """Return the radiant intensity (H, W, 3) [W/sr] of a light from afar.

    As :func:`pipeline.core.relight.environment.sky` lays directions out, in the light's axes whose z it shines along.

    Raises
    ------
    LightsphereError
        When a ball four times as near says another: it does not fall off with the square of the distance.
    """
    light = item.data
    far = FAR * max(light.shadow_soft_size if light.type != "AREA" else light.size, 0.05)
    nearer, found = (np.pi * radius**2 * _panorama(item, radius) for radius in (far / 4, far))
    if abs(nearer.sum() - found.sum()) > UNLIKE * found.sum():
        raise LightsphereError(
            f"the light {item.name!r} does not fall off with the square of the distance, by a Light Falloff node or "
            "the like; remove it, or leave the light out of renders"
        )
    return found


def irradiance(item: bpy.types.Object) -> NDArray[np.float64]:
    """Return the irradiance (3,) [W/m^2] of a surface that faces a sun."""
    seen = np.pi * _panorama(item, 1.0)
    return np.asarray(seen.reshape(-1, 3)[seen.sum(axis=-1).argmax()])


def _panorama(item: bpy.types.Object, radius: float) -> NDArray[np.float64]:
    """Return what a white ball about a light reflects from it alone, (H, W, 3)."""
    with _alone(item, radius) as scene, tempfile.TemporaryDirectory() as folder:
        camera = Camera("pinhole", np.eye(4), SIZE, (1.0, 1.0), (SIZE[0] / 2, SIZE[1] / 2))
        transport = cycles.Transport(samples=SAMPLES)
        with cycles.measuring(scene, camera, transport), cycles.openexr(scene):
            cycles.render(scene, Path(folder) / "panorama.exr")
        return exr.read_rgb(Path(folder) / "panorama.exr").astype(np.float64)


@contextlib.contextmanager
def _alone(item: bpy.types.Object, radius: float) -> Iterator[bpy.types.Scene]:
    """Make a scene of a light, a ball about it and a panoramic camera for a while."""
    scene, white = bpy.data.scenes.new("Panorama"), _white()
    around = ball()
    shell = add_mesh(scene, "Panorama", dataclasses.replace(around, vertices=radius * around.vertices), white)
    shell.visible_shadow = False  # a sun shines from beyond it
    camera = bpy.data.cameras.new("Panorama")
    camera.type, camera.clip_end = "PANO", 2 * radius
    (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = "EQUIRECTANGULAR"
    lamp, eye = (bpy.data.objects.new("Panorama", data) for data in (item.data, camera))
    for one in (lamp, eye):
        scene.collection.objects.link(one)
    lamp.scale, lamp.visible_camera = item.matrix_world.to_scale(), False
    eye.matrix_world = Matrix(LOOKING)
    scene.camera = eye
    mesh = shell.data
    try:
        yield scene
    finally:
        for one in (lamp, shell, eye):
            bpy.data.objects.remove(one)
        bpy.data.scenes.remove(scene)
        bpy.data.cameras.remove(camera)
        bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(white)


def _white() -> bpy.types.Material:
    """Make a material perfectly white and matt."""
    material = new_material("Panorama")
    nodes = material.node_tree.nodes
    closure, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    closure.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    material.node_tree.links.new(closure.outputs[0], output.inputs[0])
    return material
