"""Samples on a cluster whose scheduler breaks off at any word: a stand-in for Dask's client that fails at random."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.commands import cluster


class Fragile:
    """A client and its futures; every word to it may find the connection closed."""

    def __init__(self, random: np.random.Generator, made: list[int]) -> None:
        self._random, self._made = random, made
        self.status = "running"

    def _word(self) -> None:
        if self.status != "running" or self._random.random() < 0.1:
            self.status = "closed"
            raise OSError("Stream is closed")

    def submit(self, _: Any, folder: str, index: int, device: str, *, key: str, pure: bool) -> Future:
        self._word()
        return Future(self, index)

    def scheduler_info(self) -> dict[str, Any]:
        self._word()
        return {"workers": {"one": {}}}

    def close(self, timeout: float) -> None:
        self.status = "closed"


class Future:
    status = "finished"

    def __init__(self, client: Fragile, index: int) -> None:
        self._client, self._index = client, index

    def done(self) -> bool:
        return bool(self._client._random.random() < 0.5)

    def result(self, timeout: float) -> tuple[str, str, int]:
        self._client._word()
        self._client._made.append(self._index)
        return "made", "", 0


@pytest.mark.parametrize("seed", range(20))
def test_every_sample_has_one_outcome_whenever_the_scheduler_goes(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    random, made = np.random.default_rng(seed), list[int]()
    clients = list[Fragile]()

    def connect(self: cluster.Cluster) -> None:
        clients.append(Fragile(random, made))
        self._client = clients[-1]

    monkeypatch.setattr(cluster.Cluster, "_connect", connect)
    monkeypatch.setattr(cluster, "PAUSE", 0.0)
    farm = cluster.Cluster("tcp://nowhere:1", tmp_path, "cpu", range(30))
    farm._connect()
    outcomes = list(farm.outcomes())
    assert sorted(outcome.index for outcome in outcomes) == list(range(30))
    assert not any(outcome.missing for outcome in outcomes)
    assert sorted(made) == list(range(30))
    assert len(clients) > 1  # else nothing was disturbed
