"""Lights, normals and bases come back from pictures alone, and what cannot be told is said."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.camera import Camera
from pipeline.core.capture import Truth
from pipeline.core.compare.pictures import relative_rmse
from pipeline.core.compare.shapes import angles_deg, light_errors
from pipeline.core.errors import LightsphereError
from pipeline.core.lights import Lights
from pipeline.core.progress import finish
from pipeline.core.reflectance.picture import picture
from pipeline.core.shape.settings import ShapeSettings
from pipeline.core.shape.uncalibrated.certainty import deviations, doubts
from pipeline.core.shape.uncalibrated.joint import Joint
from pipeline.core.shape.uncalibrated.recover import Recovered, recover
from pipeline.core.shape.uncalibrated.solve import Solution
from pipeline.core.shape.uncalibrated.start import mean_strength_one, towards_known
from pipeline.report.uncalibrated import Results, report
from tests import oracles, synthetic, tolerances
from tests.drawn import Drawn

Array = NDArray[Any]
COUNT = 12
BUT_ALBEDO = "outline,surface,strengths,highlights,shadows"


def lamps(cone: float = 55.0, strengths: float = 0.2) -> Lights:
    """Lights held about the view, their strengths differing."""
    number = np.arange(COUNT)
    height = 1 - (1 - np.cos(np.radians(cone))) * ((number * 5) % COUNT + 0.5) / COUNT
    angle = 2.4 * number
    across = np.sqrt(1 - height**2)
    direction = np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)
    strength = np.pi * (1 + strengths * np.cos(1.7 * number))
    return Lights("distant", direction, np.repeat(strength[:, None], 3, axis=1), np.full(COUNT, 2))


def view(degrees: float, size: int = 56) -> Camera:
    distance = 1.1 / np.sin(np.radians(degrees) / 2)
    return synthetic.camera(size, distance=float(distance))


def near_lamps(seed: int = 1, powers: float = 0.0) -> Lights:
    """A lamp at one to two and a half diameters of the ball, its power differing."""
    random = np.random.default_rng(seed)
    away = random.uniform(1.8, 4.0, (COUNT, 1))
    power = np.pi * (away**2).mean() * (1 + powers * random.uniform(-1, 1, (COUNT, 1)))
    return Lights("near", away * lamps().position, np.repeat(power, 3, axis=1), np.full(COUNT, 2))


def photographed(camera: Camera, lights: Lights, gloss: float = 0.25, noise: float = 0.002, seed: int = 3) -> Drawn:
    """A dented ball of two materials, matt brown and glossy green, drawn without cast shadows."""
    random = np.random.default_rng(seed)
    ball = synthetic.ball(camera)
    known = ball.confidence > 0
    normal = camera.normals_to_world(np.nan_to_num(ball.normal))
    share = (0.5 + 0.5 * np.sin(5 * normal[..., 0] + 3 * normal[..., 1]))[..., None]
    to_viewer, points = -camera.rays()[1], np.nan_to_num(ball.points())
    pictures = np.zeros((COUNT, *known.shape, 3), np.float32)
    for k in range(COUNT):
        near = lights.kind == "near"
        towards = lights.position[k] - points if near else np.broadcast_to(lights.position[k], normal.shape)
        wi, squared = oracles.unit(towards), (towards**2).sum(axis=-1, keepdims=True)
        matt = oracles.lambert_cosine(normal, wi, 1.0)[..., None]
        glossy = oracles.ggx_cosine(normal, wi, to_viewer, 0.5)[..., None]
        seen = share * np.array([0.7, 0.4, 0.2]) * matt + (1 - share) * (
            np.array([0.1, 0.3, 0.1]) * matt + gloss * glossy
        )
        lit = known & (oracles.dot(normal, wi) > 0)
        pictures[k] = np.where(lit[..., None], seen, 0) * lights.intensity[k] / squared
        pictures[k] += noise * random.standard_normal(pictures[k].shape)
    names = tuple(f"{k}.exr" for k in range(COUNT))
    notes = {"diameter": 1.6}
    return Drawn(Path("drawn"), camera, lights, names, ("",) * COUNT, notes, np.maximum(pictures, 0), known)


def solved(capture: Drawn, **settings: Any) -> Recovered:
    return finish(recover(capture, ShapeSettings(method="uncalibrated", **settings)))


def normal_error(found: Recovered, camera: Camera) -> float:
    true = synthetic.ball(camera)
    known = true.confidence > 0
    cosine = oracles.dot(found.shape.normal[known], true.normal[known])
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())


def lie() -> Lights:
    """What the ball's capture says of its lights."""
    return dataclasses.replace(lamps(), position=np.roll(lamps().position, 5, axis=0))


