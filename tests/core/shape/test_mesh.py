"""The relief mesh: whole where the surface is, torn where it is not."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.errors import LightsphereError
from pipeline.core.shape import Shape
from pipeline.core.shape.mesh import Mesh, relief
from pipeline.core.shape.ply import read_ply, write_ply
from tests import synthetic, tolerances

VIEWS = ["pinhole", "orthographic"]
TOWARDS = np.array([0.0, 0.0, 1.0])


def tilted(degrees: float) -> NDArray[np.float64]:
    angle = np.radians(degrees)
    return np.array([np.sin(angle), 0.0, np.cos(angle)])


def edges(mesh: Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return all edges once, (E, 2), and how many triangles each has, (E,)."""
    along = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    unique, count = np.unique(np.sort(along, axis=1), axis=0, return_counts=True)
    return unique, count


def edge_counts(mesh: Mesh) -> NDArray[np.int64]:
    return edges(mesh)[1]


def face_normals(mesh: Mesh) -> NDArray[np.float64]:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return np.cross(b - a, c - a)


def steepest(mesh: Mesh) -> float:
    """Largest difference of height within a triangle [m]."""
    return float(np.ptp(mesh.vertices[mesh.faces][:, :, 2], axis=1).max())


@pytest.mark.parametrize("model", VIEWS)
def test_the_ball_is_one_manifold_sheet_that_faces_the_camera(model: str) -> None:
    shape = synthetic.ball(synthetic.camera(model=model))
    mesh = relief(shape)
    assert edge_counts(mesh).max() == 2
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)
    centre = mesh.vertices[mesh.faces].mean(axis=1)
    to_camera = np.array([0, 0, 5.0]) - centre if model == "pinhole" else TOWARDS
    assert ((face_normals(mesh) * to_camera).sum(axis=1) > 0).all()
    vertices, faces, edges = len(mesh.vertices), len(mesh.faces), len(edge_counts(mesh))
    assert vertices - edges + faces == 1  # Euler: a disk
    assert np.isfinite(shape.depth).sum() - vertices < 20


@pytest.mark.parametrize("model", VIEWS)
def test_inner_vertices_are_the_recovered_points_and_their_texture_places(model: str) -> None:
    shape = synthetic.ball(synthetic.camera(model=model))
    mesh = relief(shape)
    size = shape.camera.resolution[0]
    place = np.stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]], axis=-1) * size - 0.5
    inner = (np.abs(place - np.round(place)) < 1e-9).all(axis=1)
    column, row = np.round(place[inner]).astype(int).T
    assert inner.mean() > 0.8
    np.testing.assert_allclose(mesh.vertices[inner], shape.points()[row, column], atol=tolerances.MESH_POINT)
    assert np.abs(place - np.round(place)).max() <= 0.5


