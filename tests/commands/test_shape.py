"""`lightsphere shape` on damaged captures, as a user runs it: one line that names what is wrong, never a traceback."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline import cli
from pipeline.core import images
from pipeline.core.reflectance import Reflectance
from pipeline.core.shape import Shape
from tests import synthetic

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of a Lambertian ball with its checksums recorded."""
    folder = tmp_path_factory.mktemp("sound")
    synthetic.write_capture(folder, synthetic.ball(synthetic.camera(12)), np.full(3, 0.5), np.zeros(3), 0.4)
    change_lights(folder, lambda i, light: light.update(sha256=images.checksum(folder / light["file"])))
    return folder


@pytest.fixture
def folder(sound: Path, tmp_path: Path) -> Path:
    """A copy of the capture, to be damaged."""
    return Path(shutil.copytree(sound, tmp_path / "capture"))


def change_lights(folder: Path, change: Callable[[int, dict[str, Any]], None]) -> None:
    described = json.loads((folder / "capture.json").read_text())
    for i, light in enumerate(described["lights"]):
        change(i, light)
    (folder / "capture.json").write_text(json.dumps(described))


def refused(capsys: pytest.CaptureFixture[str], folder: Path, *said: str, options: tuple[str, ...] = ()) -> None:
    """Assert that the command ends with status 2 and one line that says these words, and writes no shape."""
    assert cli.main(["shape", str(folder), "-o", str(folder / "shape"), *options]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1 and err.startswith("lightsphere: ")
    for word in said:
        assert word in err
    assert not (folder / "shape" / "shape.json").exists()


@pytest.mark.parametrize("method", ["double-sphere", "lambertian"])
def test_interreflections_without_a_reflectance_are_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], method: str
) -> None:
    options = ("--method", method, "--interreflections", "2")
    refused(capsys, folder, "--interreflections", "acls or uncalibrated", options=options)


