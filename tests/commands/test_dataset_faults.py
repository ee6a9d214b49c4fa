"""Datasets while processes, cluster and disk fail: the end is that of an undisturbed run, byte for byte."""

from __future__ import annotations

import contextlib
import json
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.core.dataset import folder as dataset

RECIPE = """
seed = 5
count = {count}
[camera]
resolution = 24
[lights]
count = 2
[render]
samples = 2
"""
SHAPES = """
[shape]
source = ["gourd", "drawn.blend"]
"""
# Of a cube: more faces than Blender can count, and more than the memory that a run is given can hold.
TOO_FINE = """
import bpy, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_cube_add()
for levels in map(int, sys.argv[2:]):
    finer = bpy.context.object.modifiers.new("Finer", "SUBSURF")
    finer.levels = finer.render_levels = levels
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1], compress=False)
"""
MEMORY = 2**31  # bytes
KILLS = 50
LINUX = sys.platform.startswith("linux")

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not LINUX, reason="processes are found as Linux shows them")]


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "pipeline", "dataset", *map(str, words)]


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def children(pid: int) -> list[int]:
    """Return the processes that any thread of a process started."""
    found = []
    for thread in Path(f"/proc/{pid}/task").glob("*"):
        with contextlib.suppress(OSError):  # it ended meanwhile
            found += list(map(int, (thread / "children").read_text().split()))
    return found


def finished(folder: Path) -> int:
    return len(list((folder / dataset.FINISHED).glob("*.sha256")))


def written(folder: Path, count: int, more: str = "") -> Path:
    path = folder / f"recipe {count}.toml"
    path.write_text(RECIPE.format(count=count) + more)
    return path


def test_fifty_processes_killed_at_random_moments_change_nothing(tmp_path: Path) -> None:
    recipe = written(tmp_path, 150)  # more than are finished while processes are killed, on any machine
    calm, disturbed = tmp_path / "calm", tmp_path / "disturbed"
    subprocess.run(command(recipe, "-o", calm), check=True)
    chance, killed = random.Random(9), 0
    run = subprocess.Popen(command(recipe, "-o", disturbed))
    while killed < KILLS and run.poll() is None:
        enough = finished(disturbed) + chance.randint(0, 1)
        while finished(disturbed) < enough and run.poll() is None:
            time.sleep(0.01)
        time.sleep(chance.uniform(0, 0.3))
        if workers := children(run.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(chance.choice(workers), signal.SIGKILL)
                killed += 1
    assert run.wait() == 0
    assert killed == KILLS
    assert contents(disturbed) == contents(calm)


def test_an_interrupted_run_is_gone_on_with(tmp_path: Path) -> None:
    recipe = written(tmp_path, 8)
    calm, disturbed = tmp_path / "calm", tmp_path / "disturbed"
    subprocess.run(command(recipe, "-o", calm), check=True)
    for sent, status in ((signal.SIGINT, 130), (signal.SIGKILL, -9)):
        before = finished(disturbed)
        run = subprocess.Popen(command(recipe, "-o", disturbed))
        while finished(disturbed) < before + 2:
            time.sleep(0.05)
        workers = children(run.pid)
        assert len(workers) == 2
        run.send_signal(sent)
        assert run.wait(20) == status
        deadline = time.monotonic() + 20
        while any(Path(f"/proc/{pid}").exists() for pid in workers):  # a worker's input ends with its parent
            assert time.monotonic() < deadline
            time.sleep(0.1)
    subprocess.run(command("--resume", "-o", disturbed), check=True)
    assert contents(disturbed) == contents(calm)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 300 kB."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = shutil.which("mount")
    options = ["-t", "tmpfs", "-o", "size=300k", "tmpfs", str(place)]
    if mount is None or subprocess.run([mount, *options], capture_output=True).returncode:
        pytest.skip("a small disk cannot be mounted here")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_ends_the_run_and_space_completes_it(small_disk: Path, tmp_path: Path) -> None:
    recipe = written(tmp_path, 12)
    calm, full = tmp_path / "calm", small_disk / "made"
    subprocess.run(command(recipe, "-o", calm), check=True)
    run = subprocess.run(command(recipe, "-o", full), capture_output=True, text=True)
    assert run.returncode == 2
    assert "--resume" in run.stderr and "Traceback" not in run.stderr
    assert 0 < finished(full) < 12
    subprocess.run(["mount", "-o", "remount,size=50m", str(small_disk)], check=True)
    subprocess.run(command("--resume", "-o", full), check=True)
    assert contents(full) == contents(calm)


@pytest.mark.parametrize(
    ("levels", "memory", "words"),
    [((5, 11), None, "ended by signal 11 each of 3 times"), ((9,), MEMORY, "ended with status 1 each of 3 times")],
    ids=["crash", "memory"],
)
def test_a_scene_that_fells_blender_is_listed_and_the_rest_is_made(
    levels: tuple[int, ...], memory: int | None, words: str, tmp_path: Path
) -> None:
    recipe, scene = written(tmp_path, 8, SHAPES), tmp_path / "drawn.blend"
    calm, disturbed = tmp_path / "calm", tmp_path / "disturbed"

    def draw_scene(*levels: int) -> None:
        subprocess.run([sys.executable, "-c", TOO_FINE, scene, *map(str, levels)], check=True)

    def bound() -> None:
        if memory is not None:
            import resource  # not on Windows, where this module is skipped

            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))

    draw_scene(*levels)
    run = subprocess.run(command(recipe, "-o", disturbed), capture_output=True, text=True, preexec_fn=bound)
    missing = json.loads((disturbed / dataset.MISSING).read_text())
    assert run.returncode == 2 and "missing" in run.stderr
    assert 0 < len(missing) < 8 and finished(disturbed) == 8 - len(missing)
    assert all(words in why for why in missing.values())
    draw_scene(1)
    subprocess.run(command("--resume", "-o", disturbed), check=True)
    subprocess.run(command(recipe, "-o", calm), check=True)
    assert contents(disturbed) == contents(calm)


