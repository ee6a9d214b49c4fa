"""A user's mesh in four formats: the camera sees it where it is, and its albedo comes back in its own UVs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline import cli
from pipeline.blender import pixels, scans
from pipeline.blender.camera import camera_of
from pipeline.blender.output import caught_output
from pipeline.core.capture import Capture
from pipeline.core.errors import LightsphereError
from pipeline.core.reflectance import Reflectance
from pipeline.core.reflectance.bake import bake, texture_size
from pipeline.core.shape import Shape
from tests.blender import small_scenes

FORMATS = ("ply", "obj", "glb", "usdc")
COLUMNS, ROWS = 8, 4  # squares of the texture
PIXELS = 48
EXPORT = """import bpy, sys
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
bpy.ops.export_scene.gltf(filepath=sys.argv[2])"""
LIGHT, DARK = (0.8, 0.5, 0.3), (0.2, 0.3, 0.6)


def checker(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """The texture; its squares' brightness differs, so that no two places are alike."""
    column, row = np.floor(u * COLUMNS).astype(int) % COLUMNS, np.floor(v * ROWS).astype(int) % ROWS
    odd = ((column + row) % 2)[..., None]
    return np.where(odd, LIGHT, DARK) * (0.5 + 0.5 * row / ROWS)[..., None]


def texture_of(size_u: int, size_v: int) -> NDArray[np.float64]:
    u, v = np.meshgrid((np.arange(size_u) + 0.5) / size_u, 1 - (np.arange(size_v) + 0.5) / size_v)
    return checker(u, v)


def painted() -> bpy.types.Scene:
    """A ball off the origin, painted through its UVs."""
    scene = small_scenes.empty()
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=0.9, location=(0.1, -0.1, 0.2))
    item = bpy.context.object
    item.name, item.rotation_euler = "Painted", (0.3, 0.2, 0.4)
    item.data.shade_smooth()
    material = bpy.data.materials.new("Paint")
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    image, closure, output = (nodes.new(f"ShaderNode{kind}") for kind in ("TexImage", "BsdfDiffuse", "OutputMaterial"))
    image.image, image.interpolation = pixels.packed_image("Paint", texture_of(COLUMNS, ROWS)), "Closest"
    links.new(image.outputs[0], closure.inputs[0])
    links.new(closure.outputs[0], output.inputs[0])
    item.data.materials.append(material)
    small_scenes.aim(scene, (0.0, -7.0, 2.0), 0.31)
    return scene


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The ball's captured pictures, its shape and reflectance from the GLB, and its mesh in all formats."""
    made = tmp_path_factory.mktemp("painted")
    painted()
    with caught_output():
        bpy.ops.wm.save_as_mainfile(filepath=str(made / "painted.blend"), copy=True)
        bpy.ops.wm.ply_export(filepath=str(made / "ball.ply"))
        bpy.ops.wm.obj_export(filepath=str(made / "ball.obj"))
        bpy.ops.wm.usd_export(filepath=str(made / "ball.usdc"))
        bpy.ops.wm.obj_export(filepath=str(made / "bare.obj"), export_uv=False)
    # In a process of its own: Blender 4.5 never ends one in which numba compiled after its glTF exporter ran.
    subprocess.run(
        [sys.executable, "-c", EXPORT, made / "painted.blend", made / "ball.glb"], check=True, capture_output=True
    )
    rig = ("--inner", "24", "--outer", "12", "--resolution", str(PIXELS), "--effects", "direct", "--workers", "1")
    assert cli.main(["capture", str(made / "painted.blend"), "-o", str(made / "capture"), *rig]) == 0
    assert shaped(made, "ball.glb") == 0
    assert cli.main(["reflectance", str(made / "shape"), "-o", str(made / "reflectance"), "--model", "ggx"]) == 0
    return made


def shaped(folder: Path, mesh: str, *words: str) -> int:
    return cli.main(
        ["shape", str(folder / "capture"), "--mesh", str(folder / mesh), "-o", str(folder / "shape"), *words]
    )


def seen_by(folder: Path, mesh: str) -> tuple[Shape, NDArray[np.float32], NDArray[np.float32]]:
    """Return the shape of a mesh file, the albedo baked on it, and its confidence."""
    capture = Capture.open(folder / "capture")
    shape = scans.shape_of(capture, folder / mesh, 1.0)
    scan = scans.scan_of(scans.load(folder / mesh, 1.0))
    caster = scans.Caster(scan)
    face = caster.first(capture.camera, np.isfinite(shape.depth))
    albedo = Reflectance.open(folder / "reflectance").albedo
    size = texture_size(scan, face[face >= 0])
    return shape, *bake(albedo, shape, scan, size, lambda points: caster.visible(capture.camera, points))


