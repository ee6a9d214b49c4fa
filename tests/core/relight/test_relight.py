"""Pictures under new lights against closed forms, and against the pictures they are made of."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.capture import Capture
from pipeline.core.compare.pictures import relative_rmse
from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.relight import RelightSettings
from pipeline.core.relight.emitters import Emitter, distant, point
from pipeline.core.relight.environment import emitters_of
from pipeline.core.relight.film import moving_light
from pipeline.core.relight.render import check_outside, prepare, relit
from pipeline.core.shape import Shape
from tests import oracles, synthetic, tolerances
from tests.drawn import draw, ggx

SIZE = 20
ALBEDO = np.array([0.6, 0.4, 0.2])
SPECULAR = np.array([0.3, 0.3, 0.2])
ROUGHNESS = 0.4
NEW = np.array([0.9, -0.7, 2.1])
EDGE = 0.7  # height at which an unseen screen in x < 0 ends light


def drawn(shape: Shape, light: NDArray[np.float64], specular: NDArray[np.float64]) -> NDArray[Any]:
    """The closed form under a point of intensity 1."""
    points = np.nan_to_num(shape.points())
    reach = light - points
    normal = shape.camera.normals_to_world(np.nan_to_num(shape.normal))
    to_light, to_viewer = oracles.unit(reach), -shape.camera.rays()[1]
    glossy = oracles.ggx_cosine(normal, to_light, to_viewer, ROUGHNESS)
    f = ALBEDO * oracles.lambert_cosine(normal, to_light, 1.0)[..., None] + specular * glossy[..., None]
    return np.where(np.isfinite(shape.depth)[..., None], f / (reach**2).sum(-1)[..., None], 0)


def screened(shape: Shape, light: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the way from each pixel to a light meets the screen."""
    points = np.nan_to_num(shape.points())
    share = (EDGE - points[..., 2]) / (light[2] - points[..., 2])
    crossing = points[..., 0] + share * (light[0] - points[..., 0])
    return (share > 0) & (share < 1) & (crossing < 0)


@pytest.fixture(scope="module")
def glossy(tmp_path_factory: pytest.TempPathFactory) -> tuple[Capture, Shape]:
    shape = synthetic.ball(synthetic.camera(SIZE))
    return synthetic.write_capture(tmp_path_factory.mktemp("glossy"), shape, ALBEDO, SPECULAR, ROUGHNESS), shape


@pytest.fixture(scope="module")
def floor(tmp_path_factory: pytest.TempPathFactory) -> tuple[Capture, Shape]:
    """A Lambertian plane, partly behind a screen."""
    shape = synthetic.plane(synthetic.camera(SIZE), np.array([0.0, 0.0, 1.0]))
    shadow = np.stack([screened(shape, light) for light in synthetic.lights().position])
    folder = tmp_path_factory.mktemp("floor")
    return synthetic.write_capture(folder, shape, ALBEDO, np.zeros(3), ROUGHNESS, shadow), shape


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> tuple[Capture, Shape]:
    shape = synthetic.plane(synthetic.camera(SIZE), oracles.unit(np.array([0.2, -0.1, 1.0])))
    return synthetic.write_capture(tmp_path_factory.mktemp("plain"), shape, ALBEDO, np.zeros(3), ROUGHNESS), shape


def under(made: tuple[Capture, Shape], *lights: Emitter, interpolation: str = "model") -> NDArray[np.float32]:
    return finish(relit(finish(prepare(*made, RelightSettings(interpolation=interpolation))), lights))


def near(place: NDArray[np.float64], strength: float = 1.0) -> Emitter:
    return point(list(place), [strength] * 3)


def test_pictures_add_up(glossy: tuple[Capture, Shape]) -> None:
    other = distant([-1.0, 0.5, 1.0], [0.3, 0.2, 0.1])
    together = under(glossy, near(NEW, 2.0), other)
    apart = 2 * under(glossy, near(NEW)) + under(glossy, other)
    assert np.abs(together - apart).max() <= tolerances.SINGLE * together.max()


