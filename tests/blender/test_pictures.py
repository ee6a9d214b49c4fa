"""Photographs are read to the last bit, of every usual kind of file, and damaged ones are named."""

from __future__ import annotations

import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.blender import exr, pictures
from pipeline.core.errors import LightsphereError
from tests.photographed import png

FULL = {np.uint8: 255, np.uint16: 65535}
RNG = np.random.default_rng(7)


@pytest.mark.parametrize("kind", FULL)
@pytest.mark.parametrize("channels", [(), (3,), (4,)], ids=["gray", "colour", "alpha"])
def test_a_png_is_read_to_the_last_bit(tmp_path: Path, kind: type[Any], channels: tuple[int, ...]) -> None:
    values = RNG.integers(0, FULL[kind] + 1, (13, 17, *channels)).astype(kind)
    path = tmp_path / "a.png"
    png(path, values)
    read = pictures.read(path)
    assert read.bits == 8 * values.itemsize and read.pixels.shape == (13, 17, 3) and read.pixels.dtype == np.float32
    wanted = np.repeat(values[..., None], 3, axis=2) if values.ndim == 2 else values[..., :3]  # alpha changes nothing
    np.testing.assert_array_equal(np.round(read.pixels.astype(np.float64) * FULL[kind]), wanted)
    assert np.abs(read.pixels.astype(np.float64) * FULL[kind] - wanted).max() < 0.01


def write(path: Path, values: np.ndarray, seconds: float = 0.0, **exif: float) -> None:
    """Write a picture by OpenImageIO, with an exposure time and other entries of EXIF."""
    oiio = exr.openimageio()
    spec = oiio.ImageSpec(values.shape[1], values.shape[0], 3, str(values.dtype))
    spec.attribute("Orientation", 6)
    if seconds:
        spec.attribute("ExposureTime", seconds)
    for name, value in exif.items():
        spec.attribute(f"Exif:{name}", value)
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), spec) and file.write_image(values) and file.close()


@pytest.mark.parametrize(
    ("name", "kind", "bits"),
    [("a.tif", np.uint16, 16), ("a.tga", np.uint8, 8), ("a.bmp", np.uint8, 8), ("a.exr", np.float32, 32)],
)
def test_other_files_are_read_exactly_and_upright(tmp_path: Path, name: str, kind: type[Any], bits: int) -> None:
    values = RNG.integers(0, 200, (9, 14, 3)).astype(kind)
    write(tmp_path / name, values)
    read = pictures.read(tmp_path / name)
    assert read.bits == bits
    np.testing.assert_allclose(read.pixels * FULL.get(kind, 1), values, atol=0.01)


def test_a_jpeg_is_read_with_its_exposure_time_and_not_turned(tmp_path: Path) -> None:
    row, column = np.indices((40, 64))
    values = np.stack([2 * column, 3 * row, row + column], axis=-1).astype(np.uint8)
    write(tmp_path / "a.jpg", values, seconds=0.0125)
    read = pictures.read(tmp_path / "a.jpg")
    assert (read.bits, read.seconds) == (8, pytest.approx(0.0125))
    assert np.abs(read.pixels * 255 - values).mean() < 3


@pytest.mark.parametrize(
    ("size", "exif", "focal"),
    [
        ((60, 40), {"FocalLengthIn35mmFilm": 50}, 50.0),
        ((40, 60), {"FocalLengthIn35mmFilm": 50}, 50.0),
        ((80, 60), {"FocalLengthIn35mmFilm": 50}, 52.0),  # 43.27 mm of diagonal are 34.6 mm of the longer side
        ((60, 40), {"FocalLength": 25.0, "FocalPlaneXResolution": 60 / 18 * 25.4, "FocalPlaneResolutionUnit": 2}, 50.0),
        ((60, 40), {"FocalLength": 25.0, "FocalPlaneXResolution": 60 / 1.8, "FocalPlaneResolutionUnit": 3}, 50.0),
        ((60, 40), {"FocalLength": 25.0}, None),
        ((60, 60), {"FocalLengthIn35mmFilm": 50, "PixelXDimension": 90, "PixelYDimension": 60}, None),
        ((60, 40), {"FocalLengthIn35mmFilm": 50, "PixelXDimension": 6000, "PixelYDimension": 4000}, 50.0),
    ],
)
def test_a_jpeg_tells_the_lens_unless_it_was_cropped(
    tmp_path: Path, size: tuple[int, int], exif: dict[str, float], focal: float | None
) -> None:
    write(tmp_path / "a.jpg", np.zeros((size[1], size[0], 3), np.uint8), **exif)
    assert pictures.read(tmp_path / "a.jpg").focal == (focal and pytest.approx(focal, rel=2e-3))


def test_a_folder_of_exposures_becomes_the_light_whatever_the_cameras_curve(tmp_path: Path) -> None:
    """What is saturated in every exposure is not known; the rest comes back up to the scale of the shortest one."""
    light = RNG.uniform(0, 1, (30, 40, 3)) ** 3 * 4
    light[3, 5] = 400.0
    for time in (1 / 100, 1 / 12, 1 / 4, 1.0):
        stored = np.clip(light * time, 0, 1) ** 0.5
        png(tmp_path / f"desk_exp_{time:.4f}.png", np.round(255 * stored).astype(np.uint8))
    found = pictures.merged(tmp_path, "exposures").pixels * 100
    assert np.isnan(found[3, 5]).all() and np.isfinite(found).mean() > 0.99
    bright = light > 0.05
    bright[3, 5] = False
    assert np.abs(found[bright] / light[bright] - 1).mean() < 0.03
    assert np.abs(pictures.merged(tmp_path, "linear").pixels[bright] * 100 / light[bright] - 1).mean() > 0.2


