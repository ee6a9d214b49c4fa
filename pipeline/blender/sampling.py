"""How many samples a capture's pictures need: what noise one sample leaves, and what it costs."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.capture import Capture
from ..core.progress import Progress, Work
from ..core.tradeoff import Trial
from ..core.tradeoff.goal import Goal, Promise, choose
from ..core.tradeoff.thinning import evenly
from . import cycles
from .olat import pictures
from .plan.audit import LIGHTS as LIGHTS_OF_AUDIT
from .plan.audit import SAMPLES as SAMPLES_OF_AUDIT
from .plan.audit import SIDE

LIGHTS, SAMPLES = 12, 8  # of the trial pictures
SEEDS = (86028121, 67867967)  # neither a capture's, the probe's nor the audit's
STEPS, DOUBLINGS = 4, 16  # numbers of samples that are considered in a doubling, and doublings
CHECKED_SHARE, CHECKED = 0.02, (4, 8)  # of the pictures that are rendered again in the end; fewest and most
ERROR = "picture_rel_rmse"


@dataclass(frozen=True)
class Cost:
    """What noise and pictures cost.

    Parameters
    ----------
    noise : float
        Squared relative RMSE of pictures of one sample.
    start, sample : float
        Seconds that a picture takes by itself, and for every sample, with all threads.
    """

    noise: float
    start: float
    sample: float

    def seconds(self, samples: int, count: float, processes: int) -> float:
        """Return what so many pictures take; what a picture takes by itself is done by the processes side by side."""
        return count * (self.start / processes + self.sample * samples)


def promise(cost: Cost, planned: Capture, goal: Goal, processes: int, missing: float) -> Promise:
    """Choose how many samples the pictures of a planned capture get.

    Parameters
    ----------
    cost : Cost
        Of these pictures.
    planned : Capture
        Its light paths are decided.
    goal : Goal
    processes : int
        That will render.
    missing : float
        What the pictures lack for the effects that are left out, relative.

    Returns
    -------
    Promise
        With the setting ``samples``. The error is the relative RMSE of object pixels over pictures: noise, whose
        square falls with the number of samples, and what is missing. Not modelled: noise that a few very bright
        samples make, which trials of few samples may miss.
    """
    bounces = planned.notes["transport"]["bounces"]
    numbers = sorted({round(2 ** (k / STEPS)) for k in range(STEPS * DOUBLINGS + 1)}) if bounces else [1]
    count = len(planned) + (_checked(planned) if bounces else 0)
    audited = 0.0
    if bounces and planned.notes["settings"]["effects"] == "auto":
        audited = cost.seconds(round(SAMPLES_OF_AUDIT * SIDE**2), 2 * LIGHTS_OF_AUDIT, 1)
    trials = []
    for samples in numbers:
        error = float(np.hypot(missing, np.sqrt(cost.noise / samples)))
        seconds = cost.seconds(samples, count, processes) + audited
        trials.append(Trial(f"{samples} samples", {"samples": samples}, seconds, {ERROR: error}))
    return choose(trials, goal)


def obtained(scene: bpy.types.Scene, capture: Capture, missing: float) -> Work[dict[str, float]]:
    """Return the error of a finished capture: a few pictures are rendered again with another seed."""
    transport = cycles.Transport(**capture.notes["transport"])
    if not transport.bounces:
        return {ERROR: missing}
    chosen = evenly(len(capture), _checked(capture))
    mask = capture.mask()
    captured = [capture.image(int(light))[mask] for light in chosen]
    again = []
    for picture in pictures(scene, capture.camera, transport, capture.lights, chosen, SEEDS[0]):
        again.append(picture[mask])
        yield Progress("check", len(again), len(chosen), "pictures")
    return {ERROR: float(np.hypot(missing, np.sqrt(_noise(captured, again))))}


def measured(scene: bpy.types.Scene, planned: Capture) -> Work[Cost]:
    """Measure noise and time in a few pictures of a planned capture, whose mask is on disk."""
    transport = cycles.Transport(**planned.notes["transport"])
    chosen = [int(light) for light in evenly(len(planned), LIGHTS)]
    mask = planned.mask()
    few = dataclasses.replace(transport, samples=1)
    many = dataclasses.replace(transport, samples=SAMPLES) if transport.bounces else few
    found, seconds = [], []
    for number, (paths, seed) in enumerate(((few, SEEDS[0]), (many, SEEDS[0]), (many, SEEDS[1]))):
        made = pictures(scene, planned.camera, paths, planned.lights, [chosen[0], *chosen], seed)
        taken, own = _timed(made)
        found.append([picture[mask] for picture in own[1:]])
        seconds.append(taken)
        yield Progress("samples", number + 1, 3, "trials")
    sample = max((min(seconds[1:]) - seconds[0]) / (SAMPLES - 1), 0.0) if transport.bounces else 0.0
    noise = SAMPLES * _noise(found[1], found[2]) if transport.bounces else 0.0
    return Cost(noise, max(seconds[0] - sample, 0.0), sample)


def _timed(made: Iterator[NDArray[np.float32]]) -> tuple[float, list[NDArray[np.float32]]]:
    """Return the seconds that pictures after the first take on average, and the pictures."""
    found = [next(made)]  # the scene is read for it
    start = time.perf_counter()
    found += made
    return (time.perf_counter() - start) / (len(found) - 1), found


def _noise(first: Sequence[NDArray[np.float32]], second: Sequence[NDArray[np.float32]]) -> float:
    """Return the squared relative RMSE of pictures, from others of the same light and another seed."""
    squared = power = 0.0
    for a, b in zip(first, second, strict=True):
        squared += float(((a.astype(np.float64) - b) ** 2).sum()) / 2
        power += float((a.astype(np.float64) * b).sum())  # noise has no part in it: the seeds differ
    return squared / power if power > 0 else 0.0


def _checked(capture: Capture) -> int:
    return min(max(CHECKED[0], min(CHECKED[1], round(CHECKED_SHARE * len(capture)))), len(capture))