@pytest.mark.parametrize("name", ["glossy", "floor"])
def test_a_light_of_the_capture_gives_its_picture_back(name: str, request: pytest.FixtureRequest) -> None:
    capture, shape = request.getfixturevalue(name)
    prepared = finish(prepare(capture, shape, RelightSettings()))
    for light in (0, 3, 17, 62, 70):
        intensity = list(capture.lights.intensity[light])
        picture = finish(relit(prepared, [point(list(capture.lights.position[light]), intensity)]))
        kept = capture.image(light)
        assert np.abs(picture - kept).max() <= tolerances.RELIT_KEPT * max(kept.max(), 1e-6)


@pytest.mark.parametrize("place", [NEW, 0.7 * NEW, 3 * NEW])
def test_a_lambertian_plane_is_relit_exactly(plain: tuple[Capture, Shape], place: NDArray[np.float64]) -> None:
    expected = drawn(plain[1], place, np.zeros(3))
    picture = under(plain, near(place))
    assert relative_rmse(picture, expected) < tolerances.RELIT_LAMBERT
    assert relative_rmse(picture[:, ::-1], expected) > 0.02


def test_a_distant_light_is_the_limit_of_a_near_one(plain: tuple[Capture, Shape]) -> None:
    far = 1e5
    picture = under(plain, near(far * oracles.unit(NEW), far**2))
    assert relative_rmse(under(plain, distant(list(NEW), [1.0] * 3)), picture) < 1e-4


def test_highlights_move(glossy: tuple[Capture, Shape]) -> None:
    expected = drawn(glossy[1], NEW, SPECULAR)
    error = relative_rmse(under(glossy, near(NEW)), expected)
    assert error < tolerances.RELIT_GLOSSY
    assert error < 0.2 * relative_rmse(under(glossy, near(NEW), interpolation="source"), expected)


def test_a_wrong_depth_is_worse(glossy: tuple[Capture, Shape]) -> None:
    capture, shape = glossy
    off = dataclasses.replace(shape, depth=shape.depth + np.float32(0.15))
    expected = drawn(shape, 0.7 * NEW, SPECULAR)
    right, wrong = (relative_rmse(under((capture, one), near(0.7 * NEW)), expected) for one in (shape, off))
    assert wrong > 3 * right


def test_shadows_move_and_stay_sharp(floor: tuple[Capture, Shape]) -> None:
    """At the edge of a shadow the source's rule fades where this one has a step, and nearer to the right place."""
    _, shape = floor
    errors: dict[str, list[float]] = {"model": [], "source": []}
    grays = {"model": 0, "source": 0}
    for x in (-0.8, -0.3, 0.4, 0.9):
        light = np.array([x, 0.4, 2.2])
        whole = drawn(shape, light, np.zeros(3))
        expected = whole * ~screened(shape, light)[..., None]
        for interpolation, found in errors.items():
            picture = under(floor, near(light), interpolation=interpolation)
            found.append(relative_rmse(picture, expected))
            share = picture[..., 0] / whole[..., 0]
            grays[interpolation] += int(((share > 0.15) & (share < 0.85)).sum())
    assert np.mean(errors["model"]) < 0.8 * np.mean(errors["source"])
    assert 0 < grays["model"] < 0.5 * grays["source"]


def test_an_even_environment_is_reflected_by_the_albedo(tmp_path: Path, plain: tuple[Capture, Shape]) -> None:
    """A Lambertian plane under a radiance of 1 everywhere reflects its albedo."""
    picture = under(plain, *emitters_of(np.ones((16, 32, 3), np.float32)))
    assert np.abs(picture / ALBEDO - 1).max() < tolerances.RELIT_SKY


