"""Samples shared out to processes that may die at any moment.

A sample whose process dies is made again by another one, after all others. One that ends its process by itself (a
scene that crashes the renderer) is given up after :data:`CRASHES` times; a process that is killed from outside, as the
system does when memory is short, or an operator, counts for less (:data:`KILLS`). What is wrong with a sample's input
is found the first time.
"""

from __future__ import annotations

import queue
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import LightsphereError
from ..workers import Died, Worker, next_answer

CRASHES, KILLS = 3, 25  # deaths of a sample's process after which it is given up
FROM_OUTSIDE = (-signal.SIGTERM, -getattr(signal, "SIGKILL", 9))
STARTS = 3  # processes in a row that end before they can work: then none will


@dataclass(frozen=True)
class Outcome:
    """What became of a sample: made, or not and why.

    Parameters
    ----------
    index : int
    missing : str
        Why it was not made; ``""`` if it was.
    """

    index: int
    missing: str = ""


class Attempts:
    """How often the process of each sample died."""

    def __init__(self) -> None:
        self._deaths: Counter[tuple[int, bool]] = Counter()

    def reason(self, index: int, death: Died) -> str:
        """Note one more death; return why the sample is given up, ``""`` while it is not."""
        outside = death.status in FROM_OUTSIDE
        self._deaths[index, outside] += 1
        count, most = self._deaths[index, outside], KILLS if outside else CRASHES
        if count < most:
            return ""
        if outside:
            return f"its process was killed {count} times, perhaps for want of memory; run with fewer workers"
        how = f"by signal {-death.status}" if death.status < 0 else f"with status {death.status}"
        words = f": {death.words.splitlines()[-1]}" if death.words else ""
        return f"its process ended {how} each of {count} times{words}; mend the shape or material that it is made of"


class Farm:
    """Processes on this machine that make samples until none is left.

    Parameters
    ----------
    count : int
        Number of processes.
    start : callable
        Starts one, a :class:`.Worker` that answers a sample's number with ``sample``.
    samples : sequence of int
    """

    def __init__(self, count: int, start: Callable[[], Worker], samples: Sequence[int]) -> None:
        self._start = start
        self._pending = deque(samples)
        self._left = len(samples)
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._attempts = Attempts()
        self._lock = threading.Lock()
        self._workers: dict[int, Worker] = {}
        self._stopped = False
        self._threads = [threading.Thread(target=self._tend, args=(i,), daemon=True) for i in range(count)]

    def __enter__(self) -> Farm:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        with self._lock:
            self._stopped = True
            for worker in self._workers.values():
                worker.kill()
        for thread in self._threads:
            thread.join()

    @property
    def pids(self) -> list[int]:
        """Numbers of the processes at work."""
        with self._lock:
            return [worker.pid for worker in self._workers.values() if not worker.has_ended]

    def outcomes(self) -> Iterator[Outcome]:
        """Yield what became of every sample, as it becomes known.

        Raises
        ------
        RuntimeError
            When processes end before they can work, with the last words of one.
        """
        while self._left:
            outcome: Outcome = next_answer(self._answers)
            self._left -= 1
            yield outcome

    def _tend(self, place: int) -> None:
        """Keep one process at work."""
        failures: Counter[bool] = Counter()
        while (worker := self._new_worker(place)) is not None:
            try:
                worker.wait_until_ready()
                failures.clear()
                self._feed(worker)
            except Died as death:
                outside = death.status in FROM_OUTSIDE
                failures[outside] += 1
                if failures[outside] >= (KILLS if outside else STARTS) and not self._stopped:
                    self._answers.put(RuntimeError(f"workers end before they can work: {death}"))
                    return
            except Exception as error:  # a bug here must not leave the main thread waiting
                self._answers.put(error)
                return
            finally:
                worker.kill()
                worker.close()

    def _feed(self, worker: Worker) -> None:
        """Give a process samples until it dies or all of them are done."""
        while self._left and not self._stopped:
            try:
                index = self._pending.popleft()
            except IndexError:
                time.sleep(0.05)  # another one's sample may come back
                continue
            try:
                worker.ask(index, "sample")
                self._answers.put(Outcome(index))
            except LightsphereError as error:
                self._answers.put(Outcome(index, str(error)))
            except Died as death:
                if self._stopped:
                    return
                with self._lock:
                    reason = self._attempts.reason(index, death)
                if reason:
                    self._answers.put(Outcome(index, reason))
                else:
                    self._pending.append(index)
                return

    def _new_worker(self, place: int) -> Worker | None:
        """Start the process of a place, unless nothing is left to do."""
        with self._lock:
            if self._stopped or not self._left:
                return None
            self._workers[place] = worker = self._start()
            return worker
