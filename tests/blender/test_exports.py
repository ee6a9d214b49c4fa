"""The Principled version through Cycles, and its exports as other libraries read them."""

from __future__ import annotations

import json
import struct
import zipfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.blender import asset, exports, exr, pixels, views
from pipeline.blender.ball import ball_camera, ball_scene, dress
from pipeline.blender.camera import add_camera
from pipeline.blender.principled import principled_material
from pipeline.blender.round_trip import compared
from pipeline.core import images
from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights
from pipeline.core.material import STOPS, MaterialSettings, Mixture
from pipeline.core.material.closures import Lobe
from pipeline.core.material.principled import Parameters, Principled, fit_principled
from pipeline.core.material.surface import Surface, White
from pipeline.core.progress import finish
from tests import synthetic, tolerances

SIZE = 24


def constant(parameters: Parameters) -> Principled:
    maps = [parameters.base, parameters.tint, parameters.metallic, parameters.roughness]
    return Principled(*(np.asarray(value, np.float32)[None, None] for value in maps))


@pytest.mark.parametrize(
    "parameters",
    [
        Parameters(np.array([0.5, 0.2, 0.1]), np.array([1.0, 0.6, 0.3]), 0.0, 0.3),
        Parameters(np.array([0.5, 0.2, 0.1]), np.array([0.4, 0.4, 0.4]), 0.0, 0.6),
        Parameters(np.array([0.9, 0.6, 0.3]), np.ones(3), 1.0, 0.4),
        Parameters(np.array([0.9, 0.6, 0.3]), np.ones(3), 0.5, 0.4),
    ],
    ids=["plastic", "rough", "metal", "half metal"],
)
def test_cycles_renders_the_principled_as_foreseen(parameters: Parameters) -> None:
    scene, item = ball_scene()
    camera = ball_camera(48)
    add_camera(scene, camera)
    sun = Lights("distant", np.array([[0.5, -0.8, 0.33]]), np.ones((1, 3)), np.zeros(1, int))
    dress(item, principled_material("planted", constant(parameters)))
    shown = finish(views.under_lights(scene, camera, sun))
    normal = np.zeros((48, 48, 3))
    place = (np.indices((48, 48))[::-1].transpose(1, 2, 0) + 0.5 - 24) / (48 / 2.1)
    height = 1 - (place**2).sum(axis=-1)
    normal[..., 0], normal[..., 2], normal[..., 1] = place[..., 0], -place[..., 1], -np.sqrt(np.maximum(height, 0))
    normal[height < 0.1] = np.nan
    error = compared(shown, normal, camera, sun, parameters.evaluate)
    assert error < tolerances.RENDERED_PRINCIPLED
    brighter = Parameters(parameters.base * 0.9, parameters.tint, parameters.metallic, parameters.roughness)
    assert compared(shown, normal, camera, sun, brighter.evaluate) > 3 * tolerances.RENDERED_PRINCIPLED


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A ball of two bases, halves of it, with all its exports."""
    folder = tmp_path_factory.mktemp("exports")
    shape = synthetic.ball(synthetic.camera(SIZE))
    weights = np.full((SIZE, SIZE, 2, 1), np.nan, np.float32)
    weights[np.isfinite(shape.depth)] = 0.2
    weights[:, : SIZE // 2, 0] *= 2
    weights[:, SIZE // 2 :, 1] *= 3
    bases = (White(Lobe("diffuse")), White(Lobe("ggx", 0.4)))
    curves = np.zeros((2, 2, len(STOPS), 3))
    curves[0, 0] = curves[1, 1] = 1.0
    surface = Surface(Mixture((bases[0].lobe, bases[1].lobe), curves), weights, bases)
    nearest = fit_principled(bases, weights)
    settings = MaterialSettings(keep=0.5, back="closed")
    figures = asset.write(folder / "asset.blend", shape, surface, "Thing", settings, nearest, folder / "pbr")
    exports.run(folder / "asset.blend", folder / "thing.glb", folder / "usd" / "thing.usda")
    return {"folder": folder, "nearest": nearest, "figures": figures}


def gltf(path: Path) -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary part of a .glb (glTF 2.0 specification, section 4)."""
    data = path.read_bytes()
    assert data[:4] == b"glTF" and struct.unpack("<2I", data[4:12]) == (2, len(data))
    length = struct.unpack("<I", data[12:16])[0]
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def test_gltf_holds_mesh_textures_and_factors(made: dict[str, Any]) -> None:
    tree, binary = gltf(made["folder"] / "thing.glb")
    (primitive,) = tree["meshes"][0]["primitives"]
    triangles = tree["accessors"][primitive["indices"]]["count"] // 3
    assert triangles == made["figures"]["triangles"]
    assert {"POSITION", "NORMAL", "TEXCOORD_0"} <= set(primitive["attributes"])
    (material,) = tree["materials"]
    metal = material["pbrMetallicRoughness"]
    assert {"baseColorTexture", "metallicRoughnessTexture"} <= set(metal) and "normalTexture" in material
    assert "KHR_materials_specular" in material["extensions"]
    source = tree["textures"][metal["baseColorTexture"]["index"]]["source"]
    view = tree["bufferViews"][tree["images"][source]["bufferView"]]
    start = view.get("byteOffset", 0)
    path = made["folder"] / "base.png"
    path.write_bytes(binary[start : start + view["byteLength"]])
    wanted = images.srgb(pixels.filled(made["nearest"].base))
    np.testing.assert_allclose(picture(path), wanted, atol=tolerances.EIGHT_BITS)
    assert not np.allclose(picture(path)[::-1, ::-1], wanted, atol=0.05)


