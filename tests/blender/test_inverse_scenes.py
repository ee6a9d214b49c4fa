"""Inverse on scenes as people have them: skies, shining surfaces, instances, meshes without UVs, GGX, checkers."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import numpy as np
import pytest

from pipeline import cli
from pipeline.blender import cycles
from pipeline.blender.inverse import groups
from pipeline.blender.inverse.photograph import photographed
from pipeline.blender.inverse.room import Room
from pipeline.blender.unwrap import PROJECTED
from pipeline.core.images import read_rgb
from pipeline.core.inverse import Model
from pipeline.core.inverse.photograph import Photograph
from pipeline.core.progress import finish
from scenes import rooms
from scenes.rooms import surface
from scenes.stage import material

SIZE = (80, 60)
SKY, PANEL, LAMP = 0.4, 6.0, 30.0  # strengths, and watts
METAL, ALPHA = (0.8, 0.6, 0.3), 0.1
STOOL, PLASTER = (0.5, 0.3, 0.1), (0.7, 0.7, 0.65)


@pytest.fixture
def still() -> bpy.types.Scene:
    """A checkered floor without UVs, a GGX ball, an instanced block, a glass ball; under a sky, a panel and a lamp."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    world = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0):
        world.use_nodes = True
    sky = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    sky.inputs["Color"].default_value, sky.inputs["Strength"].default_value = (0.5, 0.7, 1.0, 1.0), SKY
    scene.world = world
    checker = material("Checker", "ShaderNodeBsdfDiffuse", {})
    pattern = checker.node_tree.nodes.new("ShaderNodeTexChecker")
    pattern.inputs["Scale"].default_value = 1.25
    pattern.inputs["Color1"].default_value, pattern.inputs["Color2"].default_value = (
        (0.6, 0.2, 0.2, 1),
        (0.2, 0.2, 0.5, 1),
    )
    place = checker.node_tree.nodes.new("ShaderNodeTexCoord")
    checker.node_tree.links.new(place.outputs["Object"], pattern.inputs["Vector"])
    closure = next(node for node in checker.node_tree.nodes if node.type == "BSDF_DIFFUSE")
    checker.node_tree.links.new(pattern.outputs["Color"], closure.inputs["Color"])
    floor = rooms.quad(scene, "Floor", [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], checker)
    floor.data.uv_layers.remove(floor.data.uv_layers[0])
    metal = material("Metal", "ShaderNodeBsdfAnisotropic", {"Color": (*METAL, 1), "Roughness": ALPHA**0.5})
    _ball(metal, (-0.7, -0.2, 0.55), 0.55)
    _ball(material("Glass", "ShaderNodeBsdfGlass", {}), (0.1, -1.2, 0.2), 0.2)
    rooms.block(scene, "Wall", (0.1, 1.4, 0.5), (1.6, 0.2, 1.0), surface("Plaster", PLASTER))
    stools = bpy.data.collections.new("Stools")
    stool = rooms.block(scene, "Stool", (0, 0, 0.3), (0.6, 0.6, 0.6), surface("Stool", STOOL))
    scene.collection.objects.unlink(stool)
    stools.objects.link(stool)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection, instance.location = "COLLECTION", stools, (0.9, 0.2, 0)
    scene.collection.objects.link(instance)
    panel = material("Panel", "ShaderNodeEmission", {"Color": (1.0, 0.8, 0.6, 1), "Strength": PANEL})
    rooms.quad(scene, "Panel", [(1.4, 0.6, 1.0), (1.4, 1.4, 1.0), (1.4, 1.4, 1.7), (1.4, 0.6, 1.7)], panel)
    light = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    light.data.energy, light.data.shadow_soft_size, light.location = LAMP, 0.0, (-0.8, -1.5, 2.2)
    scene.collection.objects.link(light)
    rooms.camera(scene, (0, -4.2, 1.9), (0, 0.1, 0.4), 42.0)
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = scene.cycles.glossy_bounces = 32
    return scene


def _ball(dress: bpy.types.Material, place: tuple[float, float, float], radius: float) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=place, segments=64, ring_count=32)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(dress)


