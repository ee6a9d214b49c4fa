"""Pictures on disk: whole or not there, read back bit for bit, and damage told by the file's name."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from pipeline.core import images
from pipeline.core.errors import LightsphereError


def picture(kind: type = np.float32, size: tuple[int, int] = (9, 13)) -> np.ndarray:
    return np.random.default_rng(1).uniform(0, 4, (*size, 3)).astype(kind)


def write_parts(path: Path, planes: dict[str, np.ndarray]) -> None:
    parts = [OpenEXR.Part({"type": OpenEXR.scanlineimage}, {f"{n}.V": plane}, n) for n, plane in planes.items()]
    with OpenEXR.File(parts) as file:
        file.write(str(path))


@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_a_picture_returns_bit_for_bit(tmp_path: Path, kind: type) -> None:
    image = picture(kind)
    images.write_rgb(tmp_path / "a.exr", image)
    returned = images.read_rgb(tmp_path / "a.exr")
    assert returned.dtype == np.float32
    np.testing.assert_array_equal(returned, image.astype(np.float32))
    assert not np.array_equal(returned, image[::-1].astype(np.float32))  # a flipped picture would be noticed


def test_channels_keep_their_names_and_infinities(tmp_path: Path) -> None:
    planes = {"depth.V": np.array([[1, np.nan], [np.inf, -2]], np.float32), "mask.V": np.ones((2, 2), np.float16)}
    images.write_channels(tmp_path / "a.exr", planes)
    returned = images.read_channels(tmp_path / "a.exr")
    assert returned.keys() == planes.keys()
    for name, plane in planes.items():
        np.testing.assert_array_equal(returned[name], plane)


def test_a_file_of_several_parts_is_read_whole(tmp_path: Path) -> None:
    write_parts(tmp_path / "a.exr", {name: np.full((2, 3), v, np.float32) for name, v in (("depth", 1), ("mask", 2))})
    returned = images.read_channels(tmp_path / "a.exr")
    assert {name: plane.flat[0] for name, plane in returned.items()} == {"depth.V": 1, "mask.V": 2}


def test_a_file_that_lacks_its_last_part_is_named(tmp_path: Path) -> None:
    path, noise = tmp_path / "cut.exr", picture(size=(90, 90))[..., 0]
    write_parts(path, {"depth": noise, "mask": noise})
    path.write_bytes(path.read_bytes()[: int(0.9 * path.stat().st_size)])
    with pytest.raises(LightsphereError, match=r"cut\.exr is damaged .*ends too early"):
        images.read_channels(path)


def test_one_channel_is_gray_and_other_channels_are_refused(tmp_path: Path) -> None:
    plane = picture()[..., 0]
    images.write_channels(tmp_path / "gray.exr", {"Y": plane})
    np.testing.assert_array_equal(images.read_rgb(tmp_path / "gray.exr"), np.repeat(plane[..., None], 3, axis=-1))
    images.write_channels(tmp_path / "two.exr", {"R": plane, "G": plane})
    with pytest.raises(LightsphereError, match=r"two\.exr.*needs R, G and B"):
        images.read_rgb(tmp_path / "two.exr")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(LightsphereError, match=r"nothing\.exr is missing; "):
        images.read_rgb(tmp_path / "nothing.exr")


@pytest.mark.parametrize("left", [0, 7, 200, 0.5, 0.95])
def test_a_cut_off_file_is_named(tmp_path: Path, left: float, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "cut.exr"
    images.write_rgb(path, picture(size=(60, 80)))
    whole = path.read_bytes()
    path.write_bytes(whole[: left if isinstance(left, int) else int(left * len(whole))])
    with pytest.raises(LightsphereError, match=r"cut\.exr is damaged"):
        images.read_rgb(path)
    assert capfd.readouterr() == ("", "")  # the library's own words are held back


def test_a_file_that_is_no_picture_is_named(tmp_path: Path) -> None:
    path = tmp_path / "text.exr"
    path.write_text("not a picture")
    with pytest.raises(LightsphereError, match=r"text\.exr is damaged"):
        images.read_rgb(path)


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.exr"
    images.write_rgb(path, picture())
    before = path.read_bytes()

    def full(self: Path, target: Path) -> Path:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(LightsphereError, match=r"a\.exr cannot be written .*free space"):
        images.write_rgb(path, picture() + 1)
    with pytest.raises(LightsphereError, match=r"b\.json cannot be written .*free space"):
        images.write_text(tmp_path / "b.json", "{}")
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["a.exr"]


def test_a_missing_folder_is_an_error_of_the_input(tmp_path: Path) -> None:
    with pytest.raises(LightsphereError, match="cannot be written"):
        images.write_rgb(tmp_path / "nowhere" / "a.exr", picture())


def test_another_library_can_take_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plane = np.ones((2, 2), np.float32)
    store: dict[Path, object] = {}
    for name in ("_read", "_write"):
        monkeypatch.setattr(images, name, getattr(images, name))  # put back afterwards
    images.use_library(lambda path: {"Y": plane}, lambda path, channels: store.update({path: channels}))
    images.write_rgb(tmp_path / "a.exr", picture())
    assert list(store) == [tmp_path / "a.exr"] and not (tmp_path / "a.exr").exists()
    (tmp_path / "a.exr").touch()
    assert images.read_rgb(tmp_path / "a.exr").shape == (2, 2, 3)


def test_the_checksum_is_sha256_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "abc").write_bytes(b"abc")
    # FIPS 180-2, example B.1
    assert images.checksum(tmp_path / "abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_a_picture_that_is_said_to_be_larger_than_its_bytes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    images.write_rgb(path, np.zeros((600, 700, 3), np.float32))  # packs tightly, and is read
    assert images.read_rgb(path).shape == (600, 700, 3)
    images.write_rgb(path, picture())
    data = bytearray(path.read_bytes())
    for name in (b"dataWindow", b"displayWindow"):
        place = data.index(name + b"\0box2i\0") + len(name) + 7 + 4 + 8  # the window's upper corner
        data[place : place + 8] = struct.pack("<2i", 200_000, 100_000)
    path.write_bytes(data)
    with pytest.raises(LightsphereError, match=r"a\.exr is (said to hold|damaged)"):
        images.read_rgb(path)
