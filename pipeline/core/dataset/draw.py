"""One sample of a recipe, drawn from the recipe, its seed and the sample's number alone.

Every quantity has a stream of random numbers of its own, keyed by seed, sample and the quantity's name (Philox:
Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", 2011), so that neither the order of samples
nor another quantity's range changes it. Only uniform numbers are used, whose bits numpy keeps between versions.
"""

from __future__ import annotations

import dataclasses
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import rig
from ..capture_settings import CaptureSettings
from ..lights import Lights
from .recipe import PRINCIPLED, SHAPES, SPLITS, Range, Recipe


class Stream:
    """Uniform random numbers of one quantity of one sample."""

    def __init__(self, seed: int, index: int, name: str) -> None:
        key = np.random.SeedSequence(seed, spawn_key=(index, zlib.crc32(name.encode())))
        self.random = np.random.Generator(np.random.Philox(key))

    def within(self, limits: Range) -> float:
        """Return a number from a range."""
        low, high = limits
        return float(low + (high - low) * self.random.random())

    def whole(self, limits: Range) -> int:
        """Return a whole number from a range, both ends as likely as others."""
        low, high = int(limits[0]), int(limits[1])
        return min(low + int((high - low + 1) * self.random.random()), high)

    def one(self, words: tuple[str, ...]) -> str:
        """Return one of several words."""
        return words[self.whole((0, len(words) - 1))]


@dataclass(frozen=True)
class Principled:
    """Inputs of one Principled BSDF."""

    base_color: tuple[float, float, float]
    metallic: float
    roughness: float
    specular: float
    coat: float


@dataclass(frozen=True)
class Sample:
    """What one sample is, in plain values.

    Parameters
    ----------
    index : int
    split : str
        One of :data:`.recipe.SPLITS`. Samples of one mesh or scene file are all in one split, so that no test shows a
        shape that was trained with.
    shape : str
        A made shape, a built-in scene or a file.
    shape_seed : int
    detail, extent : float
        Of a made shape; extent [m] also of a mesh.
    material : str
        Principled, the shape's own, or a BRDF file.
    principled : tuple of Principled
        Those that are mixed; empty for another material.
    patches : float
        Size of their patches over the object's extent.
    table : float
        From 0 to 1: which of a file's tables.
    lights : int
    field_of_view, azimuth, elevation : float
        Of the camera [deg].
    margin : float
        Width of the picture over that of a ball about the object.
    render_seed : int
    white, full_well, read_noise : float
        Of the sensor: a percentile [%] and electrons.
    """

    index: int
    split: str
    shape: str
    shape_seed: int
    detail: float
    extent: float
    material: str
    principled: tuple[Principled, ...]
    patches: float
    table: float
    lights: int
    field_of_view: float
    azimuth: float
    elevation: float
    margin: float
    render_seed: int
    white: float
    full_well: float
    read_noise: float

    @property
    def name(self) -> str:
        """Name of the sample in every layout."""
        return sample_name(self.index)

    def as_json(self) -> dict[str, Any]:
        """Return plain values; files by their names alone."""
        value = dataclasses.asdict(self)
        return value | {"shape": Path(self.shape).name, "material": Path(self.material).name}


def sample_name(index: int) -> str:
    """Return the name of a sample: sorted names are in the samples' order up to a hundred million."""
    return f"{index:08d}"


def draw(recipe: Recipe, index: int) -> Sample:
    """Draw one sample.

    Parameters
    ----------
    recipe : Recipe
        Its paths are whole; see :meth:`.Recipe.at`.
    index : int
        From 0.
    """
    r = recipe

    def stream(name: str) -> Stream:
        return Stream(r.seed, index, name)

    shape, material = stream("shape").one(r.shape.source), stream("material").one(r.material.source)
    mixed = stream("count").whole(r.material.count) if material == PRINCIPLED else 0
    return Sample(
        index=index,
        split=_split(r, index, shape),
        shape=shape,
        shape_seed=stream("shape seed").whole((0, 2**32 - 1)),
        detail=stream("detail").within(r.shape.detail),
        extent=stream("extent").within(r.shape.extent),
        material=material,
        principled=tuple(_principled(r, stream(f"material {k}")) for k in range(mixed)),
        patches=stream("patches").within(r.material.patches),
        table=stream("table").within((0.0, 1.0)),
        lights=lights_count(r, index),
        field_of_view=stream("field of view").within(r.camera.field_of_view),
        azimuth=stream("azimuth").within(r.camera.azimuth),
        elevation=stream("elevation").within(r.camera.elevation),
        margin=stream("margin").within(r.camera.margin),
        render_seed=stream("render").whole((0, 2**31 - 1)),
        white=stream("white").within(r.sensor.white),
        full_well=stream("full well").within(r.sensor.full_well),
        read_noise=stream("read noise").within(r.sensor.read_noise),
    )