@pytest.fixture(scope="module")
def ball() -> Recovered:
    return solved(dataclasses.replace(photographed(view(40, 44), lamps()), lights=lie()))


def test_lights_and_normals_come_back(ball: Recovered) -> None:
    assert angles_deg(ball.lights.position, lamps().position).mean() < tolerances.UNKNOWN_LIGHTS
    assert normal_error(ball, view(40, 44)) < tolerances.UNKNOWN_NORMALS
    strength = ball.lights.intensity.mean(axis=1) / lamps().intensity.mean(axis=1)
    assert np.std(np.log(strength)) < tolerances.UNKNOWN_STRENGTHS


def test_nothing_is_doubted_that_is_known(ball: Recovered) -> None:
    assert not ball.doubts


def test_photographs_that_are_not_explained_are_told(ball: Recovered) -> None:
    joint = ball.end
    assert isinstance(joint, Joint)
    solution = Solution(joint, (1.0,), [], (1.0,), 1.0)
    covariance = np.zeros((COUNT, 3, COUNT, 3))
    before = deviations(solution, covariance)
    assert not doubts(solution, *before)
    bad = dataclasses.replace(joint)
    bad.certainty, bad.misfit, bad.belief = joint.certainty, np.full_like(joint.misfit, 1.0), joint.belief
    solution = dataclasses.replace(solution, joint=bad)
    after = deviations(solution, covariance)
    assert any("does not explain" in words for words in doubts(solution, *after))
    assert after[0].min() > 10 * max(before[0].max(), 1.0)


def test_lights_that_the_capture_states_are_not_looked_at(ball: Recovered) -> None:
    assert angles_deg(ball.lights.position, lamps().position).mean() < tolerances.UNKNOWN_LIGHTS
    assert angles_deg(ball.lights.position, lie().position).mean() > 10 * tolerances.UNKNOWN_LIGHTS


def test_a_picture_is_predicted_by_what_was_recovered(ball: Recovered) -> None:
    """The recovered lights, normals and tables give the pictures back; another light's direction does not."""
    capture = photographed(view(40, 44), lamps(), noise=0.0)
    known = capture.mask() & np.isfinite(ball.shape.normal).all(axis=-1)

    def error(shown: int, light: int) -> float:
        made = picture(ball.shape, ball.reflectance, ball.lights.position[light], ball.lights.intensity[light])
        return relative_rmse(made, capture.image(shown), known)

    assert max(error(k, k) for k in range(COUNT)) < tolerances.UNKNOWN_PICTURE
    assert min(error(k, (k + 1) % COUNT) for k in range(COUNT)) > 2 * tolerances.UNKNOWN_PICTURE


@pytest.mark.slow
def test_coloured_lamps_change_nothing_but_their_colour() -> None:
    lights = lamps()
    tint = 1 + 0.3 * np.sin(np.arange(3 * COUNT).reshape(COUNT, 3))
    coloured = dataclasses.replace(lights, intensity=lights.intensity * tint)
    found = solved(photographed(view(40), coloured))
    assert angles_deg(found.lights.position, lights.position).mean() < tolerances.UNKNOWN_LIGHTS
    ratio = found.lights.intensity / coloured.intensity
    ratio /= ratio.mean(axis=0)
    assert np.std(np.log(ratio / ratio.mean(axis=1, keepdims=True))) < tolerances.UNKNOWN_STRENGTHS


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4])
def test_matt_object_ends_well_and_says_so(seed: int) -> None:
    """Noise that a lobe explains is no highlight."""
    lights = lamps(strengths=0.0)
    found = solved(photographed(view(40), lights, gloss=0.0, seed=seed), strengths="equal")
    assert any("no highlights" in doubt for doubt in found.doubts)
    assert angles_deg(found.lights.position, lights.position).mean() < tolerances.UNKNOWN_LIGHTS


def test_known_lights_fix_what_the_others_leave_open() -> None:
    """Lights known but for a linear map come back by some of them, whatever their strengths."""
    true = lamps().position * (1 + 0.2 * np.cos(np.arange(COUNT)))[:, None]
    distorted = true @ (np.eye(3) + 0.15 * np.random.default_rng(5).standard_normal((3, 3)))
    told = np.array([1, 4, 6, 8, 11])

    def error(lights: Array) -> float:
        return float(np.degrees(np.arccos(oracles.dot(oracles.unit(lights), lamps().position))).max())

    found = towards_known(distorted, told, lamps().position[told])
    assert error(found) < 0.3 * error(distorted)
    np.testing.assert_allclose(towards_known(true, told, lamps().position[told]), mean_strength_one(true), atol=1e-6)


