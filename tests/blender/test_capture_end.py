"""Captures that end too early: killed, interrupted, out of disk; and the command line's answer to wrong input."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipeline import cli
from pipeline.core.capture import Capture
from pipeline.core.journal import Journal

resource = pytest.importorskip("resource")  # limits and signals are POSIX

ROOT = Path(__file__).parents[2]
WORDS = ("--inner", "40", "--outer", "10", "--resolution", "32", "--effects", "direct", "--workers", "2")
WORDS += ("--renderer", "cycles")  # in processes


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def words(folder: Path) -> list[str]:
    return ["capture", "teapot-metal", "-o", str(folder), *WORDS]


def started(folder: Path, **options: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "pipeline", *words(folder)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def wait_for_pictures(process: subprocess.Popen[str], folder: Path, count: int) -> None:
    while process.poll() is None and len(list(folder.glob("light_*.exr"))) < count:
        time.sleep(0.001)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("undisturbed")
    assert cli.main(words(folder)) == 0
    files = bytes_of(folder)
    assert sorted(files)[:2] == ["capture.json", "light_0000.exr"] and len(files) == 53
    return files


def test_killed_capture_continues_to_the_same_bytes(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    chance = random.Random()  # every run another moment; the assertions name it
    for _ in range(2):
        process = started(tmp_path)
        moment = chance.uniform(0, 1)
        wait_for_pictures(process, tmp_path, min(49, len(list(tmp_path.glob("light_*.exr"))) + chance.randint(0, 15)))
        time.sleep(0.03 * moment)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        for path in tmp_path.glob("light_*.exr"):
            assert path.read_bytes() == undisturbed[path.name], (path, moment)
    recorded = Journal(tmp_path / "finished.sha256").read()
    assert cli.main(words(tmp_path)) == 0
    assert bytes_of(tmp_path) == undisturbed
    checksums = dict(zip(Capture.open(tmp_path).files, Capture.open(tmp_path).checksums, strict=True))
    assert recorded.items() <= checksums.items()


def test_interrupt_ends_with_130_and_keeps_what_is_done(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    process = started(tmp_path)
    wait_for_pictures(process, tmp_path, 10)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted" in err and "Traceback" not in err and err.count("\n") == 1
    kept = list(tmp_path.glob("light_*.exr"))
    assert 10 <= len(kept) < 50 and not list(tmp_path.glob(".*"))
    recorded = Journal(tmp_path / "finished.sha256").read()
    assert len(kept) - len(recorded) <= 2  # a picture a process may be on disk and not noted yet
    assert cli.main(words(tmp_path)) == 0
    assert bytes_of(tmp_path) == undisturbed


def test_full_disk_names_the_picture_and_keeps_the_others(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    for name, content in undisturbed.items():
        (tmp_path / name).write_bytes(content)
    missing = max((name for name in undisturbed if name.startswith("light")), key=lambda name: len(undisturbed[name]))
    (tmp_path / missing).unlink()
    limit = len(undisturbed[missing]) // 2

    def little_space() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    process = started(tmp_path, preexec_fn=little_space)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2, err
    assert err.startswith(f"lightsphere: {tmp_path / missing} cannot be written") and err.count("\n") == 1
    assert "free space" in err
    assert bytes_of(tmp_path) == {name: content for name, content in undisturbed.items() if name != missing}


def test_full_disk_at_the_start_says_so_and_leaves_nothing(tmp_path: Path) -> None:
    def little_space() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))

    process = started(tmp_path, preexec_fn=little_space)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2, err
    assert "cannot be written" in err and "free space" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (["teapot-wood"], "there is no scene 'teapot-wood'; give a .blend file or one of teapot-lambert"),
        (["nowhere.blend"], "nowhere.blend does not exist"),
        (["{damaged}"], "cannot be opened"),
        (["steps", "--radius-inner", "0.9"], "is inside the object"),
        (["steps", "--radius-inner", "5"], "the outer sphere must be the larger one"),
        (["steps", "--rig", "no.lp"], "no.lp"),
        (["steps", "--rig", "scene"], "has no light rig"),
        (["steps", "--rig", "{count}"], "promises 3 lights and lists 1"),
        (["steps", "--inner", "1"], "inner is 1; it must be at least 4"),
        (["steps", "--effects", "some"], "effects is 'some'; choose one of auto, direct, full"),
    ],
)
def test_wrong_input_is_one_line_and_status_2(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], changed: list[str], said: str
) -> None:
    (tmp_path / "damaged.blend").write_bytes(b"BLENDER, but not really")
    (tmp_path / "count.lp").write_text("3\na 1 2 3\n")
    files = {"damaged": tmp_path / "damaged.blend", "count": tmp_path / "count.lp"}
    scene, *options = (word.format(**files) for word in changed)
    assert cli.main(["capture", scene, "-o", str(tmp_path / "out"), "--effects", "direct", *options]) == 2
    out, err = capfd.readouterr()
    assert said in err and "Traceback" not in err
    assert err.startswith("lightsphere: ") and err.count("\n") == 1, err
    assert out == ""
    assert not list(tmp_path.glob("out/light_*"))