def test_interreflections_are_not_promised(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--method", "acls", "--interreflections", "2", "--budget", "60")
    refused(capsys, folder, "--interreflections", "--budget", options=options)


def test_a_sound_capture_is_solved_in_silence(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["shape", str(folder), "-o", str(folder / "shape")]) == 0
    out, err = capsys.readouterr()
    assert err == "" and out.count("\n") == 1 and "_values" not in out
    assert np.isfinite(Shape.open(folder / "shape").depth).sum() > 50
    assert (folder / "shape" / "mesh.ply").is_file()


@pytest.mark.parametrize(("belongs", "stays"), [("..", False), ("../../another", True)])
def test_a_reflectance_of_the_shape_that_was_there_is_forgotten(folder: Path, belongs: str, stays: bool) -> None:
    """Else material would take it for the new shape's."""
    picture = np.full((12, 12), 0.5, np.float32)
    colours = np.stack(3 * [picture], axis=-1)
    old = folder / "shape" / "reflectance"
    notes = {"shape": belongs, "model": "lobe"}
    Reflectance(colours, colours, picture, picture, picture, notes).save(old)
    assert cli.main(["shape", str(folder), "-o", str(folder / "shape")]) == 0
    assert (old / "reflectance.json").is_file() == stays


def test_a_folder_without_a_capture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refused(capsys, tmp_path, str(tmp_path), "capture.json", "lightsphere capture")
    refused(capsys, tmp_path / "nowhere", "nowhere", "lightsphere capture")


def test_a_missing_picture(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "light_0033.exr").unlink()
    refused(capsys, folder, "light_0033.exr is missing", "again")


@pytest.mark.parametrize("kept", [0, 100, 0.6])
def test_a_truncated_picture(folder: Path, kept: float, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / "light_0007.exr"
    data = path.read_bytes()
    path.write_bytes(data[: int(kept * len(data)) if isinstance(kept, float) else kept])
    change_lights(folder, lambda i, light: light.pop("sha256"))
    refused(capsys, folder, "light_0007.exr is damaged", "delete it")


def test_a_picture_without_numbers(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    images.write_rgb(folder / "light_0012.exr", np.full((12, 12, 3), np.nan, np.float32))
    change_lights(folder, lambda i, light: light.pop("sha256"))
    refused(capsys, folder, "light_0012.exr", "not numbers", "render it again")


def test_a_picture_of_another_size(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    images.write_rgb(folder / "light_0002.exr", np.ones((6, 8, 3), np.float32))
    change_lights(folder, lambda i, light: light.pop("sha256"))
    refused(capsys, folder, "light_0002.exr is 8x6 pixels", "12x12", "replace")


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda light: light.pop("position"), "position"),
        (lambda light: light.update(position=[0, 1]), "again"),
        (lambda light: light.update(position=[0, 1, float("nan")]), "light 5 has a position that is not a number"),
        (lambda light: light.update(intensity=[0, 0, 0]), "light 5 has no positive intensity"),
        (lambda light: light.update(surface="middle"), "again"),
        (lambda light: light.pop("file"), "file"),
    ],
)
def test_a_damaged_light(
    folder: Path, damage: Callable[[dict[str, Any]], None], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    change_lights(folder, lambda i, light: damage(light) if i == 5 else None)
    refused(capsys, folder, said)


def test_a_description_cut_off(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / "capture.json"
    path.write_text(path.read_text()[:500])
    refused(capsys, folder, "capture.json is damaged", "capture again")


def test_coincident_lights(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change_lights(folder, lambda i, light: light.update(position=[0, 0, 2.0]) if i in (8, 21) else None)
    refused(capsys, folder, "lights 8 and 21 coincide", "remove")


def test_coplanar_lights(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change_lights(folder, lambda i, light: light["position"].__setitem__(2, 1.0))
    refused(capsys, folder, "one plane", "move")


def test_one_surface(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change_lights(folder, lambda i, light: light.update(surface="inner"))
    refused(capsys, folder, "0 lights on the outer surface", "at least 4")


def test_distant_lights(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / "capture.json"
    path.write_text(path.read_text().replace('"near"', '"distant"'))
    refused(capsys, folder, "distant lights", "near point lights")


def test_an_empty_mask(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    images.write_channels(folder / "mask.exr", {"mask.V": np.zeros((12, 12), np.float32)})
    refused(capsys, folder, "no pixel shows the object", "aim the camera")


def test_a_missing_mask(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "mask.exr").unlink()
    refused(capsys, folder, "mask.exr is missing")


def test_a_dark_pixel_is_marked_and_the_rest_is_solved(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in folder.glob("light_*.exr"):
        picture = images.read_rgb(path)
        picture[6, 6] = 0.0
        images.write_rgb(path, picture)
    change_lights(folder, lambda i, light: light.pop("sha256"))
    assert cli.main(["shape", str(folder), "-o", str(folder / "shape")]) == 0
    assert capsys.readouterr().err == ""
    found = Shape.open(folder / "shape")
    assert np.isnan(found.depth[6, 6]) and found.confidence[6, 6] == 0
    assert np.isfinite(found.depth[6, 5])


def test_values_that_were_left_out_are_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / "light_0003.exr"
    picture = images.read_rgb(path)
    mask = images.read_channels(folder / "mask.exr")["mask.V"] > 0.5
    limit = float(np.sort(picture[mask].max(axis=1))[-3])
    picture[tuple(np.argwhere(mask & (picture.max(axis=2) < limit))[0])] = np.nan
    images.write_rgb(path, picture)
    described = json.loads((folder / "capture.json").read_text())
    described["notes"]["saturation"] = limit
    (folder / "capture.json").write_text(json.dumps(described))
    change_lights(folder, lambda i, light: light.pop("sha256"))
    saturated = sum(int((images.read_rgb(p)[mask] >= limit).any(axis=1).sum()) for p in folder.glob("light_*.exr"))
    assert saturated >= 3
    assert cli.main(["shape", str(folder), "-o", str(folder / "shape"), "--json", str(folder / "shape.json")]) == 0
    assert f", saturated_values {saturated}, broken_values 1" in capsys.readouterr().out
    for told in (Shape.open(folder / "shape").notes, json.loads((folder / "shape.json").read_text())):
        assert told["saturated_values"] == saturated and told["broken_values"] == 1


def test_a_dark_capture(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in folder.glob("light_*.exr"):
        images.write_rgb(path, np.zeros((12, 12, 3), np.float32))
    change_lights(folder, lambda i, light: light.pop("sha256"))
    refused(capsys, folder, "no pixel is lit by 12 lights", "--min-lit")


def test_pictures_changed_since_they_were_recorded_are_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for i in range(7):
        path = folder / f"light_{i:04d}.exr"
        images.write_rgb(path, images.read_rgb(path) * np.float32(1.01))
    assert cli.main(["shape", str(folder), "-o", str(folder / "shape")]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("shape: ")
    assert err.count("\n") == 1
    assert "light_0000.exr" in err and "light_0004.exr and 2 more" in err and "light_0005.exr" not in err


def test_a_program_sees_the_status_and_no_traceback(folder: Path) -> None:
    path = folder / "light_0001.exr"  # changed, too: a solve that is refused warns of nothing
    path.write_bytes(path.read_bytes()[:-100])
    words = [sys.executable, "-m", "pipeline", "shape", str(folder), "-o", str(folder / "shape")]
    run = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 2 and run.stdout == ""
    assert run.stderr.count("\n") == 1 and "light_0001.exr is damaged" in run.stderr