@pytest.mark.slow
def test_whatever_is_known_helps(tmp_path: Path) -> None:
    """A matt ball seen from afar leaves much open but for its paints; a few lights, or the mesh of its half, do not."""
    camera, lights = view(20), lamps()
    capture = photographed(camera, lights, gloss=0.0)
    listed = tmp_path / "known.txt"
    listed.write_text("".join(f"{k}.exr {' '.join(map(str, lights.position[k]))}\n" for k in (0, 4, 8)))
    half = synthetic.ball(camera).within(np.indices((56, 56))[1] < 28)
    blind, told = solved(capture, cues=BUT_ALBEDO), solved(capture, cues=BUT_ALBEDO, known_lights=str(listed))
    seen = finish(recover(capture, ShapeSettings(method="uncalibrated", cues=BUT_ALBEDO), half))
    errors = [angles_deg(found.lights.position, lights.position).mean() for found in (blind, told, seen)]
    assert errors[1] < min(tolerances.UNKNOWN_LIGHTS, 0.6 * errors[0]) and errors[2] < 0.8 * errors[0]
    assert told.deviation.mean() < blind.deviation.mean()
    known = np.isfinite(half.depth)
    assert np.median(np.abs(seen.shape.depth - half.depth)[known]) < 0.02
    assert seen.shape.notes["level"] != "open"


def errors_of(found: Recovered, lights: Lights, camera: Camera) -> dict[str, float]:
    ball = synthetic.ball(camera)
    truth = Truth(ball.depth, ball.normal, ball.normal, np.ones(ball.depth.shape, np.int32), 1.6)
    return light_errors(found.lights, lights, found.shape, truth)


def test_places_and_powers_of_near_lamps_come_back() -> None:
    """Falloff tells where a lamp is."""
    camera, lights = view(40, 24), near_lamps()
    capture = photographed(camera, lights)
    found = solved(capture, lamps="near")
    errors = errors_of(found, lights, camera)
    assert errors["light_mae_deg"] < tolerances.UNKNOWN_LIGHTS
    assert errors["light_distance_pct"] < tolerances.UNKNOWN_DISTANCES
    assert errors["light_power_pct"] < 100 * tolerances.UNKNOWN_STRENGTHS
    assert normal_error(found, camera) < tolerances.UNKNOWN_NORMALS and not found.doubts
    one = found.shape.notes["lights"][3]
    there = found.lights.position[3] - found.shape.middle()
    np.testing.assert_allclose(np.multiply(one["direction"], one["distance"]), there, rtol=1e-6)
    known = capture.mask() & np.isfinite(found.shape.normal).all(axis=-1)
    shown = picture(found.shape, found.reflectance, found.lights.position[3], found.lights.intensity[3], near=True)
    assert relative_rmse(shown, capture.image(3), known) < tolerances.UNKNOWN_PICTURE
    page = report(
        Results("near", dataclasses.replace(capture, lights=found.lights), found.shape, found.reflectance, 1.0)
    )
    assert "from the object" in page and f"{one['distance']:.3g} m" in page


@pytest.mark.slow
def test_near_lamps_taken_for_distant_bend_the_ball_and_are_told() -> None:
    camera, lights = view(40, 40), near_lamps()
    found = solved(photographed(camera, lights))
    assert errors_of(found, lights, camera)["light_mae_deg"] > 2 * tolerances.UNKNOWN_LIGHTS
    assert normal_error(found, camera) > tolerances.UNKNOWN_NORMALS
    assert any("--lamps near" in words for words in found.doubts)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("degrees", "powers", "gloss"), [(20, 0.2, 0.25), (40, 0.2, 0.0), (50, 0.0, 0.25)], ids=["far", "matt", "wide"]
)
def test_near_lamps_tell_the_relief(degrees: float, powers: float, gloss: float) -> None:
    """Even of a matt ball seen from afar, whose relief distant lamps leave open."""
    camera, lights = view(degrees), near_lamps(2, powers)
    found = solved(photographed(camera, lights, gloss), lamps="near")
    errors = errors_of(found, lights, camera)
    assert errors["light_mae_deg"] < tolerances.UNKNOWN_LIGHTS
    assert errors["light_distance_pct"] < tolerances.UNKNOWN_DISTANCES
    assert normal_error(found, camera) < tolerances.UNKNOWN_NORMALS