def room_of(scene: bpy.types.Scene) -> Room:
    """Return the room of a scene beside a white photograph."""
    white = Photograph(np.ones((*SIZE[::-1], 3)), np.ones(SIZE[::-1], bool))
    scene.view_layers[0].update()
    return Room(scene, groups.find(scene, "materials"), white)


def test_what_an_instance_shows_is_a_group(still: bpy.types.Scene) -> None:
    hidden = bpy.data.objects.new("Alone", bpy.data.meshes.new("Alone"))  # in no scene
    hidden.data.materials.append(bpy.data.materials.new("Alone"))
    names = [group.name for group in room_of(still).groups]
    assert sorted(names) == ["Checker", "Metal", "Plaster", "Stool"]


def test_a_mesh_without_uvs_gets_some_and_the_selection_stays(still: bpy.types.Scene) -> None:
    checker = bpy.data.materials["Checker"]
    second = rooms.quad(still, "Second", [(2, -2, 0), (4, -2, 0), (4, 2, 0), (2, 2, 0)], checker)
    second.data.uv_layers.remove(second.data.uv_layers[0])
    chosen, objects = still.objects["Wall"], still.view_layers[0].objects
    for item in still.objects:
        item.select_set(item == chosen)
    objects.active = chosen
    count = len(bpy.data.objects)
    room = room_of(still)
    assert dict(zip((group.name for group in room.groups), room.layers, strict=True)) == {
        "Checker": PROJECTED,
        "Metal": "UVMap",
        "Plaster": "UVMap",
        "Stool": "UVMap",
    }
    corners = [
        np.array([one.vector for one in still.objects[name].data.uv_layers[0].uv]) for name in ("Floor", "Second")
    ]
    assert all((one >= 0).all() and (one <= 1).all() for one in corners)
    apart = [a.min(axis=0) > b.max(axis=0) for a, b in (corners, corners[::-1])]
    assert np.any(apart)  # charts do not lie upon each other
    assert (objects.active, [item.name for item in still.objects if item.select_get()]) == (chosen, ["Wall"])
    assert len(bpy.data.objects) == count


def test_pixels_tell_what_they_show(still: bpy.types.Scene) -> None:
    room = room_of(still)
    index, _, _ = room.layers_of_pixels()
    assert [lamp.name for lamp in room.lamps] == ["Lamp", "Panel", "Sky"]
    assert set(np.unique(index)) == {-4, -2, -1, 0, 1, 2, 3}
    shown = room.render(16, 1)
    assert np.median(shown[index == -4], axis=0) == pytest.approx(PANEL * np.array([1.0, 0.8, 0.6]), rel=1e-3)
    assert np.median(shown[index == -1], axis=0) == pytest.approx(SKY * np.array([0.5, 0.7, 1.0]), rel=1e-3)


def test_lamps_shine_alone_and_add_up(still: bpy.types.Scene) -> None:
    room = room_of(still)
    room.scene.render.resolution_x = 16
    parts = [room.alone(number, 256, number + 1) for number in range(3)]
    assert room.alone(None, 4, 9).max() == 0
    assert all(part.mean() > 0.01 for part in parts)
    assert np.mean(parts, axis=(1, 2, 3)).sum() == pytest.approx(room.render(256, 7).mean(), rel=0.05)
    assert [lamp.power for lamp in room.lamps] == pytest.approx([LAMP, PANEL, SKY])


def test_every_texture_that_is_painted_is_rendered(still: bpy.types.Scene) -> None:
    room = room_of(still)
    number = next(place for place, group in enumerate(room.groups) if group.name == "Checker")
    index, _, _ = room.layers_of_pixels()
    floor = index == number
    plain = None
    for value in (0.5, 0.1, 0.4, 0.2, 0.6, 0.05, 0.3, 0.15):
        room.paint(number, np.full((32, 32, 3), value, np.float32))
        room.show(number, Model("texture", np.ones(3), np.zeros(3)))
        shown = room.render(4, 1, steady=True)[floor].mean()
        plain = plain or shown / value
        assert shown == pytest.approx(plain * value, rel=0.3)


