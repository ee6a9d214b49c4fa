"""``.npz`` files: arrays come back; objects, sizes that lie and other files are refused."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from pipeline.core.arrays import read_npz
from pipeline.core.errors import LightsphereError


def header(shape: str) -> bytes:
    words = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(words).to_bytes(2, "little") + words


def zipped(path: Path, data: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("table.npy", data)
    return path


def test_arrays_come_back(tmp_path: Path) -> None:
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "a.npz", table=np.arange(6.0).reshape(2, 3), zeros=np.zeros((400, 400)), word=np.array("ward"))
        found = read_npz(tmp_path / "a.npz")
        assert list(found) == ["table", "zeros", "word"]
        assert np.array_equal(found["table"], np.arange(6.0).reshape(2, 3)) and str(found["word"]) == "ward"


def test_objects_are_not_unpacked(tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return (Path.touch, (tmp_path / "sprung",))  # type: ignore[return-value]

    np.savez(tmp_path / "a.npz", table=np.array([Trap()], object))
    with pytest.raises(LightsphereError, match="without objects"):
        read_npz(tmp_path / "a.npz")
    assert not (tmp_path / "sprung").exists()


@pytest.mark.parametrize("shape", ["(100000000000,)", "(3, 99999999999)", "(-4, -4)", "(2, 1)"])
def test_a_size_that_lies_is_refused(tmp_path: Path, shape: str) -> None:
    with pytest.raises(LightsphereError, match="damaged"):
        read_npz(zipped(tmp_path / "a.npz", header(shape) + bytes(8)))


def test_a_member_that_says_to_be_endless_is_refused(tmp_path: Path) -> None:
    path = zipped(tmp_path / "a.npz", header("(1,)") + bytes(8))
    data = path.read_bytes()
    place = data.index(b"PK\x01\x02") + 24  # the size of the member, in the directory
    path.write_bytes(data[:place] + (2**31).to_bytes(4, "little") + data[place + 4 :])
    with pytest.raises(LightsphereError, match="larger than it can be"):
        read_npz(path)


def test_other_files_are_refused(tmp_path: Path) -> None:
    sink = io.BytesIO()
    np.save(sink, np.zeros(3))
    for data in (b"", b"PK\x03\x04", sink.getvalue(), b"\x80\x04K\x01."):
        (tmp_path / "a.npz").write_bytes(data)
        with pytest.raises(LightsphereError, match=r"no \.npz"):
            read_npz(tmp_path / "a.npz")