@pytest.mark.slow
def test_distant_lamps_taken_for_near_are_found_far_away() -> None:
    found = solved(photographed(view(40), lamps()), lamps="near")
    assert errors_of(found, lamps(), view(40))["light_mae_deg"] < tolerances.UNKNOWN_LIGHTS
    assert min(one["distance"] for one in found.shape.notes["lights"]) > 50


@pytest.mark.slow
def test_a_proxy_gives_near_lamps_their_scale() -> None:
    """Normals leave the size open, and the lamps' distances with it; the mesh of a half says both."""
    camera, lights = view(40), near_lamps()
    farther = camera.to_world + np.outer(np.eye(4)[2], [0.0, 0.0, 0.0, 1.5])
    moved = dataclasses.replace(camera, to_world=farther)
    capture = dataclasses.replace(photographed(camera, lights), camera=moved)
    ball = synthetic.ball(camera).within(np.indices((56, 56))[1] < 28)
    found = finish(recover(capture, ShapeSettings(method="uncalibrated", lamps="near"), ball))
    away = np.linalg.norm(found.lights.position - moved.to_world[:3, 3], axis=1)
    true = np.linalg.norm(lights.position - camera.to_world[:3, 3], axis=1)
    assert np.median(np.abs(away / true - 1)) < tolerances.UNKNOWN_DISTANCES / 100


@pytest.mark.slow
def test_without_its_cues_the_relief_is_open() -> None:
    capture = photographed(view(20), lamps(), gloss=0.0)
    found = solved(capture, cues="strengths")
    assert found.shape.notes["cues"] == ["strengths"]
    assert any("degrees only" in doubt for doubt in found.doubts)
    assert angles_deg(found.lights.position, lamps().position).mean() < 2 * found.deviation.mean()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"cues": "outline, taste"}, "taste is no cue"),
        ({"known_lights": "7.exr 0 0 0\n"}, "has no length"),
        ({"known_lights": "7.exr 0 0 1\n7.exr 0 1 1\n"}, "twice"),
        ({"known_lights": "70.exr 0 0 1\n"}, "'70.exr' is no photograph"),
        ({"known_lights": "0 0 1\n"}, "lacks its photograph's name"),
    ],
)
def test_what_cannot_be_known_is_told(tmp_path: Path, settings: dict[str, str], said: str) -> None:
    if "known_lights" in settings:
        (tmp_path / "known.txt").write_text(settings["known_lights"])
        settings = {"known_lights": str(tmp_path / "known.txt")}
    with pytest.raises(LightsphereError, match=said):
        solved(photographed(view(40), lamps()), **settings)


def test_a_proxy_beside_the_object_is_told() -> None:
    camera = view(40)
    away = synthetic.ball(camera).within(np.zeros((56, 56), bool))
    with pytest.raises(LightsphereError, match="proxy mesh is nowhere"):
        finish(recover(photographed(camera, lamps()), ShapeSettings(method="uncalibrated"), away))


def test_the_page_shows_every_light_and_what_is_open(ball: Recovered) -> None:
    doubtful = dataclasses.replace(ball.shape, notes={**ball.shape.notes, "doubts": ["the lamp <was> out"]})
    capture = dataclasses.replace(photographed(view(40, 44), lamps()), lights=ball.lights)
    page = report(Results("ball", capture, doubtful, ball.reflectance, 12.0))
    assert page.count("data:image/png") > 12 and "the lamp &lt;was&gt; out." in page
    assert page.count("<tr>") == 1 + COUNT


def test_the_objective_falls(ball: Recovered) -> None:
    course = np.array(ball.shape.notes["objective"])
    assert course[-1] < 0.05 * course[0] and (course[1:] < 1.1 * course[:-1]).all()


@pytest.mark.slow
def test_lamps_in_one_small_cone_are_told() -> None:
    found = solved(photographed(view(40), lamps(cone=6.0)))
    assert any("small cone" in doubt for doubt in found.doubts)


@pytest.mark.parametrize("count", [2, 5])
def test_too_few_photographs_are_refused(count: int) -> None:
    with pytest.raises(LightsphereError, match=f"has {count} photographs"):
        solved(photographed(view(40), lamps()).select(np.arange(count)))  # type: ignore[arg-type]


def test_black_photographs_are_refused() -> None:
    capture = photographed(view(40), lamps())
    assert capture.pictures is not None
    with pytest.raises(LightsphereError, match="black"):
        solved(dataclasses.replace(capture, pictures=0 * capture.pictures))