def lights_count(recipe: Recipe, index: int) -> int:
    """Draw how many lights a sample has, and nothing else of it."""
    return Stream(recipe.seed, index, "lights").whole(recipe.lights.count)


def lights_of(
    recipe: Recipe, sample: Sample, centre: NDArray[np.float64], radius: float, axis: NDArray[np.float64]
) -> Lights:
    """Draw a sample's lights.

    Parameters
    ----------
    centre : (3,) float64
        Of the object, world [m].
    radius : float
        Of a ball about the object [m].
    axis : (3,) float64
        Unit direction that angles are counted from.

    Returns
    -------
    Lights
        Distant ones of irradiance pi [W/m^2], or near ones of I = pi d^2 [W/sr] at d, times their strengths: a white
        Lambertian surface that faces a usual light shows a radiance of about 1.
    """
    say = recipe.lights
    strength = _numbers(recipe, sample, "strength", sample.lights, say.strength)[:, None] * np.ones(3)
    if say.layout == "double-sphere":
        outer = max(4, sample.lights // 5)
        near, far = (radius * distance for distance in say.distance)
        spheres = CaptureSettings(inner=sample.lights - outer, outer=outer, radius_inner=near, radius_outer=far)
        lights = rig.double_sphere(spheres, centre)
        return dataclasses.replace(lights, intensity=lights.intensity * strength)
    direction = _directions(recipe, sample, axis)
    neither = np.full(sample.lights, 2)
    if say.layout == "distant":
        return Lights("distant", direction, np.pi * strength, neither)
    distance = radius * _numbers(recipe, sample, "distance", sample.lights, say.distance)[:, None]
    return Lights("near", centre + distance * direction, np.pi * distance**2 * strength, neither)


def _split(recipe: Recipe, index: int, shape: str) -> str:
    """Return the split of a sample; of a file it is that of all its samples."""
    alone = shape in SHAPES
    chance = Stream(
        recipe.seed, index if alone else 0, "split" if alone else f"split {Path(shape).name}"
    ).random.random()
    limits = (recipe.output.train, recipe.output.train + recipe.output.validation)
    return SPLITS[sum(chance >= limit for limit in limits)]


def _principled(recipe: Recipe, stream: Stream) -> Principled:
    say = recipe.material
    red, green, blue = (stream.within(say.base_color) for _ in range(3))
    return Principled(
        (red, green, blue),
        float(stream.random.random() < say.metal),
        stream.within(say.roughness),
        stream.within(say.specular),
        stream.within(say.coat),
    )


def _numbers(recipe: Recipe, sample: Sample, name: str, count: int, limits: Range) -> NDArray[np.float64]:
    drawn = Stream(recipe.seed, sample.index, f"lights' {name}").random.random(count)
    return np.asarray(limits[0] + (limits[1] - limits[0]) * drawn)


def _directions(recipe: Recipe, sample: Sample, axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit directions (L, 3) at the recipe's angles from an axis, even over the solid angle."""
    high, low = np.cos(np.radians(recipe.lights.angle))
    if recipe.lights.spread == "even":
        share = (np.arange(sample.lights) + 0.5) / sample.lights
        turn = rig.GOLDEN_ANGLE * np.arange(sample.lights)
    else:
        drawn = Stream(recipe.seed, sample.index, "lights' directions").random.random((sample.lights, 2))
        share, turn = drawn[:, 0], 2 * np.pi * drawn[:, 1]
    z = high + (low - high) * share
    around = np.sqrt(np.maximum(1 - z**2, 0))
    return np.stack([around * np.cos(turn), around * np.sin(turn), z], axis=-1) @ rig.to_axis(axis).T
