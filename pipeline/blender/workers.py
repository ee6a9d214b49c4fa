"""Processes that render pictures of a capture side by side: each is told indices of lights, and answers
``picture INDEX SHA256`` when one is on disk."""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from ..core.errors import LightsphereError
from ..core.workers import Died, Worker, next_answer

ROOT = Path(__file__).resolve().parents[2]
EXTENSION = __package__.removesuffix(".pipeline.blender")


def command_line(*words: str, threads: int = 0) -> tuple[list[str], dict[str, str]]:
    """Return the command and environment that run ``lightsphere WORDS`` in a process with bpy of its own.

    In a Blender executable that is Blender in the background, of so many threads or (0) of one for every core, with bpy
    as a module this Python, which has yet to see to its threads: see :func:`bound_to_few_cores`.
    """
    environment = dict(os.environ)
    if bpy.app.binary_path:
        enabled = ["--addons", EXTENSION]  # preferences that say so may not be saved yet
        few = ["--threads", str(threads)] if threads else []
        return [bpy.app.binary_path, "--background", *few, *enabled, "--command", "lightsphere", *words], environment
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
    threads : int
        Of each, see :func:`command_line`.
    """

    def __init__(self, count: int, words: list[str], pending: deque[int], threads: int = 1) -> None:
        self._pending = pending
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._workers: list[Worker] = []
        self._threads: list[threading.Thread] = []
        self._start(count, words, threads)

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *error: object) -> None:
        for worker in self._workers:
            worker.kill()
        for thread in self._threads:
            thread.join()

    def finished(self) -> Iterator[tuple[int, str]]:
        """Yield light and checksum of the pictures that workers finished meanwhile; see :meth:`wait` for errors."""
        while not self._answers.empty():
            yield self.wait()

    def wait(self) -> tuple[int, str]:
        """Return light and checksum of the next picture that a worker finishes; one must be under way.

        Raises
        ------
        LightsphereError
            What a worker found wrong with its input.
        RuntimeError
            When a worker died, with its last words.
        """
        light, checksum = next_answer(self._answers)
        return light, checksum

    def _start(self, count: int, words: list[str], threads: int) -> None:
        arguments, environment = command_line(*words, "--threads", str(threads), threads=threads)
        for _ in range(count):
            worker = Worker(arguments, environment)
            thread = threading.Thread(target=self._feed, args=(worker,), daemon=True)
            self._workers.append(worker)
            self._threads.append(thread)
            thread.start()

    def _feed(self, worker: Worker) -> None:
        """Once a worker is ready, give it one light after another until none is left; pass its answers on."""
        try:
            worker.wait_until_ready()
            told = 0
            for light in taken(self._pending):
                worker.tell(light)
                told += 1
                if told > 1:  # one waits at the worker, so that it never does
                    self._pass_on(worker)
            if told:
                self._pass_on(worker)
        except LightsphereError as error:
            self._answers.put(error)
        except Died as death:
            self._answers.put(_cause_of(death))
        finally:
            worker.close()

    def _pass_on(self, worker: Worker) -> None:
        number, checksum = worker.answer("picture").split()
        self._answers.put((int(number), checksum))


def _cause_of(death: Died) -> Exception:
    if death.status < 0:
        return LightsphereError(
            f"a worker was killed by signal {-death.status}, perhaps for want of memory; run again with fewer "
            "--workers, finished pictures are kept"
        )
    return RuntimeError(str(death))
