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

SAMPLES = (2, 8, 32)  # of the trial pictures
TRIED_SHARE, TRIED = 0.04, (8, 16)  # of the lights, under which trials are rendered; fewest and most
FALLS = (0.25, 0.5)  # by what power of the samples noise falls: 1/2, but slower where few paths find the light
TINY = 1e-12
SEED = 86028121  # neither a capture's, the probe's nor the audit's
STEPS, DOUBLINGS = 4, 16  # numbers of samples that are considered in a doubling, and doublings
CHECKED_SHARE, CHECKED = 0.02, (6, 12)  # of the pictures that are rendered better in the end; fewest and most
BETTER = 4  # times the samples
ERROR = "picture_rel_mae"


@dataclass(frozen=True)
class Cost:
    """What noise and pictures cost.

    Parameters
    ----------
    noise, fall : float
        Mean error of pictures of one sample, relative to their light; with more it falls by that power of them.
    start, sample : float
        Seconds that a picture takes by itself, and for every sample, with all threads.
    """

    noise: float
    fall: float
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
        With the setting ``samples``. The error is the mean one of object pixels, relative to their light: noise,
        and what is missing. Not modelled: light that few paths find, which trials of few samples may miss.
    """
    bounces = planned.notes["transport"]["bounces"]
    numbers = sorted({round(2 ** (k / STEPS)) for k in range(STEPS * DOUBLINGS + 1)}) if bounces else [1]
    audited = 0.0
    if bounces and planned.notes["settings"]["effects"] == "auto":
        audited = cost.seconds(round(SAMPLES_OF_AUDIT * SIDE**2), 2 * LIGHTS_OF_AUDIT, 1)
    trials = []
    for samples in numbers:
        error = float(np.hypot(missing, cost.noise / samples**cost.fall))
        seconds = cost.seconds(samples, len(planned), processes) + audited
        if bounces:
            seconds += cost.seconds(BETTER * samples, _share_of(planned, CHECKED_SHARE, CHECKED), 1)
        trials.append(Trial(f"{samples} samples", {"samples": samples}, seconds, {ERROR: error}))
    return choose(trials, goal)


def obtained(scene: bpy.types.Scene, capture: Capture, missing: float) -> Work[dict[str, float]]:
    """Return the error of a finished capture: a few pictures are rendered again, better and with another seed."""
    transport = cycles.Transport(**capture.notes["transport"])
    if not transport.bounces:
        return {ERROR: missing}
    chosen = evenly(len(capture), _share_of(capture, CHECKED_SHARE, CHECKED))
    mask = capture.mask()
    captured = [capture.image(int(light))[mask] for light in chosen]
    transport = dataclasses.replace(transport, samples=BETTER * transport.samples)
    again = []
    for picture in pictures(scene, capture.camera, transport, capture.lights, chosen, SEED):
        again.append(picture[mask])
        yield Progress("check", len(again), len(chosen), "pictures")
    return {ERROR: float(np.hypot(missing, _noise(captured, again, BETTER)))}


def measured(scene: bpy.types.Scene, planned: Capture) -> Work[Cost]:
    """Measure noise and time in a few pictures of a planned capture, whose mask is on disk."""
    transport = cycles.Transport(**planned.notes["transport"])
    chosen = [int(light) for light in evenly(len(planned), _share_of(planned, TRIED_SHARE, TRIED))]
    mask = planned.mask()
    found, seconds = [], []
    for seed, samples in enumerate(SAMPLES if transport.bounces else (1,)):
        paths = dataclasses.replace(transport, samples=samples)
        taken, own = _timed(pictures(scene, planned.camera, paths, planned.lights, [chosen[0], *chosen], SEED + seed))
        found.append([picture[mask] for picture in own[1:]])
        seconds.append(taken)
        yield Progress("samples", len(seconds), len(SAMPLES), "trials")
    if not transport.bounces:
        return Cost(0.0, 0.0, seconds[0], 0.0)
    few, more, many = SAMPLES
    noise = [_noise(pictures, found[2], many / samples) for pictures, samples in zip(found, (few, more), strict=False)]
    fall = np.log(max(noise[0], TINY) / max(noise[1], TINY)) / np.log(more / few)
    fall = float(np.clip(fall, *FALLS))
    sample = max((seconds[2] - seconds[0]) / (many - few), 0.0)
    return Cost(noise[1] * more**fall, fall, max(seconds[0] - few * sample, 0.0), sample)


def _timed(made: Iterator[NDArray[np.float32]]) -> tuple[float, list[NDArray[np.float32]]]:
    """Return the seconds that pictures after the first take on average, and the pictures."""
    found = [next(made)]  # the scene is read for it
    start = time.perf_counter()
    found += made
    return (time.perf_counter() - start) / (len(found) - 1), found


def _noise(pictures: Sequence[NDArray[np.float32]], better: Sequence[NDArray[np.float32]], times: float) -> float:
    """Return the mean error of pictures relative to their light, by others of so many times the samples.

    It is the mean of absolute errors: of squared ones it would be that of the few pixels that are too bright by chance.
    The others' own noise is taken off as if it were normal.
    """
    lost = sum(float(abs(a.astype(np.float64) - b).sum()) for a, b in zip(pictures, better, strict=True))
    light = sum(float(b.sum(dtype=np.float64)) for b in better)
    return lost / light / float(np.sqrt(1 + 1 / times)) if light > 0 else 0.0


def _share_of(capture: Capture, share: float, limits: tuple[int, int]) -> int:
    """Return how many pictures a share is, within limits."""
    return min(max(limits[0], min(limits[1], round(share * len(capture)))), len(capture))