def test_pixels_without_depth_are_relit_as_their_neighbours(plain: tuple[Capture, Shape]) -> None:
    capture, shape = plain
    holed = shape.depth.copy()
    holed[5:8, 9] = np.nan
    expected = drawn(shape, NEW, np.zeros(3))
    assert relative_rmse(under((capture, dataclasses.replace(shape, depth=holed)), near(NEW)), expected) < 0.02


def test_the_moving_light_comes_from_infinity_turns_and_leaves(glossy: tuple[Capture, Shape]) -> None:
    _, shape = glossy
    points = shape.points()[np.isfinite(shape.depth)]
    lights = moving_light(shape.camera, points, 31)
    assert lights[0].distant and lights[-1].distant and not any(light.distant for light in lights[1:-1])
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    away = [np.linalg.norm(light.place - centre) for light in lights[1:-1]]
    assert away[:10] == sorted(away[:10], reverse=True) and away[19:] == sorted(away[19:])
    first, last = (oracles.unit(lights[i].place - centre) for i in (10, 20))
    level = shape.camera.to_world[:3, 1]
    flat = [oracles.unit(v - v @ level * level) for v in (first, last)]
    assert np.degrees(np.arccos(flat[0] @ flat[1])) == pytest.approx(90.0, abs=1e-6)
    check_outside(shape, lights)


def test_a_light_inside_the_object_is_told(glossy: tuple[Capture, Shape]) -> None:
    check_outside(glossy[1], [near(np.array([0.0, 0.0, 0.9])), distant([0, 0, 1], [1, 1, 1])])
    for share in (-0.85, -0.5, 0.0, 0.5, 0.95):  # a pixel is 0.125 wide
        with pytest.raises(LightsphereError, match="inside the object"):
            check_outside(glossy[1], [near(np.array([0.1, 0.0, share * synthetic.RADIUS]))])


def test_a_light_behind_the_object_is_none_inside(glossy: tuple[Capture, Shape]) -> None:
    behind = [[0.0, 0.0, -0.9], [0.5, 0.1, -0.75], [0.1, 0.0, -3.0]]
    check_outside(glossy[1], [near(np.array(place)) for place in behind])
    check_outside(synthetic.bowl(synthetic.camera(SIZE), 60.0), [near(np.zeros(3))])


def test_a_shape_of_another_capture_is_told(glossy: tuple[Capture, Shape]) -> None:
    capture, _ = glossy
    for camera in (synthetic.camera(SIZE + 2), synthetic.camera(SIZE, distance=6.0)):
        with pytest.raises(LightsphereError, match="depth map"):
            under((capture, synthetic.ball(camera)), near(NEW))


def test_lights_at_infinity_serve_as_well() -> None:
    """Of pictures under distant lights, a distant one and a near one are made: highlights move, light falls off."""
    shape = synthetic.ball(synthetic.camera(SIZE))
    directions = synthetic.lights().position
    lights = Lights("distant", oracles.unit(directions), np.full(directions.shape, 2.0), np.full(len(directions), 2))
    capture = draw(shape, lights, ggx)
    far, close = (draw(shape, replaced, ggx).image(0) for replaced in (
        Lights("distant", oracles.unit(NEW)[None], np.ones((1, 3)), np.array([2])),
        Lights("near", NEW[None], np.ones((1, 3)), np.array([2])),
    ))  # fmt: skip
    assert relative_rmse(under((capture, shape), distant(list(NEW), [1.0] * 3)), far) < tolerances.RELIT_GLOSSY
    assert relative_rmse(under((capture, shape), near(NEW)), close) < tolerances.RELIT_GLOSSY
    scaled = close * (far * close).sum() / (close**2).sum()
    assert relative_rmse(scaled, far) > 2 * tolerances.RELIT_GLOSSY


def test_unknown_lights_are_told(glossy: tuple[Capture, Shape]) -> None:
    capture, shape = glossy
    with pytest.raises(LightsphereError, match="lights are unknown"):
        under((dataclasses.replace(capture, lights=dataclasses.replace(capture.lights, kind="unknown")), shape))