def test_the_same_seed_gives_the_same_noise_whatever_was_rendered_before(still: bpy.types.Scene) -> None:
    room = room_of(still)
    before = room.render(2, 1, steady=True)
    room.render(64, 2, denoised=True)
    assert (room.render(2, 1, steady=True) == before).all()
    cycles.forget(still)
    assert (room.render(2, 1, steady=True) == before).all()
    assert (room.render(2, 3, steady=True) != before).any()


def test_denoised_pictures_have_less_noise(still: bpy.types.Scene) -> None:
    room = room_of(still)
    true = room.render(512, 1)
    plain, smooth = (
        np.abs(np.log((room.render(2, 5, denoised=on) + 0.01) / (true + 0.01))).mean() for on in (False, True)
    )
    assert smooth < 0.7 * plain


def test_a_photograph_has_the_light_of_the_world(still: bpy.types.Scene, tmp_path: Path) -> None:
    bpy.data.objects.remove(still.objects["Lamp"])
    bpy.data.objects.remove(still.objects["Panel"])
    still.render.resolution_x, still.render.resolution_y = 16, 12
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "still.blend"))
    finish(photographed(str(tmp_path / "still.blend"), tmp_path / "photograph.exr", passes=1))
    assert read_rgb(tmp_path / "photograph.exr").min() > 0.01


def test_settings_that_are_the_same_are_not_set_but_restored() -> None:
    class Counted:
        """A struct that counts how often it is set."""

        times = 0

        def __setattr__(self, name: str, value: object) -> None:
            object.__setattr__(self, name, value)
            object.__setattr__(self, "times", self.times + 1)

    owner = Counted()
    owner.same, owner.other = 1, 2  # type: ignore[attr-defined]
    with cycles.changed(owner, {"same": 1, "other": 3}):
        assert (owner.other, owner.times) == (3, 3)  # type: ignore[attr-defined]
        owner.same = 5  # type: ignore[attr-defined]
    assert (owner.same, owner.other) == (1, 2)  # type: ignore[attr-defined]


@pytest.mark.slow
def test_everything_comes_back_under_lamps_of_unknown_power(still: bpy.types.Scene, tmp_path: Path) -> None:
    still.cycles.samples, still.cycles.seed, still.cycles.use_adaptive_sampling = 1024, 1_000_099, False
    still.cycles.blur_glossy = still.cycles.sample_clamp_indirect = 0.0
    still.render.use_file_extension = False
    with cycles.openexr(still):
        cycles.render(still, tmp_path / "photograph.exr")
    bpy.data.lights["Lamp"].energy = 3 * LAMP
    bpy.data.worlds["Sky"].node_tree.nodes["Background"].inputs["Strength"].default_value = SKY / 3
    bpy.data.materials["Panel"].node_tree.nodes["Emission"].inputs["Strength"].default_value = PANEL / 2
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "still.blend"))
    words = ["inverse", str(tmp_path / "still.blend"), str(tmp_path / "photograph.exr"), "-o", str(tmp_path / "out")]
    words += ["--json", str(tmp_path / "found.json"), "--budget", "90", "--unknown-lamps", "all"]
    assert cli.main(words) == 0
    found = json.loads((tmp_path / "found.json").read_text())
    groups = found["groups"]
    wanted = {"Checker": "texture", "Metal": "isotropic", "Plaster": "diffuse", "Stool": "diffuse"}
    assert {name: one["level"] for name, one in groups.items() if one["level"] != "kept"} == wanted
    assert groups["Stool"]["rho_d"] == pytest.approx(STOOL, rel=0.05)
    assert groups["Plaster"]["rho_d"] == pytest.approx(PLASTER, rel=0.05)
    assert groups["Metal"]["distribution"] == "ggx"
    assert groups["Metal"]["alpha_x"] == pytest.approx(ALPHA, rel=0.15)
    assert groups["Metal"]["rho_s"] == pytest.approx(METAL, rel=0.06)
    powers = {lamp["name"]: lamp["power"] for lamp in found["lamps"]}
    assert powers == pytest.approx({"Lamp": LAMP, "Panel": PANEL, "Sky": SKY}, rel=0.05)
