"""Small pictures of a scene with some effects of light on and others off, and how far they are apart, by group.

A group is what the object's pixels of one material are: leaving an effect out may spare most of a scene and spoil one
surface.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core.camera import Camera
from ...core.capture_settings import PlanSettings
from ...core.lights import Lights
from ...core.progress import Progress, Work
from ...core.tradeoff.thinning import evenly
from .. import cycles, truth
from ..camera import camera_of
from ..olat import pictures

SMALLEST = 1e-300
SEEDS = (7919, 104729)  # of a trial's two halves; a capture's own seed is another


@dataclass(frozen=True)
class Trial:
    """Pictures by some light paths, each rendered twice with different seeds.

    Parameters
    ----------
    pictures : (2, S, H, W, 3) float64
        Under S lights.
    seconds : float
        A picture, the median.
    size : int
        Samples of a picture, all pixels together.
    """

    pictures: NDArray[np.float64]
    seconds: float
    size: int


@dataclass(frozen=True)
class Groups:
    """The pixels by which pictures are compared.

    Parameters
    ----------
    names : dict of int to str
        Of the groups.
    index : (S, H, W) or (1, H, W) int
        The group of a pixel, 0 for none.
    """

    names: dict[int, str]
    index: NDArray[np.int64]


@dataclass(frozen=True)
class Difference:
    """How far two trials are apart in one group, relative to the first.

    Parameters
    ----------
    group : str
    share : float
        The relative change of the group's light, or the relative root mean square difference of its pixels: of the
        two the one that may be larger.
    deviation : float
        What noise may have done to that figure, one standard deviation.
    """

    group: str
    share: float
    deviation: float

    @property
    def bound(self) -> float:
        """What the difference may well be."""
        return self.share + self.deviation


def differences(whole: Trial, part: Trial, groups: Groups) -> list[Difference]:
    """Return how far a part of the light is from the whole, in every group that some light reaches.

    Seeds are the same in both trials and differ between the halves, so that the product of the two halves'
    differences holds no noise on average: E[(a1 - b1)(a2 - b2)] = (a - b)^2.
    """
    index = np.broadcast_to(groups.index, whole.pictures.shape[1:4])
    lost = whole.pictures - part.pictures
    found = []
    for number, name in groups.names.items():
        of_group = index == number
        if (whole.pictures[:, of_group] > 0).any():
            found.append(_difference(name, of_group, lost, whole.pictures))
    return found


def _difference(
    name: str, pixels: NDArray[np.bool_], lost: NDArray[np.float64], whole: NDArray[np.float64]
) -> Difference:
    light = max(float(whole[:, pixels].sum()) / 2, SMALLEST)
    sums = np.stack([lost[:, i, pixels[i]].sum(axis=(1, 2)) for i in range(len(pixels))])
    change = abs(float(sums.sum())) / 2 / light
    of_light = Difference(name, change, float(np.sqrt((np.diff(sums) ** 2).sum())) / 2 / light)
    first, second = lost[:, pixels]
    power = max(float((whole[0, pixels] * whole[1, pixels]).sum()), SMALLEST)
    noise = (first - second) ** 2 / 2
    squared = max(float((first * second).sum()), 0.0)
    # Of one normal variable's square the square is thrice the variance squared.
    deviation = float(np.sqrt((noise**2 / 3 + 2 * noise * np.maximum(first * second, 0)).sum()))
    share = (squared / power) ** 0.5
    of_pixels = Difference(name, share, ((squared + deviation) / power) ** 0.5 - share)
    return worst([of_light, of_pixels])


def worst(found: list[Difference]) -> Difference:
    """Return the difference that may be the largest."""
    return max(found, key=lambda one: one.bound, default=Difference("", 0.0, 0.0))


class Probe:
    """Trials of a scene under a few lights of a rig, or under its own light; counts them."""

    def __init__(self, scene: bpy.types.Scene, lights: Lights | None, settings: PlanSettings, expected: int) -> None:
        self._scene, self._lights, self._expected, self._done = scene, lights, expected, 0
        self._index = evenly(len(lights), settings.probes) if lights is not None else np.zeros(1, np.int64)
        self._camera = _small(scene, settings.probe_resolution, square=lights is not None)
        self.hits = truth.first_hits(scene, self._camera)
        index = np.where(self.hits.is_object | (lights is None), self.hits.material, 0)
        self.groups = Groups(self.hits.names, index[None])

    def trial(self, transport: cycles.Transport, shadows: bool = True) -> Work[Trial]:
        """Render the probe's lights by some light paths, with two seeds."""
        halves, times = [], []
        for seed in SEEDS:
            start = time.perf_counter()
            found = []
            for picture in pictures(self._scene, self._camera, transport, self._lights, self._index, seed, shadows):
                found.append(picture.astype(np.float64))
                times.append(time.perf_counter() - start)
                start = time.perf_counter()
            halves.append(np.stack(found))
        self._done += 1
        yield Progress("plan", min(self._done, self._expected), self._expected, "trials")
        return Trial(np.stack(halves), float(np.median(times)), self._pixels * transport.samples)

    def end(self) -> Progress:
        """Return the last step, however many trials it took."""
        return Progress("plan", self._expected, self._expected, "trials")

    def loss(self, whole: Trial, part: Trial) -> Difference:
        """Return how far a part of the light is from the whole in the group where it may be furthest."""
        return worst(differences(whole, part, self.groups))

    def fall_off(self) -> Difference:
        """Return how far distant lights, as bright in the object's middle, are from the probe's near ones."""
        assert self._lights is not None
        points = self.hits.position[self.hits.is_object].astype(np.float64)
        lights = self._lights.position[self._index, None]
        middle = ((lights - points.mean(axis=0)) ** 2).sum(axis=-1)
        ratio = middle / ((lights - points) ** 2).sum(axis=-1)
        return Difference("", float(np.sqrt(((1 - ratio) ** 2).mean() / (ratio**2).mean())), 0.0)

    @property
    def _pixels(self) -> int:
        width, height = self._camera.resolution
        return width * height


def _small(scene: bpy.types.Scene, side: int, square: bool) -> Camera:
    """Return the scene's camera for pictures whose longer side is given, in a capture's shape or the scene's."""
    if square:
        return camera_of(scene, side)
    width, height = scene.render.resolution_x, scene.render.resolution_y
    longer = max(width, height)
    return camera_of(scene, max(1, round(side * width / longer)), max(1, round(side * height / longer)))
