"""The farm, with processes that make files instead of captures, and that die in every way that processes die."""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from pipeline.core.dataset import farm, run
from pipeline.core.dataset import folder as dataset
from pipeline.core.dataset.farm import CRASHES, Farm
from pipeline.core.dataset.recipe import Recipe
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from pipeline.core.workers import Died, Worker

FEW = 4  # kills that a sample may cost in a test
# What a process is: makes sample N unless a file beside it says what else happens to that number.
PROGRAM = """
import os, resource, signal, sys, time
from pathlib import Path
from pipeline.core.dataset import folder as dataset
folder, faults = Path(sys.argv[1]), Path(sys.argv[2])
print("ready", flush=True)
for line in sys.stdin:
    index = int(line)
    fault = faults / str(index)
    what = fault.read_text() if fault.is_file() else ""
    if what == "once":
        fault.unlink()
        os.kill(os.getpid(), signal.SIGSEGV)
    if what == "crash":
        print("the renderer fell over", file=sys.stderr, flush=True)
        os.kill(os.getpid(), signal.SIGSEGV)
    if what == "bug":
        raise RuntimeError("a bug")
    if what == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if what == "memory":
        resource.setrlimit(resource.RLIMIT_AS, (2**29, 2**29))
        hoard = [bytearray(2**26) for _ in range(64)]
    if what == "input":
        print("error the mesh is broken; mend it", flush=True)
        continue
    print("Blender says something")
    made = folder / f".{index}.{os.getpid()}{dataset.PART}"
    place = made / "capture" / f"{index:08d}"
    place.mkdir(parents=True)
    (place / "light.exr").write_text(f"picture {index}" * 1000)
    time.sleep(float(os.environ.get("SLOW", 0)))
    dataset.commit(made, folder, index)
    made.rmdir() if not any(made.iterdir()) else None
    print("sample", index, flush=True)
"""


class Place(NamedTuple):
    """A begun dataset, its recipe, and where faults are planted."""

    folder: Path
    recipe: Recipe
    faults: Path

    def worker(self) -> Worker:
        return Worker((sys.executable, "-c", PROGRAM, str(self.folder), str(self.faults)), os.environ)

    def hire(self, samples: Sequence[int]) -> Farm:
        return Farm(2, self.worker, samples)


Begin = Callable[[int], Place]


@pytest.fixture
def begin(tmp_path: Path) -> Begin:
    def begun(count: int) -> Place:
        number = len(list(tmp_path.iterdir()))
        folder, faults = tmp_path / f"dataset {number}", tmp_path / f"faults {number}"
        faults.mkdir()
        recipe = Recipe.of({"count": count})
        dataset.begin(folder, recipe, {})
        return Place(folder, recipe, faults)

    return begun


def contents(folder: Path) -> dict[str, bytes]:
    paths = [path for path in folder.rglob("*") if path.is_file() and path.name != dataset.RECIPE]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def test_an_undisturbed_run_makes_every_sample(begin: Begin) -> None:
    place = begin(12)
    made = finish(run.make(place.folder, place.recipe, range(place.recipe.count), place.hire))
    assert (made.new, made.missing) == (12, {})
    assert len(contents(place.folder)) == 12 * 2 + 1
    again = finish(run.make(place.folder, place.recipe, range(place.recipe.count), place.hire))
    assert again.new == 0 and len(again.samples) == 12


def test_a_crash_that_does_not_come_back_costs_nothing(begin: Begin) -> None:
    place, calm = begin(8), begin(8)
    for index in (0, 3, 7):
        (place.faults / str(index)).write_text("once")
    assert finish(run.make(place.folder, place.recipe, range(place.recipe.count), place.hire)).missing == {}
    finish(run.make(calm.folder, calm.recipe, range(calm.recipe.count), calm.hire))
    assert contents(place.folder) == contents(calm.folder)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("crash", f"ended by signal 11 each of {CRASHES} times: the renderer fell over; mend"),
        ("bug", f"ended with status 1 each of {CRASHES} times: RuntimeError: a bug"),
        ("memory", f"ended with status 1 each of {CRASHES} times: MemoryError"),
        ("killed", f"killed {FEW} times, perhaps for want of memory"),
        ("input", "the mesh is broken; mend it"),
    ],
)
def test_a_sample_that_cannot_be_made_is_listed_and_the_others_are_made(
    begin: Begin, monkeypatch: pytest.MonkeyPatch, fault: str, words: str
) -> None:
    monkeypatch.setattr(farm, "KILLS", FEW)
    place, calm = begin(6), begin(6)
    (place.faults / "2").write_text(fault)
    made = finish(run.make(place.folder, place.recipe, range(place.recipe.count), place.hire))
    assert list(made.missing) == [2]
    assert words in made.missing[2]
    assert words in (place.folder / dataset.MISSING).read_text()
    assert made.new == 5
    (place.faults / "2").unlink()
    assert finish(run.make(place.folder, place.recipe, range(place.recipe.count), place.hire)).missing == {}
    finish(run.make(calm.folder, calm.recipe, range(calm.recipe.count), calm.hire))
    assert contents(place.folder) == contents(calm.folder)