@pytest.mark.parametrize("share", [0.0, 0.1, 0.6, 0.97])
@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.tif", "a.exr"])
def test_a_file_cut_off_is_named(tmp_path: Path, name: str, share: float, capfd: pytest.CaptureFixture[str]) -> None:
    values = RNG.integers(0, 255, (40, 40, 3)).astype(np.float32 if name.endswith("exr") else np.uint8)
    path = tmp_path / name
    write(path, values)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(LightsphereError, match=f"{name} is (damaged|not a readable picture)"):
        pictures.read(path)
    assert capfd.readouterr().err == ""


def test_a_changed_byte_of_a_png_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    png(path, RNG.integers(0, 65536, (40, 40, 3)).astype(np.uint16))
    data = bytearray(path.read_bytes())
    data[3000] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(LightsphereError, match=r"a\.png is damaged"):
        pictures.read(path)


@pytest.mark.parametrize("name", ["a.png", "a.nef"])
def test_a_missing_file_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(LightsphereError, match=f"{name} is missing"):
        pictures.read(tmp_path / name)


def test_raw_without_its_library_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rawpy", None)
    (tmp_path / "a.dng").write_bytes(b"raw")
    with pytest.raises(LightsphereError, match=r"a\.dng is a RAW photograph; install rawpy"):
        pictures.read(tmp_path / "a.dng")


def dng(path: Path, mosaic: np.ndarray, white: int, black: int, seconds: tuple[int, int]) -> None:
    """Write an uncompressed DNG with an RGGB mosaic (Adobe's DNG specification 1.4)."""
    height, width = mosaic.shape
    identity = b"".join(struct.pack("<ii", x, 1) for x in np.eye(3, dtype=int).ravel().tolist())
    byte, text, short, long, rational, signed = 1, 2, 3, 4, 5, 10
    tags: list[tuple[int, int, bytes]] = [
        (254, long, struct.pack("<I", 0)),
        (256, long, struct.pack("<I", width)),
        (257, long, struct.pack("<I", height)),
        (258, short, struct.pack("<H", 16)),
        (259, short, struct.pack("<H", 1)),
        (262, short, struct.pack("<H", 32803)),
        (271, text, b"None\0"),
        (272, text, b"Drawn\0"),
        (273, long, b"DATA"),
        (277, short, struct.pack("<H", 1)),
        (278, long, struct.pack("<I", height)),
        (279, long, struct.pack("<I", 2 * mosaic.size)),
        (33421, short, struct.pack("<HH", 2, 2)),
        (33422, byte, bytes([0, 1, 1, 2])),
        (33434, rational, struct.pack("<II", *seconds)),
        (50706, byte, bytes([1, 4, 0, 0])),
        (50708, text, b"Drawn\0"),
        (50714, short, struct.pack("<H", black)),
        (50717, long, struct.pack("<I", white)),
        (50721, signed, identity),
        (50728, rational, struct.pack("<IIIIII", 1, 1, 1, 1, 1, 1)),
        (50778, short, struct.pack("<H", 21)),
    ]
    sizes = {byte: 1, text: 1, short: 2, long: 4, rational: 8, signed: 8}
    place = 8 + 2 + 12 * len(tags) + 4
    entries, tail = b"", b""
    for tag, kind, value in tags:
        if value != b"DATA" and len(value) > 4:
            stored = struct.pack("<I", place + len(tail))
            tail += value + bytes(len(value) % 2)
        else:
            stored = value.ljust(4, b"\0")
        entries += struct.pack("<HHI", tag, kind, len(value) // sizes[kind]) + stored
    entries = entries.replace(b"DATA", struct.pack("<I", place + len(tail)))
    header = b"II*\0" + struct.pack("<IH", 8, len(tags))
    path.write_bytes(header + entries + bytes(4) + tail + mosaic.astype("<u2").tobytes())


def test_raw_is_developed_linearly(tmp_path: Path) -> None:
    pytest.importorskip("rawpy")
    white, black = 4095, 128
    light = np.array([0.1, 0.25, 0.5, 0.9])  # patches; the camera's colours see 1, 1/2 and 1/4 of it
    mosaic = np.zeros((64, 256))
    for i, value in enumerate(light):
        patch = mosaic[:, 64 * i : 64 * (i + 1)]
        patch[0::2, 0::2], patch[0::2, 1::2], patch[1::2, 0::2], patch[1::2, 1::2] = (
            value,
            value / 2,
            value / 2,
            value / 4,
        )
    path = tmp_path / "a.dng"
    dng(path, np.round(black + mosaic * (white - black)), white, black, (1, 80))
    read = pictures.read(path)
    assert read.bits == 16 and read.seconds == pytest.approx(1 / 80)
    found = np.array([read.pixels[20:44, 64 * i + 20 : 64 * i + 44].mean(axis=(0, 1)) for i in range(len(light))])
    np.testing.assert_allclose(found, light[:, None] * [1, 0.5, 0.25], rtol=0.01)


def test_raw_that_is_none_is_named(tmp_path: Path) -> None:
    pytest.importorskip("rawpy")
    (tmp_path / "a.cr2").write_bytes(b"no such thing" * 99)
    with pytest.raises(LightsphereError, match=r"a\.cr2 cannot be developed"):
        pictures.read(tmp_path / "a.cr2")