def test_gltf_is_read_by_another_library(made: dict[str, Any]) -> None:
    trimesh = pytest.importorskip("trimesh")
    (mesh,) = trimesh.load(made["folder"] / "thing.glb").geometry.values()
    assert len(mesh.faces) == made["figures"]["triangles"]
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    assert mesh.is_watertight and mesh.volume > 0
    assert mesh.visual.material.baseColorTexture is not None


def test_usd_holds_a_materialx_network_whose_textures_are_there(made: dict[str, Any]) -> None:
    bpy.utils.expose_bundled_modules()
    pxr = pytest.importorskip("pxr")
    assert pxr
    from pxr import Usd, UsdGeom, UsdShade

    folder = made["folder"] / "usd"
    stage = Usd.Stage.Open(str(folder / "thing.usda"))
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    assert len(meshes) == 1
    assert len(meshes[0].GetFaceVertexCountsAttr().Get()) == made["figures"]["triangles"]
    shaders = [UsdShade.Shader(prim) for prim in stage.Traverse() if prim.IsA(UsdShade.Shader)]
    names = {str(shader.GetIdAttr().Get()) for shader in shaders}
    assert "UsdPreviewSurface" in names and any(name.startswith("ND_") for name in names)
    assert any("surface" in name and name.startswith("ND_") for name in names)
    files = [shader.GetInput("file").Get() for shader in shaders if shader.GetInput("file")]
    assert files and all((folder / file.path).is_file() for file in files)
    written = (folder / "thing.usda").read_text()
    assert str(made["folder"]) not in written and ".part" not in written
    assert [path for path in made["folder"].rglob("*") if ".part" in path.name] == []


def test_a_usd_archive_holds_a_layer_of_its_name_and_the_textures(made: dict[str, Any], tmp_path: Path) -> None:
    exports.run(made["folder"] / "asset.blend", None, tmp_path / "thing.usdz")
    with zipfile.ZipFile(tmp_path / "thing.usdz") as archive:
        names = archive.namelist()
    assert names[0] == "thing.usdc" and any(name.endswith((".png", ".exr")) for name in names)
    assert [path.name for path in tmp_path.iterdir()] == ["thing.usdz"]


def test_plain_textures_hold_what_was_fitted(made: dict[str, Any]) -> None:
    folder, nearest = made["folder"] / "pbr", made["nearest"]
    names = {"base_color.png", "specular_tint.png", "metallic.png", "roughness.png", "normal.png", "README.txt"}
    assert {path.name for path in folder.iterdir()} == names
    for name, values in (
        ("base_color", images.srgb(pixels.filled(nearest.base))),
        ("roughness", pixels.filled(nearest.roughness)),
        ("metallic", pixels.filled(nearest.metallic)),
    ):
        shown = picture(folder / f"{name}.png")
        np.testing.assert_allclose(shown, np.broadcast_to(values.T, shown.T.shape).T, atol=1e-4)
    normal = picture(folder / "normal.png")
    np.testing.assert_allclose(np.linalg.norm(2 * normal - 1, axis=-1), 1, atol=0.01)
    assert "OpenGL" in (folder / "README.txt").read_text()


def picture(path: Path) -> NDArray[np.float32]:
    """The values of a picture file as they are stored, 0 to 1."""
    oiio = exr.openimageio()
    file = oiio.ImageInput.open(str(path))
    values = file.read_image("float")
    file.close()
    return np.asarray(values)[..., :3]


def test_a_blend_keeps_both_versions_and_shows_the_one_that_is_asked_for(made: dict[str, Any], tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(made["folder"] / "asset.blend"))
    item = bpy.data.objects["Thing"]
    assert item.active_material.name == "Thing" and "Thing Principled" in bpy.data.materials
    surface = Surface(Mixture((Lobe("diffuse"),), np.ones((1, 1, len(STOPS), 3))), np.ones((1, 1, 1, 1), np.float32))
    planted = constant(Parameters(np.full(3, 0.5), np.ones(3), 0.0, 0.5))
    asset.write(tmp_path / "ball.blend", None, surface, "Ball", MaterialSettings(principled=True), planted)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "ball.blend"))
    assert bpy.data.objects["Ball"].active_material.name == "Ball Principled" and "Ball" in bpy.data.materials


def test_textures_beside_the_file_are_whole(tmp_path: Path) -> None:
    weights = np.random.default_rng(1).uniform(0, 1, (6, 7, 2, 1)).astype(np.float32)
    surface = Surface(Mixture((Lobe("diffuse"),), np.ones((2, 1, len(STOPS), 3))), weights)
    asset.write(tmp_path / "ball.blend", None, surface, "Ball", MaterialSettings(textures="beside"))
    assert [path.name for path in (tmp_path / "ball_textures").iterdir()] == ["Ball Weights.exr"]
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "ball.blend"))
    image = bpy.data.images["Ball Weights"]
    assert image.filepath == "//ball_textures/Ball Weights.exr" and not image.packed_file
    np.testing.assert_array_equal(pixels.array(image)[..., :2], weights[..., 0])


def test_a_target_that_is_none_is_refused(made: dict[str, Any]) -> None:
    with pytest.raises(LightsphereError, match=r"must end in \.glb"):
        exports.check_names(Path("a.gltf"), None)
    with pytest.raises(LightsphereError, match="cannot be exported"):
        exports.run(made["folder"] / "pbr" / "README.txt", made["folder"] / "x.glb", None)
