"""Light from bounce to bounce: in a bowl that is a part of a ball it is the same everywhere, known in closed form."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline import cli
from pipeline.blender.interreflections import bounced, taken_out
from pipeline.core import images
from pipeline.core.capture import Capture
from pipeline.core.compare.shapes import angles_deg
from pipeline.core.lights import Lights
from pipeline.core.progress import Work, finish
from pipeline.core.reflectance.bivariate import Bivariate
from pipeline.core.shape import Shape
from pipeline.core.shape.photometric.recover import Recovered, recover
from pipeline.core.shape.settings import ShapeSettings
from tests import synthetic, tolerances

HALF_ANGLE = 50.0  # of the bowl; no light within 30 degrees of its axis casts a shadow in it
ALBEDO = 0.8
VIEW = synthetic.camera(48, "orthographic")
BOWL = synthetic.bowl(VIEW, HALF_ANGLE)
KNOWN = np.isfinite(BOWL.depth)


def lamps(count: int) -> Lights:
    angle = 2 * np.pi * np.arange(count) / count
    slant = np.radians(np.where(np.arange(count) % 2, 28.0, 14.0))
    direction = np.stack([np.sin(slant) * np.cos(angle), np.sin(slant) * np.sin(angle), np.cos(slant)], axis=1)
    return Lights("distant", direction, np.full((count, 3), np.pi), np.full(count, 2))


def between_walls(light: NDArray[Any], albedo: float) -> float:
    """Return the radiance that a Lambertian bowl adds to every of its points under a light of irradiance pi.

    Any two surface elements of a ball exchange dA / (4 pi R^2) of what they send out, so that with the share k of the
    ball that the bowl is, E = albedo (flux / (4 pi R^2) + k E), the flux being what comes in by the opening.
    """
    opening = np.sqrt(KNOWN.sum() / np.pi) / VIEW.focal[0]
    share = (1 - np.sqrt(1 - (opening / synthetic.RADIUS) ** 2)) / 2
    flux = np.pi * light[2] * np.pi * opening**2
    irradiance = albedo * flux / (4 * np.pi * synthetic.RADIUS**2) / (1 - albedo * share)
    return float(albedo / np.pi * irradiance)


def lambertian() -> Bivariate:
    table = np.full((64, 13, 1, 3), ALBEDO / np.pi)
    weights = np.where(KNOWN[..., None, None], 1.0, np.nan).astype(np.float32)
    return Bivariate(table, np.ones(table.shape[:3]), weights, np.where(KNOWN, 0.0, np.nan).astype(np.float32), {})


def photographed(folder: Path, lights: Lights) -> Capture:
    """The bowl with the light between its walls."""
    normal = np.nan_to_num(VIEW.normals_to_world(BOWL.normal))
    names = tuple(f"light_{k:04d}.exr" for k in range(len(lights)))
    for k, name in enumerate(names):
        direct = ALBEDO * np.maximum(normal @ lights.position[k], 0)
        seen = np.where(KNOWN, direct + between_walls(lights.position[k], ALBEDO), 0)
        images.write_rgb(folder / name, np.repeat(seen[..., None], 3, axis=2).astype(np.float32))
    images.write_channels(folder / "mask.exr", {"mask.V": KNOWN.astype(np.float32)})
    made = Capture(folder, VIEW, lights, names, ("",) * len(names), {})
    made.save()
    return made


def test_light_between_the_walls_of_a_bowl_is_that_of_a_ball() -> None:
    lights = lamps(2)
    found = finish(bounced(BOWL, lambertian(), lights))
    for k in range(len(lights)):
        share = found[k][KNOWN].mean(axis=1) / between_walls(lights.position[k], ALBEDO)
        assert np.median(share) == pytest.approx(1, abs=tolerances.BETWEEN_WALLS)
        assert np.quantile(np.abs(share - 1), 0.9) < 5 * tolerances.BETWEEN_WALLS
        darker = found[k][KNOWN].mean(axis=1) / between_walls(lights.position[k], 0.95 * ALBEDO)
        assert np.median(darker) > 1 + tolerances.BETWEEN_WALLS


@pytest.mark.slow
def test_a_bowl_gets_its_depth_back(tmp_path: Path) -> None:
    given = photographed(tmp_path, lamps(8))
    settings = ShapeSettings(method="acls", bases=1)

    def solve(capture: Capture, before: Recovered | None) -> Work[Recovered]:
        return recover(capture, settings)

    def off(shape: Shape) -> float:
        return float(angles_deg(shape.normal[KNOWN], BOWL.normal[KNOWN]).mean())

    before = finish(recover(given, settings))
    after, without = finish(taken_out(given, solve, 2, tmp_path / "direct"))
    assert off(after.shape) < 0.4 * off(before.shape)
    assert without.folder == tmp_path / "direct"
    assert Capture.open(without.folder).damaged() == []
    light = between_walls(given.lights.position[0], ALBEDO)
    assert np.median((given.image(0) - without.image(0))[KNOWN]) == pytest.approx(light, rel=0.15)


def test_the_command_keeps_the_pictures_that_it_solved(tmp_path: Path) -> None:
    given = photographed(tmp_path, lamps(6))
    options = ["--method", "acls", "--bases", "1", "--interreflections", "1"]
    assert cli.main(["shape", str(given.folder), "-o", str(tmp_path / "shape"), *options]) == 0
    without = Capture.open(tmp_path / "shape" / "direct")
    assert without.lights.position == pytest.approx(given.lights.position)
    assert (without.image(0)[KNOWN] < given.image(0)[KNOWN]).mean() > 0.9
    assert Shape.open(tmp_path / "shape").notes["capture"] == ".."


def test_nothing_is_taken_from_a_ball(tmp_path: Path) -> None:
    ball = synthetic.ball(VIEW)
    known = np.isfinite(ball.depth)
    weights = np.where(known[..., None, None], 1.0, np.nan).astype(np.float32)
    found = finish(bounced(ball, dataclasses.replace(lambertian(), weights=weights), lamps(1)))
    assert found.max() < 1e-3  # where facets, smooth in their shading, see each other
