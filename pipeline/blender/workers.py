"""Processes that render pictures of a capture side by side.

A worker reads the index of a light from its standard input, one a line, and answers each with one line: ``picture
INDEX SHA256`` when it is on disk, or ``error TEXT``. It ends with its input, so that none outlives its parent.
"""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from ..core.errors import LightsphereError

ROOT = Path(__file__).resolve().parents[2]


def command_line(*words: str) -> tuple[list[str], dict[str, str]]:
    """Return the command and environment that run ``lightsphere WORDS`` in a process with bpy of its own.

    In a Blender executable that is Blender in the background, with bpy as a module this Python.
    """
    environment = dict(os.environ)
    if bpy.app.binary_path:
        return [bpy.app.binary_path, "--background", "--command", "lightsphere", *words], environment
    blender = bpy.utils.resource_path("LOCAL")  # the module puts its own folders on the path, in its own order
    paths = [path for path in sys.path if path and not path.startswith(blender)]
    environment["PYTHONPATH"] = os.pathsep.join([str(ROOT), *paths])
    return [sys.executable, "-m", "pipeline", *words], environment


def taken(pending: deque[int]) -> Iterator[int]:
    """Take lights from a list that others take from, too, until it is empty."""
    while True:
        try:
            light = pending.popleft()
        except IndexError:
            return
        yield light


class Pool:
    """Worker processes that take lights from a shared list until it is empty.

    Parameters
    ----------
    count : int
        Number of processes.
    words : sequence of str
        The command that each runs, see :func:`command_line`.
    pending : deque of int
        Lights still to be rendered; the caller may take from it, too.
    """

    def __init__(self, count: int, words: list[str], pending: deque[int]) -> None:
        self._pending = pending
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._processes: list[subprocess.Popen[str]] = []
        self._threads: list[threading.Thread] = []
        self._start(count, words)

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *error: object) -> None:
        for process in self._processes:
            process.kill()
        for thread in self._threads:
            thread.join()
        for process in self._processes:
            process.wait()

    def finished(self, wait: bool = False) -> Iterator[tuple[int, str]]:
        """Yield light and checksum of pictures finished meanwhile; with ``wait``, of all until every worker ended.

        Raises
        ------
        LightsphereError
            What a worker found wrong with its input.
        RuntimeError
            When a worker died, with its last words.
        """
        while (wait and any(thread.is_alive() for thread in self._threads)) or not self._answers.empty():
            try:
                answer = self._answers.get(timeout=0.1)
            except queue.Empty:
                continue
            if isinstance(answer, Exception):
                raise answer
            yield answer

    def _start(self, count: int, words: list[str]) -> None:
        arguments, environment = command_line(*words)
        for _ in range(count):
            errors = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the thread that reads it
            process = subprocess.Popen(
                arguments,
                env=environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                start_new_session=True,  # an interrupt reaches this process alone, which then ends the workers
            )
            thread = threading.Thread(target=self._feed, args=(process, errors), daemon=True)
            self._processes.append(process)
            self._threads.append(thread)
            thread.start()

    def _feed(self, process: subprocess.Popen[str], errors: Any) -> None:
        """Give one worker a light at a time until none is left or one fails, and pass its answers on."""
        assert process.stdin is not None and process.stdout is not None
        with errors, process.stdout:
            try:
                with process.stdin:
                    for light in taken(self._pending):
                        process.stdin.write(f"{light}\n")
                        process.stdin.flush()
                        self._answers.put(answer := self._answer(process.stdout, errors))
                        if isinstance(answer, Exception):
                            return
            except OSError:  # the worker is gone
                self._answers.put(_last_words(errors))

    @staticmethod
    def _answer(lines: Any, errors: Any) -> tuple[int, str] | Exception:
        for line in lines:
            kind, _, rest = line.rstrip("\n").partition(" ")
            if kind == "picture":
                light, checksum = rest.split()
                return int(light), checksum
            if kind == "error":
                return LightsphereError(rest)
        return _last_words(errors)


def _last_words(errors: Any) -> RuntimeError:
    errors.seek(0)
    return RuntimeError("a worker died: " + errors.read().decode(errors="replace")[-4000:])
