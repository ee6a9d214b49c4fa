"""The captures that unknown lights are measured on: bodies of three materials or paints, sets of lights, some noise.

The lights are in the captures, for the error of those recovered; the solver does not see them.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from pipeline.core import images
from pipeline.core.capture import Capture
from pipeline.core.capture_settings import CaptureSettings
from pipeline.core.progress import finish

COUNT, TESTED = 12, 4  # photographs that are given, and those of other lights
CONE = math.radians(60)  # half angle about the view in which the lamp is held
UNEVEN = 0.2  # strengths differ by so much either way
NEAR = (1.2, 2.5)  # least and most distance of a near lamp, in diameters of the body
NOISE = 0.005  # of the brightest value but the highlights'
SIZE = 128


@dataclasses.dataclass(frozen=True)
class Case:
    """One set of photographs: body, field of view [degrees], whether all lights are as strong, number of the set.

    Near lights are as strong as each other in power. A matt body has three paints instead of three materials.
    """

    body: str
    view: int
    equal: bool
    lights: int
    near: bool = False
    matt: bool = False

    @property
    def name(self) -> str:
        strengths = "equal" if self.equal else "unequal"
        return f"unknown-{self.body}-{self.view}-{strengths}-{self.lights}" + self.near * "-near" + self.matt * "-matt"


def directions(seed: int) -> NDArray[np.float64]:
    """Return unit directions (16, 3) in camera space as a hand holds a lamp, evenly but for chance."""
    random = np.random.default_rng(seed)
    count = COUNT + TESTED
    order = random.permutation(count)
    height = 1 - (1 - math.cos(CONE)) * (order + random.uniform(0.2, 0.8, count)) / count
    angle = 2 * math.pi * (np.arange(count) * 0.618 + random.uniform() + 0.1 * random.standard_normal(count))
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)


def made(cache: Path, case: Case) -> Capture:
    """Return the capture of a case, rendered where the folder does not hold it; its last lights are for testing."""
    folder = cache / case.name
    if not (folder / "capture.json").is_file() or Capture.open(folder).changed():
        _render(folder, case)
    return Capture.open(folder)


def _render(folder: Path, case: Case) -> None:
    import bpy  # noqa: F401  mathutils is a part of it
    from mathutils import Vector

    from pipeline.blender import capture, scene
    from pipeline.blender.camera import camera_of
    from scenes import gourd

    loaded = scene.load("gourd")
    item = next(one for one in loaded.objects if one.name.startswith("Gourd"))
    if case.body != "gourd":
        item = _replaced(item, loaded, {"bunny": _bunny, "bowl": _bowl}[case.body](loaded))
    if case.matt:
        _paint(item)
    camera = loaded.camera
    half = math.radians(case.view) / 2
    distance = 1.25 / math.sin(half)
    camera.location = distance * Vector(camera.location).normalized()
    camera.data.angle = 2 * half
    loaded.view_layers[0].update()
    model = camera_of(loaded, SIZE)
    random = np.random.default_rng(100 + case.lights)
    strength = np.ones(COUNT + TESTED) if case.equal else 1 + UNEVEN * random.uniform(-1, 1, COUNT + TESTED)
    there = directions(case.lights) @ model.to_world[:3, :3].T
    if case.near:
        there *= gourd.DIAMETER * random.uniform(*NEAR, (len(there), 1))
    folder.mkdir(parents=True, exist_ok=True)
    listed = [f"{len(there)}"] + [f"light_{i:04d}.exr {x:.9f} {y:.9f} {z:.9f}" for i, (x, y, z) in enumerate(there)]
    (folder / "lights.lp").write_text("\n".join(listed) + "\n")
    settings = CaptureSettings(rig=str(folder / "lights.lp"), resolution=SIZE, effects="direct", workers=1)
    found = finish(capture.capture(loaded, "gourd", folder, settings))
    mask = found.mask()
    for light, name in enumerate(found.files):
        picture = found.image(light) * strength[light]
        level = NOISE * np.quantile(picture[mask], 0.99)
        picture += np.where(mask[..., None], level * random.standard_normal(picture.shape), 0)
        images.write_rgb(folder / name, picture.astype(np.float32))
    lights = dataclasses.replace(found.lights, intensity=found.lights.intensity * strength[:, None])
    dataclasses.replace(found, lights=lights, checksums=("",) * len(found)).save()


def _replaced(item: Any, loaded: Any, surface: Any) -> Any:
    """Put another body in the place of the gourd, of its materials, and return it."""
    import bpy

    from scenes import gourd, stage

    surface = stage.centred(surface, gourd.DIAMETER)
    made = stage.add_object(loaded, "Body", surface, item.data.materials[0])
    stage.add_attribute(made, gourd.WEIGHTS, gourd.weights(surface.vertices))
    bpy.data.objects.remove(item)
    return made


def _paint(item: Any) -> None:
    """Give a body three paints in the places of the three materials."""
    from scenes import gourd, stage

    colours = [(0.7, 0.4, 0.2, 1.0), (0.1, 0.3, 0.1, 1.0), (0.5, 0.5, 0.5, 1.0)]
    closures = [("ShaderNodeBsdfDiffuse", {"Color": colour}) for colour in colours]
    item.data.materials[0] = stage.mixture("Paints", closures, gourd.WEIGHTS)


def _bowl(loaded: Any) -> Any:
    """Return the inside of a ball, 75 degrees from its bottom to its brim, that opens nearly towards the camera."""
    from mathutils import Vector

    from scenes.surfaces import Mesh

    down, around = np.meshgrid(np.radians(np.linspace(75, 0.1, 90)), np.linspace(0, 2 * np.pi, 181)[:-1], indexing="ij")
    across = np.sin(down)[..., None] * np.stack([np.cos(around), np.sin(around)], axis=-1)
    points = np.concatenate([across, -np.cos(down)[..., None]], axis=-1)
    number = np.arange(points[..., 0].size).reshape(down.shape)
    beside = np.roll(number, -1, axis=1)
    faces = np.stack([number[:-1], beside[:-1], beside[1:], number[1:]], axis=-1).reshape(-1, 4)
    opening = Vector(loaded.camera.location).normalized() + Vector((0.15, 0.0, 0.1))
    turned = np.array(opening.to_track_quat("Z", "Y").to_matrix())
    return Mesh(points.reshape(-1, 3) @ turned.T, faces)


def _bunny(loaded: Any) -> Any:
    """Return a body with a head, two ears, paws and a tail."""
    import bpy

    from scenes.surfaces import Mesh

    balls = bpy.data.metaballs.new("Bunny")
    balls.resolution = 0.05
    balls.threshold = 0.1
    parts = [
        ((0, 0, 0), 0.95, (1.0, 0.85, 0.9)),
        ((-0.55, -0.1, 0.8), 0.6, (1.0, 0.9, 0.9)),
        ((-0.45, 0.22, 1.45), 0.28, (1, 1, 3.0)),
        ((-0.45, -0.32, 1.4), 0.28, (1, 1, 2.6)),
        ((-0.75, -0.35, -0.6), 0.4, (1.4, 0.9, 0.7)),
        ((-0.75, 0.35, -0.6), 0.4, (1.4, 0.9, 0.7)),
        ((0.15, -0.6, -0.4), 0.55, (1.3, 0.7, 0.9)),
        ((0.95, 0.0, -0.3), 0.35, (1, 1, 1)),
    ]
    for place, radius, stretch in parts:
        element = balls.elements.new(type="ELLIPSOID")
        element.co = place
        element.radius = radius * 1.6
        element.size_x, element.size_y, element.size_z = stretch
    shown = bpy.data.objects.new("Bunny", balls)
    loaded.collection.objects.link(shown)
    loaded.view_layers[0].update()
    mesh = shown.evaluated_get(loaded.view_layers[0].depsgraph).to_mesh()
    vertices = np.array([v.co for v in mesh.vertices], np.float64)
    faces = np.array(
        [
            [*f.vertices, *f.vertices][:4] if len(f.vertices) == 4 else [*f.vertices, f.vertices[0]]
            for f in mesh.polygons
        ]
    )
    bpy.data.objects.remove(shown)
    return Mesh(vertices, faces)
