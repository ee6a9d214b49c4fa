"""Show every reader damaged files: each must be read or refused in words, in bounded time and memory.

Run as ``.venv-3.13/bin/python tests/fuzz/job.py --inputs 100000`` with the Python that ``bootstrap.py`` set up. A
process of its own reads the files, so that one that dies is noticed; inputs that are not taken as they should be are
kept.
"""

from __future__ import annotations

import argparse
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from pipeline.core.errors import LightsphereError
from tests.fuzz.mutations import damaged
from tests.fuzz.readers import readers

MOST_SECONDS = 10.0  # for one input
MOST_MEMORY = 3 * 2**30  # that a process may take for inputs [bytes]; its libraries aside
NOW = "now"  # the file that names the input at hand
READ, REFUSED, FAULT = "read", "refused", "fault"
LISTED = 50  # inputs after which it is looked whether files were left


def main() -> int:
    """Fuzz all readers, print a table, and return 1 when an input was not taken as it should be."""
    parser = argparse.ArgumentParser(description="Show every reader damaged files.")
    parser.add_argument("--inputs", type=int, default=3000, help="files in all (default: 3000)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path("fuzz_failures"), help="where inputs at fault are kept")
    parser.add_argument("--reader", default="", help="one reader alone")
    parser.add_argument("--worker", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--first", type=int, default=0, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker is not None:
        _read_all(given)
        return 0
    start, faults, done = time.monotonic(), 0, 0
    counts: Counter[tuple[str, str]] = Counter()
    memory = Path("/dev/shm")  # where files cost least
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as place:
        while done < given.inputs:
            now = _new(Path(place) / "files") / NOW
            words = ["--inputs", given.inputs, "--seed", given.seed, "--keep", given.keep, "--reader", given.reader]
            words += ["--worker", now.parent, "--first", done]
            run = subprocess.Popen([sys.executable, __file__, *map(str, words)], stdout=subprocess.PIPE, text=True)
            assert run.stdout is not None
            for line in run.stdout:
                kind, name, rest = (*line.strip().split(" ", 2), "")[:3]
                if kind in (READ, REFUSED):
                    counts[name, kind] += 1
                if kind == FAULT:  # other lines are Blender's
                    faults += 1
                    print(f"{name}: {rest}", flush=True)
            done = int(now.read_text()) + 1
            if run.wait():
                faults += 1
                print(f"the process died with status {run.returncode} at input {done - 1}", flush=True)
    print(f"{'reader':14}{READ:>10}{REFUSED:>10}")
    for name in dict.fromkeys(name for name, _ in counts):
        print(f"{name:14}{counts[name, READ]:10}{counts[name, REFUSED]:10}")
    print(f"{given.inputs} inputs, {faults} not taken as they should be, {time.monotonic() - start:.0f} s")
    return int(faults > 0)


def _read_all(given: argparse.Namespace) -> None:
    """Read inputs from a first one on, of every reader in turn; print what became of each."""
    import bpy  # noqa: F401 - before memory is bounded

    place = given.worker
    found = readers(place)
    chosen = [(name, found[name]) for name in ([given.reader] if given.reader else found)]
    good = {path: path.read_bytes() for _, reader in chosen for path in reader.files}
    _bound_memory()
    warnings.simplefilter("ignore")
    now = place / NOW
    now.touch()
    before = _listing(place)
    for number in range(given.first, given.inputs):
        now.write_text(str(number))
        name, reader = chosen[number % len(chosen)]
        chance = random.Random(f"{given.seed} {name} {number}")
        path = chance.choice(reader.files)
        data = damaged(good[path], chance, list(good.values()))
        path.write_bytes(data)
        outcome = _judged(reader.read, path)
        path.write_bytes(good[path])
        if number % LISTED == 0 and _listing(place) != before:
            outcome = "files were left by this input or one of those before"
        if outcome in (READ, REFUSED):
            print(outcome, name)
            continue
        given.keep.mkdir(parents=True, exist_ok=True)
        kept = given.keep / f"{name}-{number}{path.suffix}"
        kept.write_bytes(data)
        print(FAULT, name, f"{kept}: {outcome}", flush=True)


def _judged(read: Any, path: Path) -> str:
    """Return whether a file was read or refused, or what is wrong with how it was taken."""
    start, outcome = time.monotonic(), READ
    _alarm(int(6 * MOST_SECONDS))
    try:
        read(path)
    except (LightsphereError, OSError) as error:  # the command line says both in one line
        outcome = REFUSED if str(error).strip() else "refused without words"
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
    finally:
        _alarm(0)
    seconds = time.monotonic() - start
    return f"{seconds:.0f} s" if seconds > MOST_SECONDS else outcome


def _bound_memory() -> None:
    """Let this process take no more than it has and a bit."""
    if not sys.platform.startswith("linux"):
        return
    import resource

    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MOST_MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def _alarm(seconds: int) -> None:
    if hasattr(signal, "alarm"):
        signal.alarm(seconds)


def _listing(place: Path) -> set[str]:
    return {str(path.relative_to(place.parent)) for path in place.parent.rglob("*")}


def _new(place: Path) -> Path:
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    return place


if __name__ == "__main__":
    sys.exit(main())
