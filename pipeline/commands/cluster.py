"""Samples made by the workers of a Dask cluster, which see the dataset's folder under the same path.

Every thread of a Dask worker keeps one process of ours, as Blender wants its own, and gives it one sample at a time.
What Dask loses - a worker, the scheduler with all that it knew - is handed in again; a sample that was made twice is
in the output once, for its files are moved into place whole (:func:`pipeline.core.dataset.folder.commit`).
"""

from __future__ import annotations

import logging
import os
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from pathlib import Path
from typing import Any

from ..core.dataset.farm import Attempts, Outcome
from ..core.dataset.folder import finished_list
from ..core.errors import LightsphereError
from ..core.workers import Died, Worker

PATIENCE = 300.0  # seconds without a scheduler or a worker after which to give up
ANSWER = 30.0  # seconds for the scheduler to say what became of a sample that has ended
PAUSE = 0.2
ROUND = 2000  # samples handed in at once: the scheduler's memory stays bounded
_LOST = (OSError, RuntimeError, TimeoutError, CancelledError)  # what Dask's client raises when its scheduler is gone
_kept = threading.local()


class Cluster:
    """Workers of a Dask cluster; see :class:`pipeline.core.dataset.farm.Farm`, whose place it takes.

    Parameters
    ----------
    address : str
        Of the scheduler.
    folder : Path
        Of the dataset, as the workers see it.
    device : str
    samples : sequence of int
    """

    def __init__(self, address: str, folder: Path, device: str, samples: Sequence[int]) -> None:
        self._address, self._folder, self._device = address, folder, device
        self._pending = list(reversed(samples))
        self._attempts = Attempts()
        self._futures: dict[Any, int] = {}
        self._client: Any = None
        self._number = 0

    def __enter__(self) -> Cluster:
        self._connect()
        print(f"cluster: {self._client.dashboard_link} shows its work", file=sys.stderr)
        return self

    def __exit__(self, *error: object) -> None:
        self._close()

    def outcomes(self) -> Iterator[Outcome]:
        """Yield what became of every sample, as it becomes known.

        Raises
        ------
        LightsphereError
            When no scheduler or worker is there for a while.
        """
        last = time.monotonic()
        while self._pending or self._futures:
            try:
                self._hand_in()
                finished = [future for future in self._futures if future.done()]
                lost = self._client.status != "running"
            except _LOST:
                finished, lost = [], True
            for future in finished:
                try:
                    outcome = self._judged(future, self._futures[future])
                except _LOST:  # the scheduler went between the end of the sample and its word about it
                    lost = True
                    break
                index = self._futures.pop(future)
                if outcome is None:
                    self._pending.append(index)
                    continue
                last = time.monotonic()
                yield outcome
            if lost:
                self._again()
            if time.monotonic() - last > PATIENCE and not self._is_at_work():
                raise LightsphereError(
                    f"no worker of {self._address} has finished anything for {PATIENCE:.0f} s and none is there; start "
                    "workers, then go on by --resume"
                )
            if not finished:
                time.sleep(PAUSE)

    def _hand_in(self) -> None:
        while self._pending and len(self._futures) < ROUND:
            index = self._pending[-1]
            self._number += 1
            key = f"sample-{index}-{self._number}-{os.getpid()}"
            words = (str(self._folder), index, self._device)
            self._futures[self._client.submit(make_sample, *words, key=key, pure=False)] = index
            self._pending.pop()

    def _judged(self, future: Any, index: int) -> Outcome | None:
        """Return what became of a sample, None where it must be made again."""
        if future.status == "finished":
            kind, words, status = future.result(timeout=ANSWER)
            if kind == "died":
                reason = self._attempts.reason(index, Died(status, words))
                return Outcome(index, reason) if reason else None
            return Outcome(index, words)
        if finished_list(self._folder, index).is_file():
            return Outcome(index)
        if future.status == "error":  # Dask lost so many workers over it that it gave it up
            reason = self._attempts.reason(index, Died(-9, str(future.exception())))
            return Outcome(index, reason) if reason else None
        return None

    def _again(self) -> None:
        """Connect anew, and hand in again what the scheduler may have forgotten."""
        self._pending += reversed(self._futures.values())
        self._futures.clear()
        self._close()
        self._connect()

    def _connect(self) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise LightsphereError("--scheduler needs Dask; install it: pip install 'lightsphere[dataset]'") from error
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what it loses is handed in again here
        try:
            self._client = Client(self._address, timeout=PATIENCE)
        except (OSError, ValueError, TimeoutError) as error:
            raise LightsphereError(
                f"no Dask scheduler answers at {self._address} ({error}); start one, then go on by --resume"
            ) from error

    def _close(self) -> None:
        if self._client is not None:
            self._client.close(timeout=5)
            self._client = None

    def _is_at_work(self) -> bool:
        try:
            return bool(self._client.scheduler_info()["workers"])
        except _LOST:
            return False


def make_sample(folder: str, index: int, device: str) -> tuple[str, str, int]:
    """Make one sample on a Dask worker.

    Returns
    -------
    tuple of str, str, int
        ``("made", "", 0)``; ``("missing", why, 0)``; or ``("died", last words, status)`` of the process.
    """
    if finished_list(Path(folder), index).is_file():  # the scheduler may have asked twice
        return "made", "", 0
    worker: Worker | None = getattr(_kept, "worker", None)
    if worker is None or worker.has_ended:
        words = ("-m", "pipeline", "dataset-worker", folder, "--device", device)
        worker = _kept.worker = Worker((sys.executable, *words), os.environ)
    try:
        worker.ask(index, "sample")
        return "made", "", 0
    except LightsphereError as error:
        return "missing", str(error), 0
    except Died as death:
        worker.close()
        return "died", death.words, death.status
