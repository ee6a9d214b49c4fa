"""Worker processes: what they answer, and what is said when one ends."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from collections import deque
from pathlib import Path

import pytest

from pipeline.blender import capture, workers
from pipeline.blender import scene as scenes
from pipeline.core import images
from pipeline.core.capture import Capture
from pipeline.core.capture_settings import CaptureSettings
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish

SCENE = "steps"


@pytest.fixture(scope="module")
def captured(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    settings = CaptureSettings(inner=4, outer=4, resolution=16, effects="direct", workers=1)
    return finish(capture.capture(scenes.load(SCENE), SCENE, tmp_path_factory.mktemp("workers"), settings))


def test_worker_renders_what_is_pending(captured: Capture) -> None:
    before = captured.checksums
    for name in captured.files[2:5]:
        (captured.folder / name).unlink()
    with workers.Pool(1, ["capture-worker", SCENE, str(captured.folder)], deque([2, 3, 4])) as pool:
        found = dict(pool.wait() for _ in range(3))
    assert found == {i: before[i] for i in (2, 3, 4)}
    assert images.checksum(captured.folder / captured.files[3]) == before[3]


def test_wrong_input_of_a_worker_reaches_its_parent(tmp_path: Path) -> None:
    with (
        workers.Pool(1, ["capture-worker", SCENE, str(tmp_path)], deque([0])) as pool,
        pytest.raises(LightsphereError, match="is not a capture"),
    ):
        pool.wait()


def test_killed_worker_is_explained(captured: Capture) -> None:
    with workers.Pool(1, ["capture-worker", SCENE, str(captured.folder)], deque([0])) as pool:
        pool._workers[0].kill()
        with pytest.raises(LightsphereError, match=r"killed by signal 9.*fewer --workers"):
            pool.wait()


def test_failing_worker_is_a_bug_with_its_traceback(captured: Capture, tmp_path: Path) -> None:
    dataclasses.replace(captured, folder=tmp_path, notes={}).save()
    with (
        workers.Pool(1, ["capture-worker", SCENE, str(tmp_path)], deque([0])) as pool,
        pytest.raises(RuntimeError) as e,
    ):
        pool.wait()
    assert "Traceback" in str(e.value) and "status 1" in str(e.value)


def test_worker_that_nobody_needs_is_ended() -> None:
    with workers.Pool(2, ["capture-worker", SCENE, "nowhere"], deque()) as pool:
        workers_of_it = pool._workers
        assert list(pool.finished()) == []
    assert all(worker.has_ended for worker in workers_of_it)


COUNTED = """
import contextlib, os, sys
from pathlib import Path
from pipeline.core.workers import bound_to_few_cores
cores = os.sched_getaffinity(0)
with bound_to_few_cores(1) if sys.argv[1] == "few" else contextlib.nullcontext():
    from pipeline.blender import olat, scene
    from pipeline.core.capture import Capture
assert os.sched_getaffinity(0) == cores
for _ in olat.render_lights(scene.load("steps"), Capture.open(Path(sys.argv[2])), [0, 1], 1):
    pass
print("threads", len(os.listdir("/proc/self/task")))
"""


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity") or (os.cpu_count() or 1) < 2, reason="needs cores to bind to")
def test_a_process_loaded_on_one_core_has_fewer_threads(captured: Capture) -> None:
    def threads(which: str) -> int:
        words = [sys.executable, "-c", COUNTED, which, str(captured.folder)]
        printed = subprocess.run(words, capture_output=True, text=True, check=True, cwd=workers.ROOT).stdout
        return int(printed.rsplit("threads", 1)[1])

    assert threads("few") < threads("many")
