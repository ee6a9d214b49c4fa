"""Hollow bodies under unknown lights: the bowl is not taken for a ball, which looks the same but for its shadows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.core.compare.shapes import angles_deg, light_errors
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.shape.settings import ShapeSettings
from pipeline.core.shape.uncalibrated.integrability import rotation
from pipeline.core.shape.uncalibrated.pictures import Pictures
from pipeline.core.shape.uncalibrated.recover import recover
from pipeline.core.shape.uncalibrated.shadows import occluded
from tests import oracles, synthetic, tolerances
from tests.core.shape.test_uncalibrated import lamps, view
from tests.drawn import Drawn

Array = NDArray[Any]
HALF_ANGLE = 75.0


def lit_in_bowl(points: Array, light: Array) -> NDArray[np.bool_]:
    """Return which points of the bowl a distant light reaches: the chord towards it leaves by the opening."""
    along = -2 * points @ light
    leaves = points + along[..., None] * light
    return (along > 0) & (leaves[..., 2] > -synthetic.RADIUS * np.cos(np.radians(HALF_ANGLE)))


def photographed_bowl(lights: Lights, degrees: float) -> Drawn:
    """A bowl of two browns, a little glossy, drawn with its cast shadows and without light from bounce to bounce."""
    camera = view(degrees, 36)
    bowl = synthetic.bowl(camera, HALF_ANGLE)
    known = np.isfinite(bowl.depth)
    normal, points = np.nan_to_num(camera.normals_to_world(bowl.normal)), np.nan_to_num(bowl.points())
    share = (0.6 + 0.4 * np.tanh(4 * np.sin(4 * normal[..., 0] + 3 * normal[..., 1])))[..., None]
    pictures = np.zeros((len(lights), *known.shape, 3), np.float32)
    for k, light in enumerate(lights.position):
        wi = np.broadcast_to(light, normal.shape)
        matt = oracles.lambert_cosine(normal, wi, 1.0)[..., None]
        glossy = oracles.ggx_cosine(normal, wi, -camera.rays()[1], 0.5)[..., None]
        lit = known & lit_in_bowl(points, light)
        seen = share * np.array([0.7, 0.4, 0.2]) * matt + 0.1 * glossy
        pictures[k] = np.where(lit[..., None], seen, 0) * lights.intensity[k]
        pictures[k] += 0.002 * np.random.default_rng(k).standard_normal(pictures[k].shape)
    names = tuple(f"{k}.exr" for k in range(len(lights)))
    return Drawn(
        Path("drawn"), camera, lights, names, ("",) * len(lights), {"diameter": 1.6}, np.maximum(pictures, 0), known
    )


def test_a_bowl_is_no_ball() -> None:
    lights = lamps(55.0, 0.1)
    given = photographed_bowl(lights, 25)
    found = finish(recover(given, ShapeSettings(method="uncalibrated")))
    bowl = synthetic.bowl(given.camera, HALF_ANGLE)
    known = np.isfinite(bowl.depth)
    errors = light_errors(found.lights, lights, found.shape, None)
    assert errors["light_mae_deg"] < tolerances.HOLLOW
    assert angles_deg(found.shape.normal[known], bowl.normal[known]).mean() < tolerances.HOLLOW


@pytest.mark.parametrize("model", ["pinhole", "orthographic"])
def test_a_bowl_hides_itself_as_chords_say(model: str) -> None:
    camera = synthetic.camera(56, model)
    bowl = synthetic.bowl(camera, HALF_ANGLE)
    known = np.isfinite(bowl.depth)
    light = oracles.unit(np.array([0.7, -0.4, 0.6]))
    pictures = Pictures(known, camera, np.ones((known.sum(), 1, 3)), np.ones((known.sum(), 1)), 0.0)
    points = bowl.points()[known]
    towards = np.broadcast_to(light, (len(points), 1, 3))
    hidden = occluded(pictures, points - camera.to_world[:3, 3], towards)[:, 0]
    lit = lit_in_bowl(points, light)
    facing = -points @ light > 0
    assert 0.1 < (facing & ~lit).mean() < 0.9
    assert (hidden == ~lit)[facing].mean() > 0.88
    mirrored = occluded(pictures, points - camera.to_world[:3, 3], towards * [-1, -1, 1])[:, 0]
    assert (mirrored == ~lit)[facing].mean() < 0.7


@pytest.mark.parametrize("body", ["ball", "bowl"])
def test_a_rotation_is_found_by_the_surface_alone(body: str) -> None:
    camera = view(40)
    shape = synthetic.ball(camera) if body == "ball" else synthetic.bowl(camera, HALF_ANGLE)
    known = np.isfinite(shape.depth)
    normals = shape.normal[known].astype(np.float64)
    rays = np.concatenate([part[known] @ camera.to_world[:3, :3] for part in camera.rays()], axis=1)
    turned = Rotation.from_rotvec([0.7, -1.1, 0.4]).as_matrix()
    found = rotation(known, rays, normals @ turned.T, pinhole=True)
    apart = Rotation.from_matrix(found @ turned).magnitude()
    assert np.degrees(apart) < 1
