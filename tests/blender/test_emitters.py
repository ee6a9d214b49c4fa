"""Lights of a Blender scene as emitters: what they make of a Lambertian floor against Cycles."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from pipeline.blender import cycles, emitters, exr
from pipeline.blender.camera import camera_of
from pipeline.core.errors import LightsphereError
from pipeline.core.relight.emitters import Emitter
from tests import tolerances
from tests.blender import small_scenes

SIZE = 16
ALBEDO = 0.5


def floor() -> bpy.types.Scene:
    """A Lambertian floor of 20 m in the plane z = 0, seen from above."""
    scene = small_scenes.empty()
    bpy.ops.mesh.primitive_plane_add(size=20)
    bpy.context.object.data.materials.append(small_scenes.diffuse("Floor", ALBEDO))
    small_scenes.aim(scene, (0.0, 0.5, 9.0), 0.5)
    return scene


def add(scene: bpy.types.Scene, kind: str, **values: Any) -> bpy.types.Object:
    """Add a slanted, coloured light above the floor."""
    data = bpy.data.lights.new("Lamp", kind)
    data.color = (1.0, 0.6, 0.3)
    data.shadow_soft_size = 0.0
    for name, value in values.items():
        setattr(data, name, value)
    item = bpy.data.objects.new("Lamp", data)
    item.location, item.rotation_euler = (0.7, -0.4, 2.0), (0.3, 0.2, 0.5)
    scene.collection.objects.link(item)
    return item


def stretched(scene: bpy.types.Scene) -> None:
    add(scene, "SPOT", energy=50.0, spot_size=1.2, spot_blend=0.4).scale = (1.5, 0.7, 1.0)


def nodes_of(scene: bpy.types.Scene, kind: str, **values: Any) -> tuple[bpy.types.NodeTree, bpy.types.Node]:
    """Add a light that shines through nodes; return them and the one that emits."""
    light = add(scene, kind, **values).data
    light.use_nodes = True
    emission = next(node for node in light.node_tree.nodes if node.type == "EMISSION")
    return light.node_tree, emission


def profiled(scene: bpy.types.Scene, kind: str = "POINT", **values: Any) -> None:
    """Add a light with an IES profile that is another on every side."""
    tree, emission = nodes_of(scene, kind, **values)
    profile = tree.nodes.new("ShaderNodeTexIES")
    profile.mode = "INTERNAL"
    profile.ies = bpy.data.texts.new("profile.ies")
    profile.ies.write(IES)
    tree.links.new(profile.outputs[0], emission.inputs["Strength"])


def tinted(scene: bpy.types.Scene, kind: str, **values: Any) -> None:
    _, emission = nodes_of(scene, kind, **values)
    emission.inputs["Strength"].default_value = 3.0
    emission.inputs["Color"].default_value = (0.2, 1.0, 0.5, 1.0)


# Planes of a luminaire of Type C [cd]: at 45 and 90 degrees from its axis another value on every side.
IES = """IESNA:LM-63-2002
TILT=NONE
1 -1 1 3 5 1 2 0 0 0
1 1 1
0 45 90
0 90 180 270 360
500 400 100
500 100 0
500 200 50
500 300 0
500 400 100
"""

LIGHTS: dict[str, Callable[[bpy.types.Scene], Any]] = {
    "point": lambda s: add(s, "POINT", energy=30.0, exposure=1.0),
    "ball": lambda s: add(s, "POINT", energy=30.0, shadow_soft_size=0.4, use_soft_falloff=False),
    "warm point": lambda s: add(s, "POINT", energy=30.0, use_temperature=True, temperature=3000.0),
    "spot": lambda s: add(s, "SPOT", energy=50.0, spot_size=1.0, spot_blend=0.6),
    "stretched spot": stretched,
    "soft spot": lambda s: add(
        s, "SPOT", energy=50.0, spot_size=1.0, spot_blend=0.6, shadow_soft_size=0.3, use_soft_falloff=False
    ),
    "slatted square": lambda s: add(s, "AREA", energy=40.0, shape="SQUARE", size=0.8, spread=1.2),
    "profile": lambda s: profiled(s, energy=2.0),
    "profile in a spot": lambda s: profiled(s, "SPOT", energy=2.0, spot_size=1.0, spot_blend=0.6),
    "profile of a ball": lambda s: profiled(s, energy=2.0, shadow_soft_size=0.2, use_soft_falloff=False),
    "tinted square": lambda s: tinted(s, "AREA", energy=40.0, shape="SQUARE", size=0.8),
    "tinted sun": lambda s: tinted(s, "SUN", energy=2.0, angle=0.0),
    "square": lambda s: add(s, "AREA", energy=40.0, shape="SQUARE", size=0.8),
    "ellipse": lambda s: add(s, "AREA", energy=40.0, shape="ELLIPSE", size=1.2, size_y=0.5),
    "sun": lambda s: add(s, "SUN", energy=2.0, angle=0.0),
    "wide sun": lambda s: add(s, "SUN", energy=2.0, angle=0.6),
}


def rendered(scene: bpy.types.Scene, folder: Path, samples: int) -> np.ndarray[Any, Any]:
    with cycles.measuring(scene, camera_of(scene, SIZE), cycles.Transport(samples=samples)), cycles.openexr(scene):
        cycles.render(scene, folder / "floor.exr")
    channels = exr.read(folder / "floor.exr")
    return np.stack([channels[letter] for letter in "RGB"], axis=-1)


def closed_form(scene: bpy.types.Scene, lights: list[Emitter]) -> np.ndarray[Any, Any]:
    """Return albedo / pi times the sum of E cos."""
    origins, directions = camera_of(scene, SIZE).rays()
    points = (origins - origins[..., 2:] / directions[..., 2:] * directions).reshape(-1, 3)
    total = np.zeros_like(points)
    for light in lights:
        to_light = light.place - (0 if light.distant else points)
        cosine = np.maximum(to_light[..., 2] / np.linalg.norm(to_light, axis=-1), 0.0)
        total += light.irradiance(points) * np.reshape(cosine, (-1, 1))
    return (ALBEDO / np.pi * total).reshape(SIZE, SIZE, 3)


@pytest.mark.parametrize("name", LIGHTS)
def test_a_light_makes_what_cycles_makes_of_it(name: str, tmp_path: Path) -> None:
    scene = floor()
    LIGHTS[name](scene)
    exact = name in ("point", "warm point", "spot", "stretched spot", "sun", "tinted sun")
    reference = rendered(scene, tmp_path, 1 if exact else 256)
    found = closed_form(scene, emitters.of_scene(scene))
    allowed = tolerances.RELIT_POINT if exact else tolerances.RELIT_AREA
    assert reference.max() > 0
    assert np.abs(found - reference).max() <= allowed * reference.max()
    assert np.abs(1.05 * found - reference).max() > allowed * reference.max()
    assert "sun" in name or np.abs(found[:, ::-1] - reference).max() > 3 * allowed * reference.max()


def test_what_nodes_make_of_a_light_is_not_rendered_while_it_moves() -> None:
    scene = floor()
    profiled(scene)
    kept = len(bpy.data.scenes), len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.materials)
    with pytest.raises(LightsphereError, match="'Lamp' shines through nodes"):
        emitters.of_scene(scene, measure=False)
    assert emitters.of_scene(scene)
    assert kept == (len(bpy.data.scenes), len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.materials))


def test_light_that_does_not_fall_off_is_told() -> None:
    scene = floor()
    tree, emission = nodes_of(scene, "POINT", energy=2.0)
    falloff = tree.nodes.new("ShaderNodeLightFalloff")
    tree.links.new(falloff.outputs["Constant"], emission.inputs["Strength"])
    with pytest.raises(LightsphereError, match="'Lamp' does not fall off with the square"):
        emitters.of_scene(scene)
    tree.links.new(falloff.outputs["Quadratic"], emission.inputs["Strength"])
    assert emitters.of_scene(scene)


def test_a_scene_without_lights_is_told(tmp_path: Path) -> None:
    scene = floor()
    add(scene, "POINT", energy=1.0).hide_render = True
    with pytest.raises(LightsphereError, match="no light"):
        emitters.of_scene(scene)
