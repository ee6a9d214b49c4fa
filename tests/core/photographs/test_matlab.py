"""MATLAB files: what scipy writes is read as scipy reads it; what is none, or lies about its size, is refused."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from pipeline.core.errors import LightsphereError
from pipeline.core.photographs import matlab

ARRAYS = {
    "normal": np.random.default_rng(1).standard_normal((5, 7, 3)).astype(np.float32),
    "S": np.arange(12.0).reshape(4, 3),
    "bits": np.array([[1, 2, 3]], np.uint16),
    "one": np.array([[-7]], np.int8),
    "long": np.array([[2**60, -5]], np.int64),
    "empty": np.zeros((0, 3)),
}


@pytest.mark.parametrize("compressed", [True, False])
def test_arrays_come_back_as_scipy_reads_them(tmp_path: Path, compressed: bool) -> None:
    path = tmp_path / "a.mat"
    savemat(path, ARRAYS, do_compression=compressed)
    found, expected = matlab.read(path), loadmat(path)
    assert set(found) == set(ARRAYS)
    for name, values in found.items():
        assert np.array_equal(values, expected[name]), name
        assert np.array_equal(values, ARRAYS[name]), name


def test_what_is_no_array_of_real_numbers_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    others = {"text": "words", "cell": np.array([1, "a"], object), "struct": {"a": 1}, "complex": np.array([[1j]])}
    savemat(path, others | {"S": ARRAYS["S"]})
    assert list(matlab.read(path)) == ["S"]


def test_a_size_that_lies_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"S": np.ones((4, 3))}, do_compression=False)
    data = bytearray(path.read_bytes())
    place = data.index(struct.pack("<II", 5, 8)) + 8  # the sizes of the axes
    for rows in (5, 2**31 - 1, -1):
        data[place : place + 4] = struct.pack("<i", rows)
        path.write_bytes(data)
        with pytest.raises(LightsphereError, match=r"a\.mat cannot be read \(an array's size"):
            matlab.read(path)


def test_a_file_that_unpacks_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matlab, "MOST_BYTES", 10_000)
    packed = zlib.compress(bytes(100_000))
    head = b"MATLAB 5.0".ljust(124) + b"\x00\x01IM"
    (tmp_path / "a.mat").write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(LightsphereError, match="too large"):
        matlab.read(tmp_path / "a.mat")


@pytest.mark.parametrize("data", [b"", b"\x00" * 50, b"x" * 500, b"MATLAB 7.3".ljust(124) + b"\x00\x02IM"])
def test_other_files_are_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.mat").write_bytes(data)
    with pytest.raises(LightsphereError, match=r"a\.mat cannot be read"):
        matlab.read(tmp_path / "a.mat")
