"""A capture folder returns what was put in, and says by name what is damaged in it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.core import images
from pipeline.core.camera import Camera
from pipeline.core.capture import FILE, Capture, with_lights
from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights

WIDTH, HEIGHT = 6, 4


@pytest.fixture
def capture(tmp_path: Path) -> Capture:
    """Make a capture of three lights on disk, with mask and truth."""
    rng = np.random.default_rng(5)
    lights = Lights("near", rng.normal(size=(3, 3)), rng.uniform(1, 2, (3, 3)), np.array([0, 0, 1]))
    camera = Camera("pinhole", np.eye(4), (WIDTH, HEIGHT), (8.0, 8.0), (3.0, 2.0))
    files = tuple(f"light_{i}.exr" for i in range(3))
    for i, name in enumerate(files):
        images.write_rgb(tmp_path / name, np.full((HEIGHT, WIDTH, 3), i, np.float32))
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    mask[1:3, 2:5] = 1
    images.write_channels(tmp_path / "mask.exr", {"mask.V": mask})
    names = ("depth.V", "material.V", *(f"{n}.{a}" for n in ("normal", "position") for a in "XYZ"))
    images.write_channels(
        tmp_path / "truth.exr", {name: np.full((HEIGHT, WIDTH), i, np.float32) for i, name in enumerate(names)}
    )
    checksums = tuple(images.checksum(tmp_path / name) for name in files)
    made = Capture(tmp_path, camera, lights, files, checksums, {"diameter": 2.4, "scene": "test"})
    made.save()
    return made


def rewrite(capture: Capture, change: dict[str, Any]) -> None:
    """Change entries of capture.json on disk."""
    path = capture.folder / FILE
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))


def test_a_saved_capture_opens_the_same(capture: Capture) -> None:
    same = Capture.open(capture.folder)
    assert (same.files, same.checksums, same.notes) == (capture.files, capture.checksums, capture.notes)
    assert same.camera.as_json() == capture.camera.as_json()
    assert (same.lights.kind, len(same.lights)) == ("near", 3)
    for name in ("position", "intensity", "surface"):
        np.testing.assert_array_equal(getattr(same.lights, name), getattr(capture.lights, name))
    np.testing.assert_array_equal(same.lights.on("inner"), [0, 1])
    np.testing.assert_array_equal(same.lights.on("outer"), [2])


def test_pictures_mask_and_truth_are_read(capture: Capture) -> None:
    assert [capture.image(i).mean() for i in range(3)] == [0, 1, 2]
    assert capture.mask().sum() == 6
    truth = capture.truth()
    assert truth is not None and truth.diameter == 2.4
    assert (truth.depth[0, 0], truth.material[0, 0]) == (0, 1)
    np.testing.assert_array_equal(truth.normal[0, 0], [2, 3, 4])
    np.testing.assert_array_equal(truth.position[0, 0], [5, 6, 7])


def test_a_photographed_capture_has_no_truth(capture: Capture) -> None:
    (capture.folder / "truth.exr").unlink()
    assert capture.truth() is None


def test_truth_may_hold_normals_alone(capture: Capture) -> None:
    path = capture.folder / "truth.exr"
    layers = images.read_channels(path)
    images.write_channels(path, {name: layer for name, layer in layers.items() if name.startswith("normal")})
    truth = capture.truth()
    assert truth is not None
    np.testing.assert_array_equal(truth.normal[0, 0], [2, 3, 4])
    assert np.isnan(truth.depth).all() and np.isnan(truth.position).all() and not truth.material.any()


def test_a_selection_keeps_light_and_picture_together(capture: Capture) -> None:
    part = capture.select(np.array([2, 0]))
    assert len(part) == 2
    assert [part.image(i).mean() for i in range(2)] == [2, 0]
    np.testing.assert_array_equal(part.lights.position, capture.lights.position[[2, 0]])
    assert part.checksums == (capture.checksums[2], capture.checksums[0])


def test_a_folder_without_description_says_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(LightsphereError, match=r"is not a capture .*make one with lightsphere capture"):
        Capture.open(tmp_path)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '"text"', "{}", '{"lights": 3}', '{"lights": [3]}'])
def test_a_description_that_is_not_one_is_named(capture: Capture, text: str) -> None:
    (capture.folder / FILE).write_text(text)
    with pytest.raises(LightsphereError, match=r"capture\.json is damaged"):
        Capture.open(capture.folder)


def test_binary_in_the_description_is_named(capture: Capture) -> None:
    (capture.folder / FILE).write_bytes(b"\xff\xfe\x00{")
    with pytest.raises(LightsphereError, match=r"capture\.json is damaged"):
        Capture.open(capture.folder)


@pytest.mark.parametrize("change", [{"format": "other"}, {"version": 99}], ids=str)
def test_another_format_is_refused(capture: Capture, change: dict[str, Any]) -> None:
    rewrite(capture, change)
    with pytest.raises(LightsphereError, match=r"is of format .*capture again"):
        Capture.open(capture.folder)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"position": [0, 0, float("nan")]}, "light 1 has a position that is not a number"),
        ({"intensity": [1, float("inf"), 1]}, "light 1 has a intensity that is not a number"),
        ({"intensity": [0, 0, 0]}, "light 1 has no positive intensity"),
        ({"intensity": [1, -1, 1]}, "light 1 has no positive intensity"),
        ({"surface": "middle"}, "the lights are not readable"),
        ({"position": [0, 0]}, "the lights are not readable"),
    ],
    ids=str,
)
def test_a_light_that_cannot_be_is_named(capture: Capture, change: dict[str, Any], words: str) -> None:
    entries = json.loads((capture.folder / FILE).read_text())["lights"]
    entries[1].update(change)
    rewrite(capture, {"lights": entries})
    with pytest.raises(LightsphereError, match=words):
        Capture.open(capture.folder)


def test_positions_in_the_plane_are_refused(capture: Capture) -> None:
    entries = [{**e, "position": [1, 2]} for e in json.loads((capture.folder / FILE).read_text())["lights"]]
    rewrite(capture, {"lights": entries})
    with pytest.raises(LightsphereError, match="the lights are not readable"):
        Capture.open(capture.folder)


def test_an_unknown_kind_of_light_is_refused(capture: Capture) -> None:
    rewrite(capture, {"light_kind": "laser"})
    with pytest.raises(LightsphereError, match="laser"):
        Capture.open(capture.folder)


def test_lights_that_are_unknown_need_no_intensity(capture: Capture) -> None:
    entries = [{**e, "intensity": [0, 0, 0]} for e in json.loads((capture.folder / FILE).read_text())["lights"]]
    rewrite(capture, {"light_kind": "unknown", "lights": entries})
    assert Capture.open(capture.folder).lights.kind == "unknown"


def test_a_picture_of_another_size_is_named(capture: Capture) -> None:
    images.write_rgb(capture.folder / "light_1.exr", np.zeros((HEIGHT, WIDTH + 1, 3), np.float32))
    capture.image(0)
    with pytest.raises(LightsphereError, match=r"light_1\.exr is 7x4 pixels, the camera 6x4"):
        capture.image(1)


@pytest.mark.parametrize("channel", ["mask.V", "other.V"])
def test_a_mask_that_does_not_fit_is_named(capture: Capture, channel: str) -> None:
    size = (HEIGHT, WIDTH) if channel != "mask.V" else (WIDTH, HEIGHT)
    images.write_channels(capture.folder / "mask.exr", {channel: np.ones(size, np.float32)})
    with pytest.raises(LightsphereError, match=r"mask\.exr does not fit"):
        capture.mask()


def test_truth_that_lacks_a_layer_or_does_not_fit_is_named(capture: Capture) -> None:
    path = capture.folder / "truth.exr"
    layers = images.read_channels(path)
    images.write_channels(path, {k: v for k, v in layers.items() if k != "normal.Y"})
    with pytest.raises(LightsphereError, match=r"truth\.exr .*lacks 'normal\.Y'"):
        capture.truth()
    images.write_channels(path, {k: v.T for k, v in layers.items()})
    with pytest.raises(LightsphereError, match=r"truth\.exr does not fit"):
        capture.truth()


def test_a_capture_under_other_lights_shows_the_same_pictures(capture: Capture, tmp_path: Path) -> None:
    dimmed = dataclasses.replace(capture.lights, intensity=capture.lights.intensity / 2)
    made = Capture.open(with_lights(capture, dimmed, tmp_path / "elsewhere").folder)
    assert made.changed() == capture.changed()
    np.testing.assert_array_equal(made.image(0), capture.image(0))
    np.testing.assert_array_equal(made.mask(), capture.mask())
    np.testing.assert_allclose(made.lights.intensity, dimmed.intensity)


@pytest.mark.parametrize("recorded", [["mask.exr"], "mask.exr", 3])
def test_checksums_that_are_none_are_refused(capture: Capture, recorded: object) -> None:
    with pytest.raises(LightsphereError, match=r"capture\.json is damaged"):
        dataclasses.replace(capture, notes={"sha256": recorded}).damaged()


def test_a_capture_is_not_written_over_itself(capture: Capture) -> None:
    before = (capture.folder / "capture.json").read_bytes()
    with pytest.raises(LightsphereError, match="choose another folder"):
        with_lights(capture, capture.lights, capture.folder)
    assert (capture.folder / "capture.json").read_bytes() == before
