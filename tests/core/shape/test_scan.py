"""What a camera sees of two triangles: depth, normal and texture coordinates in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.errors import LightsphereError
from pipeline.core.shape.scan import Scan, barycentric, blend, seen
from tests import drawn, synthetic

SIZE = 16


def tilted(z: float = 0.0) -> Scan:
    """A square of 2 m on the plane z + 0.5 x, its UVs its unit square."""
    uv = np.array([[[0.0, 0], [1, 0], [1, 1]], [[0.0, 0], [1, 1], [0, 1]]])
    corners = np.concatenate([2 * uv - 1, np.zeros((2, 3, 1))], axis=-1)
    corners[..., 2] = z + 0.5 * corners[..., 0]
    normal = np.array([-0.5, 0.0, 1.0]) / np.hypot(0.5, 1.0)
    return Scan(corners, np.broadcast_to(normal, (2, 3, 3)).copy(), uv, np.array([4, 7]))


def capture_of(model: str) -> drawn.Drawn:
    shape = synthetic.plane(synthetic.camera(SIZE, model), np.array([-0.5, 0, 1.0]) / np.hypot(0.5, 1.0))
    return drawn.draw(shape, drawn.two_spheres(8, 4), drawn.lambert)


@pytest.mark.parametrize("model", ["orthographic", "pinhole"])
@pytest.mark.parametrize("turned", [False, True])
def test_a_plane_is_seen_where_it_is(model: str, turned: bool) -> None:
    capture = capture_of(model)
    true = synthetic.plane(capture.camera, np.array([-0.5, 0, 1.0]) / np.hypot(0.5, 1.0))
    scan = tilted()
    if turned:  # the winding of a scan's triangles does not matter, nor that of its normals
        scan = Scan(scan.corners[:, ::-1], -scan.normals[:, ::-1], scan.uv[:, ::-1], scan.part)
    points = true.points()
    face = np.where(points[..., 1] > points[..., 0], 1, 0)
    face[0, :3] = -1
    found = seen(capture, scan, face)
    known = face >= 0
    assert np.isnan(found.depth[~known]).all() and (found.confidence[~known] == 0).all()
    np.testing.assert_allclose(found.depth[known], true.depth[known], rtol=1e-6)
    np.testing.assert_allclose(found.normal[known], true.normal[known], atol=1e-6)
    np.testing.assert_allclose(found.layers["uv.U"][known], (points[known][:, 0] + 1) / 2, atol=1e-5)
    np.testing.assert_allclose(found.layers["uv.V"][known], (points[known][:, 1] + 1) / 2, atol=1e-5)
    np.testing.assert_array_equal(found.layers["part"][known], np.array([4, 7])[face[known]])
    assert found.notes["silhouette_overlap_pct"] == pytest.approx(100 * known.mean())


def test_grazing_views_are_believed_less() -> None:
    capture = capture_of("orthographic")
    steep = tilted()
    steep.corners[..., 2] *= 20
    face = np.zeros((SIZE, SIZE), np.int64)
    assert seen(capture, steep, face).confidence.max() == pytest.approx(1 / np.hypot(1, 10) / 0.3, rel=1e-4)
    assert seen(capture, tilted(), face).confidence.min() == 1


def test_a_mesh_elsewhere_is_named_with_its_size() -> None:
    with pytest.raises(LightsphereError, match=r"2 x 2 x 1 m large about 0 x 0 x 9 m; check its unit \(--mesh-unit\)"):
        seen(capture_of("pinhole"), tilted(9.0), np.full((SIZE, SIZE), -1))


def test_barycentric_coordinates_give_points_back() -> None:
    random = np.random.default_rng(0)
    corners, weights = random.standard_normal((50, 3, 3)), random.dirichlet(np.ones(3), 50)
    np.testing.assert_allclose(barycentric(corners, blend(corners, weights)), weights, atol=1e-9)


def test_a_part_is_its_triangles() -> None:
    assert tilted().select(7).uv.tolist() == tilted().uv[1:].tolist()
