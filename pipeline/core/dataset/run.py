"""A dataset from begin to end: what is missing is made by whoever makes samples, listed, packed and described."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.optimize import nnls

from ..errors import LightsphereError
from ..progress import Progress, Work
from . import folder as dataset
from . import shards
from .draw import Sample, draw, lights_count
from .farm import Outcome
from .recipe import SHARDS, Recipe

BYTES = {"half": 2, "float": 4}
TRIED = 6  # samples that a forecast makes at least


class Crew(Protocol):
    """Whoever makes samples."""

    def outcomes(self) -> Iterator[Outcome]:
        """Yield what became of every sample, as it becomes known."""


#: Takes on a crew for some samples.
Hire = Callable[[Sequence[int]], AbstractContextManager[Crew]]


@dataclass(frozen=True)
class Made:
    """What a run made.

    Parameters
    ----------
    samples : list of Sample
        All that are there, those of earlier runs, too.
    new : int
        How many of them this run made.
    missing : dict of int to str
        Why others are not there.
    shared : list of Path
        Files of many samples.
    """

    samples: list[Sample]
    new: int
    missing: dict[int, str]
    shared: list[Path]


def make(folder: Path, recipe: Recipe, chosen: Sequence[int], hire: Hire) -> Work[Made]:
    """Make those of the chosen samples of a begun dataset that are not there or not whole; list all that are there.

    Raises
    ------
    LightsphereError
        When the disk is full; what is finished is kept.
    """
    dataset.remove_partial(folder)
    wanted = yield from dataset.to_make(folder, chosen)
    missing: dict[int, str] = {}
    there = len(chosen) - len(wanted)
    if wanted:
        with hire(wanted) as crew:
            for outcome in crew.outcomes():
                if outcome.missing:
                    _check_disk(folder, recipe, outcome, there)
                    missing[outcome.index] = outcome.missing
                else:
                    there += 1
                yield Progress("make", there + len(missing), len(chosen), "samples")
        dataset.remove_partial(folder)
    found = (index for index in range(recipe.count) if dataset.finished_list(folder, index).is_file())
    samples = [draw(recipe, index) for index in found if index not in missing]
    dataset.write_manifest(folder, samples, missing)
    packed = []
    if SHARDS in recipe.output.formats:
        packed = yield from shards.write(folder, samples, recipe.output.shard)
    return Made(samples, len(wanted) - len(missing), missing, packed)


@dataclass(frozen=True)
class Forecast:
    """What a dataset is expected to take.

    Parameters
    ----------
    renders : int
        Pictures, exactly.
    seconds : float
        Of one process, its start left out.
    size : float
        On disk [bytes].
    """

    renders: int
    seconds: float
    size: float


def forecast(
    recipe: Recipe, folder: Path, processes: int, timed: Callable[[Sequence[int]], Iterator[float]]
) -> Work[Forecast]:
    """Foretell a dataset from a few of its samples, which are made in a folder that was begun.

    Time and size of a sample are taken as a fixed part and one for each of its pictures.

    Parameters
    ----------
    processes : int
        That will make it side by side.
    timed : callable
        Makes samples, as many side by side, and yields the seconds that each took, in order.
    """
    pictures = [lights_count(recipe, index) for index in range(recipe.count)]
    even = np.linspace(0, recipe.count - 1, max(TRIED, 2 * processes)).astype(int)
    chosen = [int(index) for index in np.unique(np.argsort(pictures, kind="stable")[even])]
    seconds, sizes = [], []
    for index, took in zip(chosen, timed(chosen), strict=True):
        seconds.append(took)
        sizes.append(_size(folder, recipe, index))
        yield Progress("try", len(seconds), len(chosen), "samples")
    tried = np.array([[1.0, pictures[index]] for index in chosen])
    total = np.array([recipe.count, sum(pictures)], np.float64)
    twice = 1 + recipe.truth.direct
    expected = [float(total @ nnls(tried, np.array(values, np.float64))[0]) for values in (seconds, sizes)]
    return Forecast(twice * sum(pictures), *expected)


def _size(folder: Path, recipe: Recipe, index: int) -> int:
    """Return how much a finished sample takes, in a shard, too, if it is to be in one [bytes]."""
    alone = sum(path.stat().st_size for _, path in dataset.files_of(folder, index))
    return alone + (shards.size_in_shard(folder, index) if SHARDS in recipe.output.formats else 0)


def _check_disk(folder: Path, recipe: Recipe, outcome: Outcome, there: int) -> None:
    """Raise LightsphereError when a sample could not be made because no space is left."""
    sample = draw(recipe, outcome.index)
    largest = 3 * (sample.lights + 8) * recipe.camera.resolution**2 * BYTES[recipe.render.pixel_type]
    if shutil.disk_usage(folder).free < largest:
        raise LightsphereError(
            f"the disk of {folder} is full, {there} of {recipe.count} samples are there ({outcome.missing}); "
            "free space, then go on by --resume"
        )
