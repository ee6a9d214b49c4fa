"""A stage in a worker process: started, asked how far it is, stopped. Knows nothing of Blender's window."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any

POSIX = os.name == "posix"
NICE = 10  # of the worker and its children: the window comes first
PATIENCE = 20.0  # [s] that a stopped worker has to finish the picture at hand


class Task:
    """A command that prints its progress as lines of JSON.

    Attributes
    ----------
    stage, done, total, unit
        The last step that it told.
    rate : float
        How much of the step's unit is done a second, 0 where nothing is known yet.
    error : str
        Its last line on standard error, once it has ended with another status than 0.
    stopped : float
        When it was asked to stop [s], 0 when it was not.
    log : list of str
        What it said on standard error.
    """

    def __init__(self, command: Sequence[str], environment: Mapping[str, str], first_words: str) -> None:
        """Start the command; the first words stand for its stage until it tells one."""
        self.stage, self.done, self.total, self.unit = first_words, 0.0, 0.0, ""
        self.rate = 0.0
        self.error = ""
        self.stopped = 0.0
        self._since = (0.0, 0.0)  # when the step at hand was first told of, and how much was done then
        self.log: list[str] = []
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._process = subprocess.Popen(
            command,
            env={**environment, "LIGHTSPHERE_PROGRESS": "json"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            errors="replace",
            start_new_session=POSIX,
            creationflags=0 if POSIX else subprocess.BELOW_NORMAL_PRIORITY_CLASS,
        )
        if POSIX:
            with contextlib.suppress(ProcessLookupError):  # it has ended already
                os.setpriority(os.PRIO_PROCESS, self._process.pid, NICE)
        self._readers = [
            threading.Thread(target=self._collect, args=(self._process.stdout, self._lines.put), daemon=True),
            threading.Thread(target=self._collect, args=(self._process.stderr, self.log.append), daemon=True),
        ]
        for reader in self._readers:
            reader.start()

    def poll(self) -> bool:
        """Take in what the worker has told since the last call; return whether it still runs."""
        status = self._process.poll()
        if status is None and self.stopped and time.monotonic() > self.stopped + PATIENCE:
            self._process.kill()
        if status is not None:
            for reader in self._readers:
                reader.join()
        while not self._lines.empty():
            self._take(self._lines.get())
        if status:
            told = [line for line in self.log if line.strip()]
            self.error = told[-1].removeprefix("lightsphere: ") if told else f"the worker ended with status {status}"
        return status is None

    @property
    def seconds_left(self) -> float | None:
        """Time that the step at hand still takes at the rate so far [s], None where nothing is known yet."""
        return (self.total - self.done) / self.rate if self.rate else None

    def stop(self) -> None:
        """Ask the worker to stop as Ctrl-C does, so that what is finished is kept; it goes on for a moment."""
        self.stopped = time.monotonic()
        self.stage, self.total, self.rate = "stopping", 0.0, 0.0
        if self._process.poll() is not None:
            return
        if POSIX:
            os.killpg(self._process.pid, signal.SIGINT)
        else:
            self._process.terminate()

    def _take(self, line: str) -> None:
        if self.stopped or not line.startswith('{"stage"'):  # Cycles and Blender talk on the same stream
            return
        step, now = json.loads(line), time.monotonic()
        if step["stage"] != self.stage or step["done"] < self.done:
            self._since = (now, step["done"])
        start, before = self._since
        self.rate = (step["done"] - before) / (now - start) if now > start else 0.0
        self.stage, self.done, self.total, self.unit = (step[name] for name in ("stage", "done", "total", "unit"))

    @staticmethod
    def _collect(stream: Any, take: Any) -> None:
        with stream:
            for line in stream:
                take(line)
