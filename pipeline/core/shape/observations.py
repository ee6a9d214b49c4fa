"""The pictures of a capture rearranged by pixel: one row of cube roots per pixel, bad values left out."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..capture import Capture
from ..errors import LightsphereError
from ..progress import Progress, Work
from .lobe import HALF_STEP

BAD_SHARE = 0.5  # a picture with more unusable pixels than this is damaged, not noisy
CLIPPED_PIXELS = 4  # this many pixels with exactly the largest value of the capture are saturated, not bright
FEW_DISTINCT = 0.02  # share of distinct values below which pictures are quantised
DARK_DEVIATIONS = 3.0  # values below this many deviations of the noise floor count as unlit
NOISE_SAMPLE = 3_000_000  # single colours looked at to estimate the noise floor
UNFORESEEN = 0.02  # of the 90th percentile: how far bounced light strays from its model
PLAUSIBLE = 0.5  # of the median: noise is densest at 0, its tenth percentile .19; marks of broken values are all alike
BRIGHT_SHARE = 0.05  # in direct light more values than this are attached or cast shadow
COARSE = 16.0  # steps that the median lit value has at most where quantisation hides what is lit
PREVIEW = 32  # pictures from which that is judged
SMALLEST = 1e-7  # values below this share of the largest count as unlit: the rounding of half floats


@dataclass(frozen=True)
class Observations:
    """What P pixels saw of L lights.

    Parameters
    ----------
    values : (P, L) float32
        Cube root of the picture's value over the light's intensity, mean of the colours; 0 where the pixel is unlit,
        saturated or not a number. Of coarsely quantised pictures the brightest colour, and minus the root of half a
        step where that was rounded to 0.
    floor : float
        Standard deviation of the noise that does not depend on the value, in value over intensity.
    bounced : bool
        Whether the pictures hold light that other surfaces sent on.
    clipped, bad : (P,) int32
        How many of a pixel's values were saturated, and how many not numbers.
    """

    values: NDArray[np.float32]
    floor: float
    bounced: bool
    clipped: NDArray[np.int32]
    bad: NDArray[np.int32]


def observe(capture: Capture, mask: NDArray[np.bool_], memory: float) -> Work[Observations]:
    """Read every picture once and rearrange it by pixel.

    Parameters
    ----------
    capture : Capture
    mask : (H, W) bool
        The P pixels to keep.
    memory : float
        Above this many MB the values live in an unnamed file beside the system's temporary files.

    Raises
    ------
    LightsphereError
        When a picture is missing, damaged, or mostly not numbers.
    """
    pixels, lights = int(mask.sum()), len(capture)
    values = _allocate(pixels, lights, memory)
    step = coarse_step(capture, mask)
    largest = np.zeros(lights)
    sample: list[NDArray[np.float32]] = []
    stride = max(1, pixels * lights * 3 // NOISE_SAMPLE)
    bad = np.zeros(pixels, np.int32)
    for light in range(lights):
        seen = capture.image(light)[mask]
        usable = np.isfinite(seen).all(axis=1)
        if not usable.mean() >= BAD_SHARE:
            path = capture.folder / capture.files[light]
            raise LightsphereError(
                f"{path}: {100 * (1 - usable.mean()):.0f} % of the object's pixels are not numbers; render it again"
            )
        bad += ~usable
        relative = _over_intensity(seen, capture.lights.intensity[light])
        # The mean of colours that are rounded apart has no even steps; rounding keeps the brightest the brightest.
        values[:, light] = np.where(usable, relative.max(axis=1) if step else relative.mean(axis=1), -np.inf)
        sample.append(relative[usable][::stride].ravel())
        largest[light] = float(seen[usable].max())
        yield Progress("read", light + 1, lights, "pictures")
    clipped = yield from _drop_clipped(capture, mask, values, largest)
    seen_values = np.concatenate(sample)
    floor = noise_floor(seen_values)
    if step:
        floor = step / np.sqrt(12.0) / float(np.median(capture.lights.intensity.max(axis=1)))
    elif not quantisation_step(seen_values):  # independent in the three colours, of which the mean is taken
        floor /= np.sqrt(3.0)
    _to_roots(values, floor, step > 0)
    return Observations(values, floor, _holds_bounced_light(capture, values), clipped, bad)


def _allocate(pixels: int, lights: int, memory: float) -> NDArray[np.float32]:
    if pixels * lights * 4 <= memory * 2**20:
        return np.empty((pixels, lights), np.float32)
    with tempfile.TemporaryFile() as file:  # the mapping keeps it; a name to open again would fail on Windows
        return np.memmap(file, np.float32, "w+", shape=(pixels, lights))


def _over_intensity(seen: NDArray[np.float32], intensity: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return value over intensity of the colours that the light has, (P, 1 to 3)."""
    colours = np.flatnonzero(intensity > 0)
    return np.asarray(seen[:, colours] / intensity[colours], np.float32)


