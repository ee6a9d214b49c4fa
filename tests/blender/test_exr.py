"""OpenEXR in Blender's own process: read by the solvers' library, free of times, refused when cut short."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from pipeline.blender import cycles, exr
from pipeline.blender.camera import camera_of
from pipeline.core import images
from pipeline.core.errors import LightsphereError
from tests.blender import small_scenes


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("exr") / "picture.exr"
    scene = small_scenes.lambert(0.5)
    bpy.ops.object.light_add(type="POINT", location=(2, -3, 3))
    with cycles.measuring(scene, camera_of(scene, 40), cycles.DIRECT), cycles.openexr(scene):
        cycles.render(scene, path)
    return path


def test_channels_survive_and_both_libraries_agree(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    before = {name: rng.normal(size=(5, 7)).astype(np.float32) for name in ("depth.V", "normal.X", "a")}
    before["a"][2, 3] = np.nan
    exr.write(tmp_path / "a.exr", before)
    for read in (exr.read, images.read_channels):
        after = read(tmp_path / "a.exr")
        assert after.keys() == before.keys()
        assert all(np.array_equal(after[name], before[name], equal_nan=True) for name in before)
    images.write_channels(tmp_path / "b.exr", before)
    after = exr.read(tmp_path / "b.exr")
    assert all(np.array_equal(after[name], before[name], equal_nan=True) for name in before)


def test_equal_channels_make_equal_bytes(tmp_path: Path) -> None:
    for name in ("a.exr", "b.exr"):
        exr.write(tmp_path / name, {"V": np.ones((3, 4))})
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    assert not list(tmp_path.glob(".*"))


def test_header_holds_no_time(picture: Path) -> None:
    import OpenEXR

    header = OpenEXR.File(str(picture)).header()
    times = {name: value for name, value in header.items() if name.endswith("_time")}
    assert times and all(set(value) <= set("0:.") for value in times.values())


@pytest.mark.parametrize("kept", [0, 3, 100, 700, 0.5, 0.99])
def test_cut_pictures_are_noticed(picture: Path, tmp_path: Path, kept: float) -> None:
    whole = picture.read_bytes()
    copy = tmp_path / "copy.exr"
    copy.write_bytes(whole)
    exr.finish(copy)
    assert copy.read_bytes() == whole
    copy.write_bytes(whole[: int(kept * len(whole)) if isinstance(kept, float) else kept])
    with pytest.raises((OSError, ValueError, LookupError, exr.struct.error)):
        exr.finish(copy)


def test_unreadable_files_are_named(tmp_path: Path) -> None:
    (tmp_path / "bad.exr").write_bytes(b"nothing")
    with pytest.raises(LightsphereError, match=r"bad\.exr cannot be read"):
        exr.read(tmp_path / "bad.exr")
    with pytest.raises(LightsphereError, match=r"a\.exr cannot be written"):
        exr.write(tmp_path / "nowhere" / "a.exr", {"V": np.ones((2, 2))})