@pytest.mark.slow
def test_processes_killed_fifty_times_at_random_moments_change_nothing(
    begin: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, calm = begin(200), begin(200)
    finish(run.make(calm.folder, calm.recipe, range(calm.recipe.count), calm.hire))
    monkeypatch.setenv("SLOW", "0.1")
    farms: list[Farm] = []
    killed = []

    def hire(samples: Sequence[int]) -> Farm:
        farms.append(place.hire(samples))
        return farms[0]

    def kill() -> None:
        chance = random.Random(4)
        while len(killed) < 50:
            time.sleep(chance.uniform(0.05, 0.25))
            for pid in chance.sample(farms[0].pids, min(1, len(farms[0].pids))) if farms else ():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
                    killed.append(pid)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    made = finish(run.make(place.folder, place.recipe, range(place.recipe.count), hire))
    killer.join(60)
    assert made.missing == {}
    assert len(killed) == 50
    assert contents(place.folder) == contents(calm.folder)


def test_processes_that_cannot_start_end_the_run_with_their_words(begin: Begin) -> None:
    place = begin(4)

    def broken() -> Worker:
        return Worker((sys.executable, "-c", "raise SystemExit('no library')"), os.environ)

    with pytest.raises(RuntimeError, match=r"before they can work.*no library"):
        finish(
            run.make(place.folder, place.recipe, range(place.recipe.count), lambda samples: Farm(2, broken, samples))
        )


def test_leaving_a_farm_ends_its_processes(begin: Begin, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLOW", "30")
    place = begin(4)
    with place.hire(range(4)) as at_work:
        while len(at_work.pids) < 2:
            time.sleep(0.01)
        pids = at_work.pids
        start = time.monotonic()
    assert time.monotonic() - start < 10
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_a_full_disk_ends_the_run_and_keeps_what_is_finished(begin: Begin, monkeypatch: pytest.MonkeyPatch) -> None:
    place = begin(6)
    (place.faults / "5").write_text("input")
    usage = shutil.disk_usage(place.folder)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=1000))
    with pytest.raises(LightsphereError, match=r"disk of .* is full, \d of 6 samples are there .*--resume"):
        finish(run.make(place.folder, place.recipe, range(place.recipe.count), place.hire))
    (place.faults / "5").unlink()
    made = finish(run.make(place.folder, place.recipe, range(place.recipe.count), place.hire))
    assert made.missing == {} and made.new < 6


def test_a_worker_that_died_says_how(begin: Begin) -> None:
    place = begin(1)
    (place.faults / "0").write_text("crash")
    worker = place.worker()
    with pytest.raises(Died) as death:
        worker.ask(0, "sample")
    assert (death.value.status, death.value.words) == (-signal.SIGSEGV, "the renderer fell over")
    worker.close()


def test_a_forecast_is_that_of_its_samples(begin: Begin) -> None:
    place = begin(1)
    recipe = Recipe.of({"count": 40, "lights": {"count": [5, 60]}})
    folder = place.folder.with_name("tried")
    dataset.begin(folder, recipe, {})
    seconds = {}

    def made_in(index: int) -> float:
        lights = run.draw(recipe, index).lights
        made = folder / f".{index}{dataset.PART}"
        (made / "capture" / f"{index:08d}").mkdir(parents=True)
        (made / "capture" / f"{index:08d}" / "light.exr").write_bytes(bytes(100 + 30 * lights))
        dataset.commit(made, folder, index)
        seconds[index] = 0.7 + 0.2 * lights
        return seconds[index]

    found = finish(run.forecast(recipe, folder, 2, lambda chosen: map(made_in, chosen)))
    lights = sum(run.draw(recipe, index).lights for index in range(40))
    assert len(seconds) == run.TRIED
    assert found.renders == lights
    assert found.seconds == pytest.approx(40 * 0.7 + 0.2 * lights)
    assert found.size == pytest.approx(40 * 100 + 30 * lights)
