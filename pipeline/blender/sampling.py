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
from . import cycles, truth
from .camera import camera_of
from .olat import pictures
from .plan import audit
from .plan.audit import window_around

TIMED_LIGHTS, TIMED_SAMPLES = 4, (1, 9)  # of the pictures that are timed
LIGHTS = 48  # under which noise is measured: it differs between lights by more than ten times
SAMPLES, SIDE = (2, 8, 32), 40  # of the pictures in which it is, and their width [px]: it does not depend on that
FALLS = (0.25, 0.5)  # by what power of the samples noise falls: 1/2, but slower where few paths find the light
TINY = 1e-12
SEED = 86028121  # neither a capture's, the probe's nor the audit's
STEPS, DOUBLINGS = 4, 12  # numbers of samples that are considered in a doubling, and doublings
WINDOWS, WINDOW_SIDE = 3, 1 / 4  # parts of finished pictures that are rendered better, of the pictures' side
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

    def seconds(self, samples: float, count: float, processes: int) -> float:
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
    audited = bounces and planned.notes["settings"]["effects"] == "auto"
    trials = []
    for samples in numbers:
        error = float(np.hypot(missing, cost.noise / samples**cost.fall))
        seconds = cost.seconds(samples, len(planned), processes)
        if bounces:
            seconds += cost.seconds(BETTER * samples * WINDOW_SIDE**2, min(LIGHTS, len(planned)), 1)
        if audited:
            seconds += cost.seconds(audit.SAMPLES * audit.SIDE**2, 2 * audit.LIGHTS, 1)
        trials.append(Trial(f"{samples} samples", {"samples": samples}, seconds, {ERROR: error}))
    chosen = choose(trials, goal)
    doublings = [trial for trial in trials if np.log2(trial.settings["samples"]).is_integer()]
    return dataclasses.replace(chosen, trials=doublings)


def obtained(scene: bpy.types.Scene, capture: Capture, missing: float) -> Work[dict[str, float]]:
    """Return the error of a finished capture: parts of many pictures are rendered again, better and by another seed."""
    transport = cycles.Transport(**capture.notes["transport"])
    if not transport.bounces:
        return {ERROR: missing}
    transport = dataclasses.replace(transport, samples=BETTER * transport.samples)
    chosen, mask = evenly(len(capture), LIGHTS), capture.mask()
    rng = np.random.default_rng(capture.notes["settings"]["seed"])
    captured, again = [], []
    for number in range(WINDOWS):
        window, own = window_around(mask, rng, WINDOW_SIDE), chosen[number::WINDOWS]
        made = pictures(scene, capture.camera, transport, capture.lights, own, SEED, window=window)
        for light, picture in zip(own, made, strict=True):
            shown = mask[window]
            captured.append(capture.image(int(light))[window][shown])
            again.append(picture[shown])
            yield Progress("check", len(again), len(chosen), "windows")
    return {ERROR: float(np.hypot(missing, _noise(captured, again, BETTER)))}


def measured(scene: bpy.types.Scene, planned: Capture) -> Work[Cost]:
    """Measure noise in small pictures under many lights of a planned capture, and time in a few as large as its own."""
    transport = cycles.Transport(**planned.notes["transport"])
    samples = TIMED_SAMPLES if transport.bounces else (1,)
    timed = [int(light) for light in evenly(len(planned), TIMED_LIGHTS)]
    seconds = []
    for number in samples:
        paths = dataclasses.replace(transport, samples=number)
        made = pictures(scene, planned.camera, paths, planned.lights, [timed[0], *timed], SEED)
        seconds.append(_timed(made))
        yield Progress("time", len(seconds), len(samples), "trials")
    if not transport.bounces:
        return Cost(0.0, 0.0, seconds[0], 0.0)
    noise = yield from _noises(scene, planned, transport)
    fall = np.log(max(noise[0], TINY) / max(noise[1], TINY)) / np.log(SAMPLES[1] / SAMPLES[0])
    fall = float(np.clip(fall, *FALLS))
    sample = max((seconds[1] - seconds[0]) / (samples[1] - samples[0]), 0.0)
    return Cost(noise[1] * SAMPLES[1] ** fall, fall, max(seconds[0] - samples[0] * sample, 0.0), sample)


def _noises(scene: bpy.types.Scene, planned: Capture, transport: cycles.Transport) -> Work[list[float]]:
    """Return the noise of the first two of :data:`SAMPLES`, by the third."""
    camera = camera_of(scene, min(SIDE, planned.camera.resolution[0]))
    mask, lights, found = truth.object_mask(scene, camera), evenly(len(planned), LIGHTS), []
    for seed, samples in enumerate(SAMPLES):
        paths = dataclasses.replace(transport, samples=samples)
        found.append([])
        for picture in pictures(scene, camera, paths, planned.lights, lights, SEED + seed):
            found[-1].append(picture[mask])
            yield Progress("noise", sum(map(len, found)), len(SAMPLES) * len(lights), "pictures")
    pairs = zip(found[:2], SAMPLES[:2], strict=True)
    return [_noise(pictures, found[2], SAMPLES[2] / samples) for pictures, samples in pairs]


def _timed(made: Iterator[NDArray[np.float32]]) -> float:
    """Return the seconds that pictures after the first take on average."""
    next(made)  # the scene is read for it
    start = time.perf_counter()
    count = sum(1 for _ in made)
    return (time.perf_counter() - start) / count


def _noise(pictures: Sequence[NDArray[np.float32]], better: Sequence[NDArray[np.float32]], times: float) -> float:
    """Return the mean error of pictures relative to their light, by others of so many times the samples.

    It is the mean of absolute errors: of squared ones it would be that of the few pixels that are too bright by chance.
    The others' own noise is taken off as if it were normal.
    """
    lost = sum(float(abs(a.astype(np.float64) - b).sum()) for a, b in zip(pictures, better, strict=True))
    light = sum(float(b.sum(dtype=np.float64)) for b in better)
    return lost / light / float(np.sqrt(1 + 1 / times)) if light > 0 else 0.0
