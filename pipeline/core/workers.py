"""A process that does one thing after another for us, and that may die.

It prints ``ready`` once it can work, then reads one line from its standard input for every task, and answers each with
one line: a word that says what it is and the rest, or ``error TEXT`` when the task's input is at fault; other lines
are Blender's and are passed over. It ends with its input, so that none outlives its parent.
"""

from __future__ import annotations

import contextlib
import os
import queue
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from .errors import LightsphereError

LAST_WORDS = 4000  # letters of what a process said last


class Died(Exception):
    """A worker ended in the middle of its work: with a status, or by a signal where that is negative."""

    def __init__(self, status: int, words: str) -> None:
        super().__init__(f"a worker ended with status {status}: {words}")
        self.status, self.words = status, words


def next_answer(answers: queue.SimpleQueue[Any]) -> Any:
    """Wait for the next answer that a thread passes on, and return it, or raise it where it is an error."""
    while True:
        try:
            answer = answers.get(timeout=0.1)  # so that an interrupt is heard on every system
        except queue.Empty:
            continue
        if isinstance(answer, Exception):
            raise answer
        return answer


@contextlib.contextmanager
def bound_to_few_cores(threads: int) -> Iterator[None]:
    """Bind this process for a while to as many cores as it has threads, where the system can.

    A library that is loaded then makes no more threads, as Blender's does: one for every core that it may use (oneTBB),
    which look for work in vain and take the cores from the processes beside.
    """
    if not hasattr(os, "sched_setaffinity"):  # not Linux
        yield
        return
    cores = sorted(os.sched_getaffinity(0))
    first = os.getpid() % len(cores)  # not all processes on the same ones
    os.sched_setaffinity(0, (cores + cores)[first : first + min(threads, len(cores))])
    try:
        yield
    finally:
        for thread in Path("/proc/self/task").iterdir():  # those that were made meanwhile, too
            with contextlib.suppress(ProcessLookupError):  # it has ended
                os.sched_setaffinity(int(thread.name), cores)


class Worker:
    """A process and its answers.

    Parameters
    ----------
    arguments : sequence of str
        Its command line.
    environment : mapping of str to str
    """

    def __init__(self, arguments: Sequence[str], environment: Mapping[str, str]) -> None:
        self._errors: Any = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the worker
        self._process = subprocess.Popen(
            arguments,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            start_new_session=True,  # an interrupt reaches the parent alone, which then ends its workers
        )
        self._ready = False

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def has_ended(self) -> bool:
        """Whether the process is there no more."""
        return self._process.poll() is not None

    def ask(self, task: object, expected: str) -> str:
        """Give the worker a task, and return what follows the expected word of its answer.

        Raises
        ------
        LightsphereError
            What it found wrong with its input; it can be asked again.
        Died
            When it ended instead.
        """
        self.tell(task)
        return self.answer(expected)

    def tell(self, task: object) -> None:
        """Give the worker a task, which it begins after those that it has; raises what :meth:`ask` does."""
        assert self._process.stdin is not None
        self.wait_until_ready()
        try:
            self._process.stdin.write(f"{task}\n")
            self._process.stdin.flush()
        except (OSError, ValueError) as error:
            raise self._death() from error

    def answer(self, expected: str) -> str:
        """Return the answer to the first task that has none yet; raises what :meth:`ask` does."""
        try:
            return self._answer(expected)
        except (OSError, EOFError, ValueError) as error:
            raise self._death() from error

    def wait_until_ready(self) -> None:
        """Wait until the process can work; raises what :meth:`ask` does."""
        if not self._ready:
            self.answer("ready")
            self._ready = True

    def close(self) -> None:
        """Let the process end, and wait for it."""
        assert self._process.stdin is not None and self._process.stdout is not None
        with contextlib.suppress(OSError):  # it died with words of ours unread
            self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()
        self._errors.close()

    def kill(self) -> None:
        """End the process at once; who waits for an answer is told that it died."""
        self._process.kill()

    def _answer(self, expected: str) -> str:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            kind, _, rest = line.rstrip("\n").partition(" ")
            if kind == expected:
                return rest
            if kind == "error":
                raise LightsphereError(rest)
        raise EOFError

    def _death(self) -> Died:
        status = self._process.wait()
        self._errors.seek(0)
        return Died(status, self._errors.read().decode(errors="replace")[-LAST_WORDS:].strip())
