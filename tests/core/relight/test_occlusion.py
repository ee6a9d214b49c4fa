"""Space carved by shadows: a ball over a floor, whose lower half no pixel shows, against the lines that meet it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.camera import Camera
from pipeline.core.progress import finish
from pipeline.core.relight.interpolant import HALFWAY
from pipeline.core.relight.occlusion import BEYOND, EMPTY, LIT, MOST, SHADOWED, Space, carved, opacity
from pipeline.core.rig import hemisphere

SIDE = 48
CENTRE, RADIUS = np.array([0.1, -0.05, 0.5]), 0.22
HEIGHT = 7.0


class Scene(NamedTuple):
    """Pixels, their lights and what was carved of them."""

    points: NDArray[np.float64]
    on_floor: NDArray[np.bool_]
    lights: NDArray[np.float64]
    kinds: NDArray[np.uint8]
    space: Space


def hidden(points: NDArray[np.float64], light: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the ball stands between points of the floor and a light."""
    along = (light - points) / np.linalg.norm(light - points, axis=1, keepdims=True)
    nearest = ((CENTRE - points) * along).sum(axis=1)
    beside = np.linalg.norm(CENTRE - points - nearest[:, None] * along, axis=1)
    return (beside < RADIUS) & (nearest > 0)


def seen_from(model: str, *, ball_is_seen: bool) -> Scene:
    """Return the scene from above; a ball that is not seen casts its shadow all the same."""
    to_world = np.eye(4)
    to_world[2, 3] = HEIGHT
    focal = 20.0 if model == "orthographic" else 20.0 * HEIGHT
    camera = Camera(model, to_world, (SIDE, SIDE), (focal, focal), (SIDE / 2, SIDE / 2))
    origins, directions = (rays.reshape(-1, 3) for rays in camera.rays())
    along = ((CENTRE - origins) * directions).sum(axis=1)
    inside = RADIUS**2 - ((CENTRE - origins - along[:, None] * directions) ** 2).sum(axis=1)
    on_floor = (inside <= 0) if ball_is_seen else np.ones(len(inside), np.bool_)
    depth = np.where(on_floor, -origins[:, 2] / directions[:, 2], along - np.sqrt(np.maximum(inside, 0)))
    points = origins + depth[:, None] * directions
    lights = np.concatenate([2.0 * hemisphere(90), 3.0 * hemisphere(30)])
    shadow = np.stack([hidden(points, light) for light in lights], axis=1)
    normal = np.where(on_floor[:, None], [0, 0, 1], points - CENTRE)
    shadow[~on_floor] = (normal @ lights.T - (normal * points).sum(1)[:, None] < 0)[~on_floor]
    kinds = np.where(shadow, SHADOWED, LIT).astype(np.uint8)
    place = np.stack([rows.reshape(-1) for rows in np.mgrid[:SIDE, :SIDE]])
    return Scene(points, on_floor, lights, kinds, finish(carved(points, place, lights, kinds, camera)))


def opacities(scene: Scene, light: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how surely something stands between every pixel and a light."""
    away, space = light - scene.points, scene.space
    far = np.linalg.norm(away, axis=1)
    rows = zip(space.points, away / far[:, None] @ space.rotation, space.ahead, far, strict=True)
    return np.array([opacity(point, u, ahead, end, space.codes, space.frames) for point, u, ahead, end in rows])


@pytest.mark.parametrize(("model", "most"), [("pinhole", MOST), ("orthographic", MOST), ("pinhole", 75)])
def test_shadows_between_the_lights_are_where_the_ball_casts_them(
    model: str, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where voxels are twice as wide, and each grid is carved by a third of the pixels."""
    monkeypatch.setattr("pipeline.core.relight.occlusion.MOST", most)
    scene = seen_from(model, ball_is_seen=True)
    floor, points = scene.on_floor, scene.points
    wrong, wrong_by_nearest, shadows = 0, 0, 0
    for light in (np.array([0.6, 0.5, 1.6]), np.array([-1.5, 0.4, 2.0]), np.array([0.2, -1.1, 4.0])):
        truth = hidden(points[floor], light)
        wrong += int(((opacities(scene, light)[floor] > HALFWAY) != truth).sum())
        nearest = np.argmax(scene.lights @ light / np.linalg.norm(scene.lights, axis=1))
        wrong_by_nearest += int((hidden(points[floor], scene.lights[nearest]) != truth).sum())
        shadows += int(truth.sum())
    assert wrong < 0.08 * shadows
    assert wrong < 0.2 * wrong_by_nearest


def test_own_lights_are_explained() -> None:
    """A line to a lit light is empty; one to a shadowed light has all the opacity that its shadow asks for.

    That is, in each of the grids that explain the shadow: at its edge some may have emptied all voxels on the line.
    """
    scene = seen_from("pinhole", ball_is_seen=True)
    whole, shadows = 0, 0
    for light in range(0, len(scene.lights), 7):
        found, kinds = opacities(scene, scene.lights[light]), scene.kinds[:, light]
        assert (found[kinds == LIT] == 0).all()
        explaining = found[kinds == SHADOWED] * len(scene.space.codes)
        assert explaining == pytest.approx(np.round(explaining), abs=1e-12) and (explaining > 0.5).all()
        whole += int((found[kinds == SHADOWED] > 1 - 1e-12).sum())
        shadows += int((kinds == SHADOWED).sum())
        assert (found[kinds == BEYOND] == 0).all()
    assert whole > 0.9 * shadows
    assert (scene.kinds[scene.on_floor] == SHADOWED).sum() > 20 * (scene.kinds[scene.on_floor] == BEYOND).sum()


def test_what_the_camera_does_not_see_explains_nothing() -> None:
    scene = seen_from("pinhole", ball_is_seen=False)
    space = scene.space
    for codes, (*_, low, width) in zip(space.codes, space.frames, strict=True):
        heights = low + (np.arange(codes.shape[2]) + 0.5) * width + HEIGHT
        assert (codes[:, :, heights > 2 * width] == EMPTY).all()
    assert (scene.kinds == BEYOND).any() and not (scene.kinds == SHADOWED).any()