def _drop_clipped(
    capture: Capture, mask: NDArray[np.bool_], values: NDArray[np.float32], largest: NDArray[np.float64]
) -> Work[NDArray[np.int32]]:
    """Mark saturated values as unusable; a capture is saturated where many pixels share its largest value exactly."""
    clipped = np.zeros(len(values), np.int32)
    limit = float(capture.notes.get("saturation", largest.max()))
    lights = np.flatnonzero(largest >= limit)
    found = []
    for light in lights:
        seen = capture.image(int(light))[mask]
        found.append((light, (seen >= limit).any(axis=1)))
        yield Progress("read", len(capture), len(capture), "pictures")
    if "saturation" in capture.notes or sum(int(hit.sum()) for _, hit in found) >= CLIPPED_PIXELS:
        for light, hit in found:
            values[hit, light] = -np.inf
            clipped += hit
    return clipped


def quantisation_step(sample: NDArray[np.float32]) -> float:
    """Return the spacing of values (N,) of which few are distinct, 0 where they are not quantised."""
    positive = np.sort(sample[sample > 0]).astype(np.float64)
    if positive.size == 0:
        return 0.0
    distinct = positive[np.flatnonzero(np.diff(positive, prepend=0.0) > 1e-4 * positive[0])]
    if distinct.size > FEW_DISTINCT * positive.size:
        return 0.0
    return float(np.min(np.diff(distinct, prepend=0.0)))


def coarse_step(capture: Capture, mask: NDArray[np.bool_]) -> float:
    """Return the step of pictures so coarsely quantised that they hide what is lit, 0 for others, by a few of them."""
    few = np.unique(np.linspace(0, len(capture) - 1, PREVIEW).astype(int))
    sample = np.concatenate([capture.image(int(light))[mask].ravel() for light in few])
    sample = sample[np.isfinite(sample)]
    step = quantisation_step(sample)
    return step if step and float(np.median(sample[sample > 0])) < COARSE * step else 0.0


def noise_floor(sample: NDArray[np.float32]) -> float:
    """Estimate the standard deviation of the value-independent noise from the darkest values.

    Parameters
    ----------
    sample : (N,) float32
        Value over intensity of single colours; attached shadow makes a good part of them dark.

    Returns
    -------
    floor : float
        Where the values are quantised, step / sqrt(12). Otherwise from the negative values, or, where noise was cut
        off at 0, from as many of the smallest positive values as there are zeros. 0 for pictures without such noise.

    Not modelled: noise that differs between pictures.
    """
    step = quantisation_step(sample)
    if step:
        return step / float(np.sqrt(12.0))
    positive = np.sort(sample[sample > 0]).astype(np.float64)
    if positive.size == 0:
        return 0.0
    usual = float(np.quantile(sample, 0.9))
    zeros = int((sample == 0).sum())
    negative = -sample[sample < 0]
    if negative.size > 0.02 * sample.size:
        usual_negative = float(np.median(negative))
        if float(np.quantile(negative, 0.1)) < PLAUSIBLE * usual_negative:
            return 1.4826 * usual_negative
    # As many values as were cut off lie above 0; in pictures without noise so few small ones spread out widely.
    spread = 1.4826 * float(np.median(positive[: max(1, min(zeros, positive.size))]))
    return spread if zeros > 0.05 * sample.size and spread < 0.02 * usual else 0.0


def _holds_bounced_light(capture: Capture, values: NDArray[np.float32]) -> bool:
    """Return whether light bounced: as the renderer wrote down, or else because hardly any value is dark."""
    bounces = capture.notes.get("transport", {}).get("bounces")
    if bounces is not None:
        return int(bounces) > 0
    return float((values[:: max(1, len(values) // 4096)] <= 0.0).mean()) < BRIGHT_SHARE


def noise_of(observations: Observations, rows: int = 8192) -> NDArray[np.float64]:
    """Return the standard deviation that each pixel's values have beside their model, (P,), in value over intensity.

    Bounced light, where there is any, cannot be foreseen to better than a share of the pixel's brighter values.
    """
    noise = np.full(len(observations.values), observations.floor)
    if observations.bounced:
        for start in range(0, len(noise), rows):
            bright = np.quantile(observations.values[start : start + rows], 0.9, axis=1).astype(np.float64) ** 3
            noise[start : start + rows] = np.hypot(observations.floor, UNFORESEEN * bright)
    return noise


def _to_roots(values: NDArray[np.float32], floor: float, coarse: bool, rows: int = 8192) -> None:
    """Turn values into cube roots in place, as in :class:`Observations`."""
    largest = max((float(values[i : i + rows].max()) for i in range(0, len(values), rows)), default=0.0)
    lowest = max(DARK_DEVIATIONS * floor, SMALLEST * largest)
    for start in range(0, len(values), rows):
        part = values[start : start + rows]
        darkest = np.where(part == 0.0, -HALF_STEP * floor if coarse else 0.0, 0.0)
        part[:] = np.cbrt(np.where(part > lowest, part, darkest))
