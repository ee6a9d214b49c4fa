"""Light placement: even, nested, apart; and lights read from files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.core import light_file, rig
from pipeline.core.capture_settings import CaptureSettings
from pipeline.core.errors import LightsphereError

ORIGIN = np.zeros(3)
UP = np.array([0.0, 0.0, 1.0])


def lights(**values: object) -> rig.Lights:
    return rig.lights_for(CaptureSettings(**values), ORIGIN, UP)


def largest_gap(directions: np.ndarray, among: np.ndarray) -> float:
    """Return the largest angle from any of ``among`` to the nearest direction, over the ideal covering radius."""
    nearest = np.arccos(np.clip((among @ directions.T).max(axis=1), -1, 1)).max()
    ideal = np.sqrt(4 / len(directions))  # a cap of this radius has the share 4 pi / N of the sphere
    return float(nearest / ideal)


@pytest.mark.parametrize("count", [4, 80, 320, 1000])
def test_lights_cover_the_sphere_evenly(count: int) -> None:
    directions = rig.sphere(count)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-12)
    # The best covering of a plane by equal disks needs 1.21 times the area: a radius of 1.10.
    assert largest_gap(directions, rig.sphere(20_000)) < 1.6
    assert np.linalg.norm(directions.mean(axis=0)) < 2 / count


def test_random_lights_are_not_called_even() -> None:
    scattered = np.random.default_rng(0).normal(size=(320, 3))
    assert largest_gap(scattered / np.linalg.norm(scattered, axis=1, keepdims=True), rig.sphere(20_000)) > 1.6


def test_hemisphere_is_the_upper_half() -> None:
    directions = rig.hemisphere(200)
    assert (directions[:, 2] > 0).all()
    assert abs(directions[:, 2].mean() - 0.5) < 1e-3  # Archimedes


@pytest.mark.parametrize("layout", ["double-sphere", "double-hemisphere"])
@pytest.mark.parametrize(("inner", "outer"), [(320, 80), (100, 100), (80, 320)])
def test_no_outer_light_hides_behind_an_inner_one(layout: str, inner: int, outer: int) -> None:
    made = lights(rig=layout, inner=inner, outer=outer)
    near, far = made.position[made.on("inner")] / 2, made.position[made.on("outer")] / 3
    assert len(near) == inner and len(far) == outer
    assert np.arccos(np.clip(far @ near.T, -1, 1)).min() > 1e-4


def test_spheres_stand_about_their_centre() -> None:
    centre = np.array([1.0, -2.0, 0.5])
    made = rig.lights_for(CaptureSettings(radius_inner=1.5, radius_outer=4.0), centre, UP)
    distance = np.linalg.norm(made.position - centre, axis=1)
    assert np.allclose(distance[made.on("inner")], 1.5) and np.allclose(distance[made.on("outer")], 4.0)


def test_white_lambert_at_the_inner_radius_reflects_one() -> None:
    made = lights(radius_inner=1.7)
    assert np.allclose(made.intensity / (np.pi * 1.7**2), 1)  # L = rho / pi * I / d^2


@pytest.mark.parametrize("layout", ["double-sphere", "double-hemisphere", "distant"])
def test_power_multiplies_what_lights_send(layout: str) -> None:
    assert np.allclose(lights(rig=layout, power=2.5).intensity, 2.5 * lights(rig=layout).intensity, rtol=1e-12)


def test_distant_lights_face_the_camera() -> None:
    view = np.array([0.6, -0.8, 0.0])
    made = rig.lights_for(CaptureSettings(rig="distant", inner=50), ORIGIN, view)
    assert made.kind == "distant" and len(made) == 50
    assert np.allclose(np.linalg.norm(made.position, axis=1), 1)
    assert (made.position @ view > 0).all()


def test_edges_of_a_star_shaped_surface_close() -> None:
    points = rig.sphere(60) * (1 + 0.3 * np.sin(np.arange(60)))[:, None]
    edges = rig.edges(points, ORIGIN)
    assert len(edges) == 3 * 60 - 6  # Euler, triangles only
    assert len(rig.edges(points[:3], ORIGIN)) == len(rig.edges(points * (1, 1, 0), ORIGIN)) == 0


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"radius_inner": 3.0, "radius_outer": 2.0}, "outer sphere must be the larger"),
        ({"rig": "no-such.lp"}, "no-such.lp"),
    ],
)
def test_wrong_rigs_are_refused(values: dict[str, object], said: str) -> None:
    with pytest.raises(LightsphereError, match=said):
        lights(**values)


def read(folder: Path, text: str, name: str = "lights.txt") -> rig.Lights:
    path = folder / name
    path.write_text(text)
    return rig.lights_for(CaptureSettings(rig=str(path)), ORIGIN, UP)


def test_lights_of_unequal_power_are_read(tmp_path: Path) -> None:
    made = read(tmp_path, "# two lights\n1 2 3 10 inner\n\nb.exr 4 5 6 1 2 3 outer\n0 0 2 4\n")
    assert made.kind == "near"
    assert made.position.tolist() == [[1, 2, 3], [4, 5, 6], [0, 0, 2]]
    assert made.intensity.tolist() == [[10, 10, 10], [1, 2, 3], [4, 4, 4]]
    assert made.surface.tolist() == [0, 1, 2]


def test_lists_of_directions_are_distant_lights(tmp_path: Path) -> None:
    made = read(tmp_path, "2\n0001 0 0 1.000\n0002 0.6 0 0.8\n", "dome.lp")
    assert made.kind == "distant"
    assert np.allclose(made.position, [[0, 0, 1], [0.6, 0, 0.8]])


def test_names_of_pictures_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.lp"
    path.write_text("2\nIMG 1 (copy 2).jpg 0 0 1\n0002 0.6 0 0.8\n")
    assert [entry["file"] for entry in light_file.entries(path)] == ["IMG 1 (copy 2).jpg", "0002"]
    path = tmp_path / "a.csv"
    path.write_text("picture,x,y,z\na b.png,0,0,1\n")
    assert light_file.entries(path) == [{"position": [0, 0, 1], "intensity": None, "surface": "", "file": "a b.png"}]


def test_lights_survive_json(tmp_path: Path) -> None:
    before = lights(inner=6, outer=5)
    made = read(tmp_path, json.dumps({"lights": before.as_json()}), "rig.json")
    assert made.as_json() == before.as_json()


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.lp", "3\nx 1 2 3\ny 1 2 4\n", "promises 3 lights and lists 2"),
        ("a.lp", "x 1 2\n", "line 1 has 2 numbers"),
        ("a.txt", "1 2 3\n1 two 3\n", "line 2: 'two' is not a number"),
        ("a.txt", "1 2 nan\n", "a.txt: light 0 has a position"),
        ("a.txt", "1 2 3 -4\n", "light 0 has no positive intensity"),
        ("a.txt", "1 2 3\n4 5 6\n1 2 3\n", "lights 0 and 2 stand in the same place"),
        ("a.txt", "# none\n", "lists no lights"),
        ("a.json", "{}", "a.json is not a list of lights"),
        ("a.json", '[{"position": [1, 2]}]', "not a list of lights"),
        ("a.json", '[{"position": [1, 2, 3], "surface": "top"}]', "not a list of lights"),
    ],
)
def test_damaged_light_files_are_refused(tmp_path: Path, name: str, text: str, said: str) -> None:
    with pytest.raises(LightsphereError, match=said):
        read(tmp_path, text, name)


def test_binary_light_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.lp"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(LightsphereError, match="not readable as text"):
        light_file.read(path, ORIGIN)