@pytest.mark.parametrize("model", VIEWS)
def test_the_contour_of_a_ball_has_no_teeth(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Seen from the side a contour is where depth is steepest: pixel centres alone zigzag by pixels there."""
    shape = synthetic.ball(synthetic.camera(96, model))
    footprint, radius = 2.0 / 96, np.nanmedian(np.linalg.norm(shape.points(), axis=-1))
    contour = border(relief(shape))
    assert teeth(contour) < 0.7 * footprint
    assert np.abs(np.linalg.norm(contour, axis=-1) - radius).max() < 0.7 * footprint
    monkeypatch.setattr("pipeline.core.shape.mesh.PASSES", 0)
    assert teeth(border(relief(shape))) > 1.2 * footprint


def border(mesh: Mesh) -> NDArray[np.float64]:
    """Return the border's vertices (N, 3) about the line of sight."""
    unique, count = edges(mesh)
    found = mesh.vertices[np.unique(unique[count == 1])]
    return found[np.argsort(np.arctan2(found[:, 0], found[:, 1]))]


def teeth(loop: NDArray[np.float64]) -> float:
    """Mean distance in depth of a loop's points (N, 3) from the middle of both neighbours [m]."""
    depth = loop[:, 2]
    return float(np.abs(depth - (np.roll(depth, 1) + np.roll(depth, -1)) / 2).mean())


def test_border_vertices_stay_on_the_surface() -> None:
    mesh = relief(synthetic.plane(synthetic.camera(), tilted(40)))
    assert np.abs(mesh.vertices @ tilted(40)).max() < tolerances.MESH_POINT


def test_pixel_centres_lie_inside_the_mesh() -> None:
    """A renderer that asks at pixel centres sees every pixel: the border stands half a pixel further out."""
    shape = synthetic.plane(synthetic.camera(16), TOWARDS)
    uv = relief(shape).uv
    assert uv.min() == pytest.approx(0, abs=0.5 / 16 / 2)
    assert uv.max() == pytest.approx(1, abs=0.5 / 16 / 2)


@pytest.mark.parametrize("model", VIEWS)
@pytest.mark.parametrize("degrees", [0, 45, 70, 78])
def test_a_slanted_plane_is_not_torn(model: str, degrees: float) -> None:
    view = synthetic.camera(24, model, distance=12.0)
    mesh = relief(synthetic.plane(view, tilted(degrees)))
    assert len(mesh.faces) == 2 * 23 * 23


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("height", [0.15, 0.5, -0.5])
def test_a_step_is_not_bridged_at_any_scale(scale: float, height: float) -> None:
    shape = scaled(synthetic.step(synthetic.camera(24), height), scale)
    mesh = relief(shape)
    assert len(mesh.faces) == 2 * 23 * 22
    assert steepest(mesh) < 1e-4 * scale
    assert edge_counts(mesh).max() == 2


def test_a_step_of_less_than_a_pixel_is_a_slope() -> None:
    """The negative control of the tearing: it does not cut everything that is not flat."""
    footprint = 2.0 / 24
    mesh = relief(synthetic.step(synthetic.camera(24), 0.5 * footprint))
    assert len(mesh.faces) == 2 * 23 * 23
    assert steepest(mesh) == pytest.approx(0.5 * footprint, rel=1e-3)


def test_a_crease_is_not_torn() -> None:
    mesh = relief(synthetic.crease(synthetic.camera(25)))
    assert len(mesh.faces) == 2 * 24 * 24


def test_unknown_doubtful_and_lonely_pixels_are_left_out() -> None:
    shape = synthetic.plane(synthetic.camera(24), TOWARDS)
    confidence = np.ones((24, 24), np.float32)
    confidence[:, :8] = 0.2
    confidence[12, 15] = 0
    depth = shape.depth.copy()
    depth[5, 15] = np.nan
    depth[18:20, 18:20] -= 1  # four pixels far in front: two triangles
    shape = dataclasses.replace(shape, depth=depth, confidence=confidence)
    everything, sure = relief(shape), relief(shape, least_confidence=0.5)
    assert len(everything.vertices) == 24 * 24 - 2 - 4
    assert len(sure.vertices) == 24 * 16 - 2 - 4
    with pytest.raises(LightsphereError, match="no connected surface"):
        relief(shape, least_confidence=1.0)


def test_the_diagonal_runs_along_the_crease() -> None:
    """A ridge across the quads' diagonals: split along it, no triangle has corners on both sides."""
    view = synthetic.camera(17, "orthographic")
    tilt = np.radians(50)
    side = np.sqrt(0.5)
    planes = [
        synthetic.plane(view, np.array([s * side * np.sin(tilt), s * side * np.sin(tilt), np.cos(tilt)]))
        for s in (-1, 1)
    ]
    nearer = planes[0].depth > planes[1].depth
    normal = np.where(nearer[..., None], planes[0].normal, planes[1].normal)
    depth = np.where(nearer, planes[0].depth, planes[1].depth)
    mesh = relief(synthetic.shape_of(view, depth, view.normals_to_world(normal)))
    across = (mesh.uv @ [1, 1] - 1)[mesh.faces] * 17
    inner = (np.abs(mesh.uv - 0.5) < 0.4).all(axis=1)[mesh.faces].all(axis=1)
    assert inner.sum() > 100
    assert not ((across > 0.1).any(axis=1) & (across < -0.1).any(axis=1))[inner].any()


def test_ply_files_come_back(tmp_path: Path) -> None:
    mesh = relief(synthetic.ball(synthetic.camera(24)))
    write_ply(tmp_path / "mesh.ply", mesh)
    found = read_ply(tmp_path / "mesh.ply")
    np.testing.assert_array_equal(found.faces, mesh.faces)
    for name in ("vertices", "normals", "uv"):
        np.testing.assert_allclose(getattr(found, name), getattr(mesh, name), atol=tolerances.SINGLE)


def test_cut_off_and_foreign_ply_files_are_named(tmp_path: Path) -> None:
    path = tmp_path / "mesh.ply"
    with pytest.raises(LightsphereError, match="missing"):
        read_ply(path)
    write_ply(path, relief(synthetic.ball(synthetic.camera(24))))
    whole = path.read_bytes()
    for damaged in (whole[:-5], whole[:40], b"", b"ply\nformat ascii 1.0\nend_header\n"):
        path.write_bytes(damaged)
        with pytest.raises(LightsphereError, match=r"mesh\.ply"):
            read_ply(path)
    with pytest.raises(LightsphereError, match="cannot be written"):
        write_ply(tmp_path / "nowhere" / "mesh.ply", relief(synthetic.ball(synthetic.camera(24))))


def scaled(shape: Shape, factor: float) -> Shape:
    to_world = shape.camera.to_world.copy()
    to_world[:3, 3] *= factor
    camera = dataclasses.replace(shape.camera, to_world=to_world)
    return dataclasses.replace(shape, camera=camera, depth=shape.depth * np.float32(factor))
