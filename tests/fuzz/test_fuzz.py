"""The fuzz job: no reader falls over; and the job itself finds readers that do."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.core.errors import LightsphereError
from tests.fuzz import job
from tests.fuzz.mutations import damaged

GOOD = b'{"lights": [1, 2, {"file": "a.png"}], "notes": {}}' + bytes(range(200))


def run(inputs: int, keep: Path) -> None:
    words = [sys.executable, job.__file__, "--inputs", str(inputs), "--seed", str(inputs), "--keep", str(keep)]
    found = subprocess.run(words, capture_output=True, text=True)
    assert found.returncode == 0, found.stdout
    assert f"{inputs} inputs, 0 not taken as they should be" in found.stdout


def test_readers_take_damaged_files(tmp_path: Path) -> None:
    run(1500, tmp_path)


@pytest.mark.slow
def test_readers_take_a_hundred_thousand_damaged_files(tmp_path: Path) -> None:
    run(100_000, tmp_path)


def test_damage_differs_comes_back_and_is_damage() -> None:
    made = [damaged(GOOD, random.Random(seed), [GOOD]) for seed in range(200)]
    assert made == [damaged(GOOD, random.Random(seed), [GOOD]) for seed in range(200)]
    assert len(set(made)) > 190
    assert sum(one == GOOD for one in made) < 5


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (None, job.READ),
        (LightsphereError("it is damaged; copy it again"), job.REFUSED),
        (LightsphereError(" "), "refused without words"),
        (KeyError("camera"), "KeyError: 'camera' (test_fuzz.py:"),
        (MemoryError(), "MemoryError:  (test_fuzz.py:"),
    ],
)
def test_a_reader_that_falls_over_is_told_from_one_that_refuses(error: Exception | None, words: str) -> None:
    def read(path: Path) -> None:
        if error is not None:
            raise error

    assert job._judged(read, Path("file")).startswith(words)


def test_a_reader_that_takes_long_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(job, "MOST_SECONDS", -1.0)
    monkeypatch.setattr(job, "_alarm", lambda seconds: None)
    assert job._judged(lambda path: None, Path("file")) == "0 s"
