"""What a camera makes of radiance: shot noise, noise of reading, saturation, a response curve, quantisation.

A value v of full scale frees N ~ Poisson(v W) electrons, W those at white; reading adds a normal error of deviation r
electrons (EMVA standard 1288). What is above white is cut off. The number is the nearest of 2^bits steps of the
response, and the picture that number taken back through it: linear, as an importer would make it.

Not modelled: dark current, gain that differs between pixels, colour filters and their interpolation, optics.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import images
from ..photographs.response import response_of
from .draw import Sample, Stream
from .recipe import SensorRecipe

BRIGHTEST = 4.0  # of white: light beyond saturates whatever its noise


@dataclass(frozen=True)
class Sensor:
    """A camera of one exposure.

    Parameters
    ----------
    white : float
        Radiance at which numbers end.
    full_well, read_noise : float
        Electrons at white, 0 for no shot noise; and the deviation of reading.
    bits : int
        0 for numbers that are not quantised.
    response : str
        ``"linear"`` or ``"srgb"``.
    """

    white: float
    full_well: float
    read_noise: float
    bits: int
    response: str

    def expose(self, radiance: NDArray[np.float32], random: np.random.Generator) -> NDArray[np.float32]:
        """Return a picture (H, W, 3) in units of white, from 0 to 1."""
        light = np.clip(radiance.astype(np.float64) / self.white, 0, None)
        if self.full_well > 0:
            electrons = random.poisson(np.minimum(light, BRIGHTEST) * self.full_well).astype(np.float64)
            light = (electrons + self.read_noise * random.standard_normal(electrons.shape)) / self.full_well
        light = np.clip(light, 0, 1)
        if self.bits:
            steps = 2**self.bits - 1
            stored = images.srgb(light) if self.response == "srgb" else light
            rounded = (np.round(stored * steps) / steps).astype(np.float32)
            return response_of(self.response, self.bits).decode(rounded)
        return light.astype(np.float32)


def is_ideal(recipe: SensorRecipe) -> bool:
    """Return whether pictures stay what was rendered."""
    return recipe.bits == 0 and recipe.full_well[1] == 0


def sensor_of(recipe: SensorRecipe, sample: Sample, object_values: Iterable[NDArray[np.float32]]) -> Sensor:
    """Return a sample's sensor, exposed so that its percentile of the object's values is white.

    Parameters
    ----------
    object_values : iterable of (P, 3) float32
        Of every picture.
    """
    values = np.concatenate([part.ravel() for part in object_values])
    lit = values[values > 0]
    white = float(np.percentile(lit, sample.white)) if lit.size else 1.0
    return Sensor(white, sample.full_well, sample.read_noise, recipe.bits, recipe.response)


def noise_of(seed: int, sample: Sample, light: int) -> np.random.Generator:
    """Return the random numbers of one picture of a sample."""
    return Stream(seed, sample.index, f"noise of picture {light}").random
