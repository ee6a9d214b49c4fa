"""The built-in scenes: what every one of them promises."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest

from pipeline import cli
from pipeline.blender import geometry
from pipeline.blender import scene as scenes
from pipeline.blender.inverse import groups
from pipeline.blender.inverse.room import Room
from pipeline.core.inside import winding_number
from pipeline.core.inverse.photograph import Photograph

NAMES = sorted(name for name, entry in scenes.library().items() if not entry.room)
ROOMS = sorted(set(scenes.library()) - set(NAMES))


def test_names_are_the_contract(capsys: pytest.CaptureFixture[str]) -> None:
    assert {f"teapot-{kind}" for kind in ("lambert", "plastic", "metal", "coat", "beckmann")} <= set(NAMES)
    assert {"gourd", "steps", "thin"} <= set(NAMES)
    assert cli.main(["scenes"]) == 0
    out = capsys.readouterr().out
    assert ROOMS == ["colour-box", "desk-room"]
    assert all(name in out for name in NAMES + ROOMS) and "cast shadows" in out


@pytest.mark.parametrize("name", NAMES)
def test_scene_fits_the_light_spheres_and_the_camera(name: str) -> None:
    scene = scenes.load(name)
    triangles = geometry.object_triangles(scene)
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    assert np.allclose((low + high) / 2, 0, atol=1e-5)
    everything = [item.matrix_world @ v.co for item in scene.objects if item.type == "MESH" for v in item.data.vertices]
    assert np.linalg.norm(everything, axis=1).max() < 1.9
    grounds = [item for item in scene.objects if item.get(geometry.BACKDROP)]
    assert len(grounds) == 1 and grounds[0].location.z == pytest.approx(low[2], abs=1e-6)
    assert scene.camera.location.length == pytest.approx(7, abs=1e-5)
    assert not [item for item in scene.objects if item.type == "LIGHT"] and scene.world is None
    # The whole object is in the picture and fills most of its width or height.
    local = triangles.reshape(-1, 3) @ np.array(scene.camera.matrix_world.to_3x3()) - (0, 0, 7)
    seen = abs(local[:, :2] / -local[:, 2:]) / math.tan(scene.camera.data.angle / 2)
    assert 0.8 < seen.max() <= 1


@pytest.mark.parametrize("name", ["teapot-lambert", "gourd", "steps", "thin"])
def test_surfaces_face_outwards(name: str) -> None:
    triangles = geometry.object_triangles(scenes.load(name))
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    sample = np.random.default_rng(1).choice(len(triangles), 40, replace=False)
    size = np.linalg.norm(normal[sample], axis=1, keepdims=True)
    inwards = triangles[sample].mean(axis=1) - 1e-4 * normal[sample] / size
    # Where parts overlap a point may be inside both.
    assert (winding_number(inwards, triangles) > 0.9).all()


def test_teapot_is_smooth_and_fine() -> None:
    scene = scenes.load("teapot-lambert")
    mesh = scene.objects["Teapot"].data
    assert 50_000 < len(geometry.object_triangles(scene)) < 80_000
    flat = np.array([p.normal for p in mesh.polygons])
    bend = [flat[i] @ mesh.vertices[v].normal for i, p in enumerate(mesh.polygons) for v in p.vertices]
    degrees = np.degrees(np.arccos(np.clip(bend, -1, 1)))
    assert np.percentile(degrees, 99) < 6


def test_gourd_mixes_three_materials_to_one() -> None:
    scene = scenes.load("gourd")
    data = scene.objects["Gourd"].data.attributes["weights"].data
    weights = np.empty(4 * len(data), np.float32)
    data.foreach_get("color", weights)
    weights = weights.reshape(-1, 4)[:, :3]
    assert np.allclose(weights.sum(axis=1), 1, atol=1e-6)
    assert (weights.max(axis=0) > 0.8).all() and (weights.min(axis=0) < 0.05).all()
    closures = {node.bl_idname for node in bpy.data.materials["Gourd"].node_tree.nodes}
    assert {"ShaderNodeBsdfDiffuse", "ShaderNodeBsdfPrincipled", "ShaderNodeMixShader"} <= closures


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_has_lamps_and_a_camera_that_sees_every_group_or_a_mirror_of_it(name: str) -> None:
    scene = scenes.load(name)
    scene.view_layers[0].update()
    assert [item.type for item in scene.objects].count("LIGHT") == 1
    assert (scene.render.resolution_x, scene.render.resolution_y) == (160, 120)
    room = Room(scene, groups.find(scene, "materials"), Photograph(np.zeros((120, 160, 3)), np.ones((120, 160), bool)))
    index, uv, _ = room.layers_of_pixels()
    unseen = {group.name for number, group in enumerate(room.groups) if not (index == number).any()}
    assert unseen == ({"Cube back"} if name == "desk-room" else set())
    poster = index == next((n for n, group in enumerate(room.groups) if group.name == "Poster"), -2)
    if poster.any():
        rows, columns = np.nonzero(poster)
        assert uv[poster][columns.argmax(), 0] > 0.95 and uv[poster][rows.argmin(), 1] > 0.95


def test_rooms_alone_can_be_photographed(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["scenes", "--photograph", "gourd"]) == 2
    assert "colour-box" in capsys.readouterr().err