class Dask:
    """A scheduler and workers of Dask, each in a process of its own."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self._log = (folder / "dask.log").open("w")
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", self.port, "--no-dashboard")
        self.workers = [self.worker() for _ in range(2)]

    def worker(self) -> subprocess.Popen[bytes]:
        return self._start("worker", self.address, "--nthreads", 1, "--no-dashboard", "--no-nanny")

    def restart(self) -> None:
        """Take the scheduler away with all it knows, and its workers; start others."""
        for process in (self.scheduler, *self.workers):
            process.kill()
            process.wait()
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", self.port, "--no-dashboard")
        self.workers = [self.worker() for _ in range(2)]

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.terminate()
            process.wait()
        self._log.close()

    def _start(self, *words: object) -> subprocess.Popen[bytes]:
        arguments = [sys.executable, "-m", "distributed.cli.dask_" + str(words[0]), *map(str, words[1:])]
        return subprocess.Popen(arguments, stdout=self._log, stderr=self._log)


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[Dask]:
    pytest.importorskip("distributed")
    cluster = Dask(tmp_path)
    yield cluster
    cluster.close()


def test_a_cluster_that_loses_workers_and_its_scheduler_makes_the_same(dask: Dask, tmp_path: Path) -> None:
    recipe = written(tmp_path, 30)
    calm, disturbed = tmp_path / "calm", tmp_path / "disturbed"
    subprocess.run(command(recipe, "-o", calm), check=True)
    run = subprocess.Popen(command(recipe, "-o", disturbed, "--scheduler", dask.address))

    def wait_for(count: int) -> None:
        while finished(disturbed) < count and run.poll() is None:
            time.sleep(0.05)

    wait_for(3)
    dask.workers[0].kill()
    dask.workers[0].wait()
    dask.workers[0] = dask.worker()
    wait_for(8)
    for worker in children(dask.workers[1].pid):
        os.kill(worker, signal.SIGKILL)
    wait_for(14)
    dask.restart()
    assert run.wait(300) == 0
    assert contents(disturbed) == contents(calm)


def test_a_local_cluster_replaces_a_lost_worker(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    recipe = written(tmp_path, 12)
    calm, disturbed = tmp_path / "calm", tmp_path / "disturbed"
    subprocess.run(command(recipe, "-o", calm), check=True)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        run = subprocess.Popen(command(recipe, "-o", disturbed, "--scheduler", cluster.scheduler_address))
        while finished(disturbed) < 3 and run.poll() is None:
            time.sleep(0.05)
        lost = cluster.workers[0].pid
        os.kill(lost, signal.SIGKILL)
        assert run.wait(300) == 0
        assert cluster.workers[0].pid != lost
    assert contents(disturbed) == contents(calm)


def test_a_scheduler_that_does_not_answer_is_said(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    recipe = written(tmp_path, 2)
    words = command(recipe, "-o", tmp_path / "made", "--scheduler", "nonsense://host")
    run = subprocess.run(words, capture_output=True, text=True)
    assert run.returncode == 2
    assert "no Dask scheduler answers at nonsense://host" in run.stderr