def apart(albedo: NDArray[np.float32], truth: NDArray[np.float64], chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
    return np.asarray(np.abs(albedo - truth).max(axis=-1)[chosen])


@pytest.mark.parametrize("kind", FORMATS)
def test_the_albedo_comes_back_in_the_meshs_own_uvs(folder: Path, kind: str) -> None:
    shape, albedo, confidence = seen_by(folder, f"ball.{kind}")
    truth = Capture.open(folder / "capture").truth()
    assert truth is not None
    known = np.isfinite(shape.depth)
    assert known.sum() > 0.98 * np.isfinite(truth.depth).sum()
    assert np.abs(shape.depth - truth.depth)[known].max() < 1e-4
    assert np.sum(shape.normal * truth.normal, axis=-1)[known].min() > np.cos(np.radians(0.5))
    size = len(albedo)
    within = np.stack(np.meshgrid(*2 * [(np.arange(size) + 0.5) / size]), axis=-1) * [COLUMNS, ROWS] % 1
    inside = ((within > 0.3) & (within < 0.7)).all(axis=-1)  # texels that no pixel of another square reaches
    sure = (confidence > 0.5) & inside
    assert sure.sum() > 100
    assert np.percentile(apart(albedo, texture_of(size, size), sure), 95) < 0.02
    assert np.median(apart(albedo, texture_of(size, size)[::-1], sure)) > 0.1  # flipped UVs must not pass
    assert np.median(apart(albedo, texture_of(size, size)[:, ::-1], sure)) > 0.1
    hidden = confidence == 0
    assert 0.4 < hidden.mean() < 0.7  # the back of the ball


def test_uvs_of_pixels_are_those_of_the_paint(folder: Path) -> None:
    shape = Shape.open(folder / "shape")
    known = np.isfinite(shape.depth) & (shape.confidence == 1)
    albedo = Reflectance.open(folder / "reflectance").albedo
    painted = checker(*(shape.layers[f"uv.{axis}"][known].astype(np.float64) for axis in "UV"))
    assert np.median(np.abs(albedo[known] - painted)) < 0.01


def test_the_asset_is_the_users_mesh_with_baked_textures(folder: Path, tmp_path: Path) -> None:
    blend, figures = tmp_path / "asset.blend", tmp_path / "figures.json"
    assert shaped(folder, "ball.glb") == 0
    words = ["material", str(folder / "reflectance"), "-o", str(blend), "--json", str(figures)]
    assert cli.main(words) == 0
    with caught_output():
        bpy.ops.wm.open_mainfile(filepath=str(blend))
    item = bpy.context.scene.objects["Painted"]
    assert item.location[:] == pytest.approx((0.1, -0.1, 0.2), abs=1e-6)
    assert [layer.name for layer in item.data.uv_layers] == ["UVMap"]
    values = json.loads(figures.read_text())
    assert values["vertices"] == len(item.data.vertices) and values["texels_seen"] > 500
    images = {node.label: node.image for node in item.data.materials[0].node_tree.nodes if node.type == "TEX_IMAGE"}
    assert "Albedo" in images and any(label.startswith("Confidence") for label in images)
    assert bpy.context.scene.camera is not None
    item = next(iter(images.values()))
    assert item.packed_file is not None and item.size[0] == values["texels"][0]


def test_a_mesh_without_uvs_gets_some_and_says_so(folder: Path) -> None:
    shape, albedo, confidence = seen_by(folder, "bare.obj")
    assert shape.notes["projected"] == ["Painted"]
    assert scans.shape_of(Capture.open(folder / "capture"), folder / "ball.obj", 1.0).notes["projected"] == []
    assert (confidence > 0).mean() > 0.1
    low, high = albedo[confidence > 0.5].min(), albedo[confidence > 0.5].max()
    assert low < 0.15 and high > 0.6  # the paint's range


def test_a_changed_mesh_makes_no_asset(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "changed.ply").write_bytes((folder / "ball.ply").read_bytes())
    assert shaped(folder, "changed.ply") == 0
    (folder / "changed.ply").write_bytes((folder / "ball.ply").read_bytes() + b" ")
    capsys.readouterr()
    assert cli.main(["material", str(folder / "reflectance"), "-o", str(tmp_path / "a.blend")]) == 2
    assert "changed; run lightsphere shape --mesh again" in capsys.readouterr().err


def test_what_is_no_mesh_is_refused_in_one_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    (folder / "points.ply").write_text(f"ply\nformat ascii 1.0\nelement vertex 1\n{axes}end_header\n0 0 0\n")
    (folder / "broken.glb").write_bytes(b"glTF no more")
    capsys.readouterr()
    for mesh, words, said in (
        ("nowhere.obj", (), "does not exist"),
        ("painted.blend", (), "no mesh that can be read"),
        ("points.ply", (), "no mesh with faces"),
        ("broken.glb", (), "broken.glb"),
        ("ball.glb", ("--mesh-unit", "0.001"), "check its unit"),
    ):
        assert shaped(folder, mesh, *words) == 2
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1 and said in err, err


def test_a_mesh_that_fells_the_importer_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its header counts more vertices than any memory holds."""
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {2**31 - 1}\n{axes}"
    lists = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (folder / "endless.ply").write_text(head + lists)
    assert shaped(folder, "endless.ply") == 2
    assert "endless.ply cannot be read" in capsys.readouterr().err


def test_hidden_points_are_told_from_seen_ones() -> None:
    painted().view_layers[0].update()
    scan = scans.scan_of([bpy.context.scene.objects["Painted"]])
    eye = camera_of(bpy.context.scene, PIXELS)
    caster = scans.Caster(scan)
    centres = scan.corners.mean(axis=1)
    facing = -(scan.surface_normals() * eye.rays_at(eye.project(centres)[0])[1]).sum(axis=-1)
    clear = np.abs(facing) > 0.05
    np.testing.assert_array_equal(caster.visible(eye, centres)[clear], (facing > 0)[clear])


def test_a_unit_scales_the_file(folder: Path) -> None:
    whole = scans.scan_of(scans.load(folder / "ball.obj", 1.0)).corners
    np.testing.assert_allclose(scans.scan_of(scans.load(folder / "ball.obj", 0.001)).corners, 0.001 * whole, atol=1e-8)
    with pytest.raises(LightsphereError, match="does not exist"):
        scans.load(folder / "nowhere.glb", 1.0)


def test_objects_slots_parents_and_shared_meshes_keep_their_places(tmp_path: Path) -> None:
    scene = small_scenes.empty()
    parent = bpy.data.objects.new("Parent", None)
    parent.location.x = 3
    scene.collection.objects.link(parent)
    bpy.ops.mesh.primitive_cube_add(size=1)
    cube = bpy.context.object
    cube.parent = parent
    for name in ("Sides", "Top"):
        cube.data.materials.append(bpy.data.materials.new(name))
    cube.data.polygons[0].material_index = 1
    twin = bpy.data.objects.new("Twin", cube.data)
    twin.location.y = 5
    scene.collection.objects.link(twin)
    with caught_output():
        bpy.ops.wm.usd_export(filepath=str(tmp_path / "cubes.usdc"))
    items = scans.load(tmp_path / "cubes.usdc", 2.0)
    assert [slot for _, slot in scans.slots(items)] == [0, 1, 0, 1]
    assert items[0].data != items[1].data
    scan = scans.scan_of(items)
    np.testing.assert_array_equal(np.bincount(scan.part), [10, 2, 10, 2])
    centres = sorted(tuple(scan.corners[scan.part // 2 == i].mean(axis=(0, 1)).round(5)) for i in (0, 1))
    assert centres == [(0, 10, 0), (6, 0, 0)]
    assert np.ptp(scan.corners[scan.part < 2], axis=(0, 1)) == pytest.approx([2, 2, 2])
    agree = np.einsum("tci,ti->tc", scan.normals, scan.surface_normals())
    np.testing.assert_allclose(agree, 1, atol=1e-6)  # a cube's edges are sharp


def test_a_mesh_without_normals_is_smooth_across_the_seams_of_its_uvs(folder: Path) -> None:
    scan = scans.scan_of(scans.load(folder / "ball.ply", 1.0))  # PLY doubles the vertices of a seam
    outwards = scan.corners - np.array([0.1, -0.1, 0.2])
    outwards /= np.linalg.norm(outwards, axis=-1, keepdims=True)
    assert np.degrees(np.arccos(np.clip(np.sum(outwards * scan.normals, axis=-1), -1, 1))).max() < 0.5
