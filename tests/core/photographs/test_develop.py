"""A capture holds the photographs' light exactly, and says what is wrong with them."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.core import images
from pipeline.core.capture import Capture
from pipeline.core.errors import LightsphereError
from pipeline.core.photographs.calibration import calibrated
from pipeline.core.photographs.develop import develop
from pipeline.core.photographs.formats import find
from pipeline.core.photographs.settings import ImportSettings
from pipeline.core.progress import finish
from tests import photographed as drawn
from tests.photographed import Drawer, listed

LIGHTS = drawn.directions()
MASK = np.isfinite(drawn.normals()[..., 0])


@pytest.fixture
def there(tmp_path: Path) -> Drawer:
    """A ball of a matt material in 16 bits, with a list of lights and a mask."""
    made = Drawer(tmp_path / "photographs")
    made.series(drawn.lambert(LIGHTS))
    made.put("mask.png", MASK.astype(float))
    made.text("lights.txt", listed(LIGHTS))
    return made


def imported(there: Drawer, **settings: Any) -> Capture:
    chosen = ImportSettings(**settings)
    found = find(there.folder, chosen, there.read)
    if chosen.chrome or chosen.gray:
        found, chosen = finish(calibrated(found, chosen, there.read))
    return finish(develop(found, there.folder, there.folder.parent / "capture", chosen))


def normal_error(made: Capture) -> float:
    mask = made.mask()
    pictures = np.array([made.image(i) / made.lights.intensity[i] for i in range(len(made))]).mean(axis=3)
    normal = drawn.least_squares(pictures, made.lights.position, mask)
    # Where every light reaches the surface, plain least squares is exact.
    lit = (drawn.normals()[mask] @ LIGHTS.T > 0.02).all(axis=1)
    return float(drawn.angles(normal, drawn.normals()[mask])[lit].mean())


def test_normals_come_back_from_a_matt_ball(there: Drawer) -> None:
    made = imported(there)
    assert normal_error(made) < 0.01
    assert made.camera.model == "orthographic"
    assert made.camera.focal[0] == pytest.approx(2 * drawn.RADIUS, abs=2)  # the ball is 1 m wide
    np.testing.assert_array_equal(made.mask(), MASK)
    assert made.notes["found"]["saturated_pct"] == 0


@pytest.mark.parametrize("axis", [0, 1])
def test_flipped_photographs_do_not_pass(there: Drawer, axis: int) -> None:
    there.series(np.flip(drawn.lambert(LIGHTS), axis + 1))
    there.put("mask.png", np.flip(MASK, axis).astype(float))
    made = imported(there)
    pictures = np.array([made.image(i)[..., 0] for i in range(len(made))])
    normal = drawn.least_squares(pictures, made.lights.position, MASK & made.mask())
    assert drawn.angles(normal, drawn.normals()[MASK & made.mask()]).mean() > 20


def test_sixteen_bits_are_kept_to_the_last(there: Drawer) -> None:
    made = imported(there)
    assert images.read_channels(made.folder / made.files[0])["R"].dtype == np.float32
    np.testing.assert_array_equal(made.image(3), there.pictures[there.folder / "img_3.png"].pixels)
    assert made.notes["bit_depth"] == 16 and made.notes["saturation"] == pytest.approx(1, abs=1e-4)


def test_eight_bits_of_srgb_are_decoded_and_kept_as_half(there: Drawer) -> None:
    light = drawn.lambert(LIGHTS)
    there.series(np.where(light > 0.0031308, 1.055 * light ** (1 / 2.4) - 0.055, 12.92 * light), bits=8)
    made = imported(there)
    assert images.read_channels(made.folder / made.files[0])["R"].dtype == np.float16
    assert normal_error(made) < 0.3
    assert "8 bits are sRGB" in made.notes["found"]["assumed"]


def test_the_wrong_response_does_not_pass(there: Drawer) -> None:
    there.series(drawn.lambert(LIGHTS), bits=8)
    assert normal_error(imported(there)) > 3


def test_a_gray_sphere_tells_response_directions_and_strengths(there: Drawer) -> None:
    power = np.linspace(0.5, 1.1, len(LIGHTS))[:, None, None]
    for folder, albedo in (("photographs/", 0.8), ("gray/", 0.9)):
        encoded = (power * drawn.lambert(LIGHTS, albedo)) ** (1 / 2.2)  # near sRGB, far from linear
        for i, picture in enumerate(encoded):
            there.put(f"../{folder}img_{i}.png", picture, 8)
    there.pictures = {path.resolve(): picture for path, picture in there.pictures.items()}
    (there.folder / "lights.txt").unlink()
    made = imported(there, gray=str(there.folder.parent / "gray"))
    assert made.lights.kind == "distant"
    assert drawn.angles(made.lights.position, LIGHTS).max() < 1.5  # no mask: the sphere is found in the pictures
    ratio = made.lights.intensity.mean(axis=1) / power[:, 0, 0]
    np.testing.assert_allclose(ratio, ratio.mean(), rtol=0.03)
    assert any(words.startswith("srgb by the gray sphere") for words in made.notes["found"]["assumed"])


def test_a_sphere_beside_the_object_is_named_by_its_mask(there: Drawer) -> None:
    there.put("../ball.png", MASK.astype(float))
    there.pictures = {path.resolve(): picture for path, picture in there.pictures.items()}
    (there.folder / "lights.txt").unlink()
    made = imported(there, gray=str((there.folder / "../ball.png").resolve()))
    assert drawn.angles(made.lights.position, LIGHTS).max() < 0.5
    assert "linear by the gray sphere" in made.notes["found"]["assumed"][0]


def test_a_mirror_sphere_replaces_a_wrong_list_and_says_how_wrong(there: Drawer) -> None:
    chrome, turn = Drawer(there.folder.parent / "chrome"), np.radians(4)
    chrome.series(drawn.mirror(LIGHTS), bits=8)
    chrome.put("mask.png", np.isfinite(drawn.normals(**drawn.MIRROR)[..., 0]).astype(float))
    there.pictures |= chrome.pictures
    turned = LIGHTS @ np.array([[1, 0, 0], [0, np.cos(turn), np.sin(turn)], [0, -np.sin(turn), np.cos(turn)]])
    there.text("lights.txt", listed(turned))
    made = imported(there, chrome=str(chrome.folder))
    assert drawn.angles(made.lights.position, LIGHTS).max() < 0.5
    apart = drawn.angles(turned, LIGHTS).mean()
    assert made.notes["found"]["light_mae_deg"] == pytest.approx(apart, abs=0.2)


def test_the_gray_sphere_decides_between_list_and_mirror(there: Drawer) -> None:
    for name, pictures, ball in (
        ("chrome", drawn.mirror(LIGHTS[:, [1, 0, 2]]), drawn.MIRROR),
        ("gray", drawn.lambert(LIGHTS), {}),
    ):
        sphere = Drawer(there.folder.parent / name)
        sphere.series(pictures)
        sphere.put("mask.png", np.isfinite(drawn.normals(**ball)[..., 0]).astype(float))
        there.pictures |= sphere.pictures
    made = imported(there, chrome=str(there.folder.parent / "chrome"), gray=str(there.folder.parent / "gray"))
    found = made.notes["found"]
    assert found["directions"] == "list"  # the mirror's photographs are of other lights
    assert found["gray_error_pct"]["list"] < 0.5 < 3 < found["gray_error_pct"]["mirror sphere"]
    np.testing.assert_allclose(made.lights.position, LIGHTS, atol=1e-6)


def test_spheres_in_other_numbers_or_under_near_lights_are_told(there: Drawer) -> None:
    few = Drawer(there.folder.parent / "few")
    few.series(drawn.lambert(LIGHTS[:5]))
    there.pictures |= few.pictures
    with pytest.raises(LightsphereError, match="under 5 lights, the object's are 12"):
        imported(there, gray=str(few.folder))
    there.series(drawn.lambert(LIGHTS))
    sphere = Drawer(there.folder.parent / "gray")
    sphere.series(drawn.lambert(LIGHTS))
    for name in ("img_7.png", "mask.png"):
        sphere.put(name, np.ones((5, 6)))
        there.pictures |= sphere.pictures
        with pytest.raises(
            LightsphereError, match=r"of the sphere is .* all need the same size|not a circle|too small"
        ):
            imported(there, gray=str(sphere.folder))
    with pytest.raises(LightsphereError, match="nowhere is no folder"):
        imported(there, chrome="nowhere")


def test_exposure_times_scale_the_lights(there: Drawer) -> None:
    for i, picture in enumerate(drawn.lambert(LIGHTS)):
        time = 2.0 ** (i % 3 - 1)
        there.put(f"img_{i}.png", picture * time / 2, 16, seconds=time)
    made = imported(there)
    assert normal_error(made) < 0.01
    assert made.lights.intensity[0, 0] / made.lights.intensity[2, 0] == pytest.approx(1 / 4)


def test_the_lens_that_the_files_name_is_the_cameras_unless_another_is_stated(there: Drawer) -> None:
    def took(*lenses: float | None) -> None:
        for i, path in enumerate(sorted(there.folder.glob("img_*"))):
            there.pictures[path] = dataclasses.replace(there.pictures[path], focal=lenses[i % len(lenses)])

    width = MASK.shape[1]
    assert imported(there).camera.model == "orthographic"
    took(35.0, None)
    for file in (there.folder.parent / "capture").iterdir():
        file.unlink()
    made = imported(there)
    assert (made.camera.model, made.camera.focal[0]) == ("pinhole", pytest.approx(35 / 36 * width))
    assert any("35 mm" in words for words in made.notes["found"]["assumed"])
    took(35.0, 50.0)
    for file in (there.folder.parent / "capture").iterdir():
        file.unlink()
    assert imported(there, focal=70.0).camera.focal[0] == pytest.approx(70 / 36 * width)
    with pytest.raises(LightsphereError, match="another capture, or one imported otherwise"):
        imported(there, focal=85.0)
    for file in (there.folder.parent / "capture").iterdir():
        file.unlink()
    with pytest.raises(LightsphereError, match="lenses of 35 to 50 mm"):
        imported(there)


def test_merged_exposures_bring_back_what_single_ones_lose(there: Drawer) -> None:
    bright = drawn.lambert(LIGHTS) * 4
    (there.folder / "exposures.txt").write_text("")
    for i, picture in enumerate(bright):
        there.put(f"img_{i}.png", picture, 8)
    assert normal_error(imported(there, response="linear")) > 5  # clipped
    for i, picture in enumerate(bright):
        (there.folder / f"img_{i}.png").unlink()
        for time in (0.2, 0.02):
            there.put(f"img_{i}_exp_{time}.png", picture * time, 8)
    for file in (there.folder.parent / "capture").iterdir():
        file.unlink()
    made = imported(there, response="linear")
    assert sorted(made.notes["exposures"][0]) == [0.02, 0.2]
    assert normal_error(made) < 0.3


def test_ambient_light_is_taken_off(there: Drawer) -> None:
    room = np.random.default_rng(0).uniform(0.05, 0.15, MASK.shape)
    there.series(drawn.lambert(LIGHTS) + room)
    assert normal_error(imported(there)) > 1
    there.put("ambient.png", room)
    with pytest.raises(LightsphereError, match="holds another capture"):
        imported(there)
    (there.folder.parent / "capture" / "capture.json").unlink()
    assert normal_error(imported(there)) < 0.01


def test_true_normals_are_kept_for_figures_alone(tmp_path: Path) -> None:
    path = tmp_path / "stack.npz"
    np.savez(path, images=drawn.lambert(LIGHTS), lights=LIGHTS, mask=MASK, normal_gt=drawn.normals())
    settings = ImportSettings()
    made = finish(develop(find(path, settings, Drawer(tmp_path).read), path, tmp_path / "capture", settings))
    truth = made.truth()
    assert truth is not None
    assert np.isnan(truth.depth).all() and np.isnan(truth.position).all() and not truth.material.any()
    np.testing.assert_allclose(truth.normal[MASK], drawn.normals()[MASK], atol=1e-6)
    assert np.isnan(truth.normal[~MASK]).all()
    assert "saturation" not in made.notes  # floats have no full scale
    assert normal_error(made) < 0.01


def test_the_same_import_again_keeps_what_is_there_and_mends_what_is_damaged(there: Drawer) -> None:
    made = imported(there)
    written = {path: path.stat().st_mtime_ns for path in made.folder.iterdir()}
    assert imported(there).notes == made.notes
    assert {path: path.stat().st_mtime_ns for path in made.folder.iterdir()} == written
    content = (made.folder / made.files[1]).read_bytes()
    (made.folder / made.files[1]).write_bytes(b"")
    imported(there)
    assert (made.folder / made.files[1]).read_bytes() == content
    there.put("img_4.png", np.zeros(MASK.shape))
    with pytest.raises(LightsphereError, match="holds another capture"):
        imported(there)


def test_without_a_mask_the_lit_pixels_are_the_object(there: Drawer) -> None:
    (there.folder / "mask.png").unlink()
    mask = imported(there).mask()
    assert not mask[~MASK].any()
    assert mask.sum() > 0.9 * MASK.sum()


def spoil(there: Drawer, what: str) -> None:
    small = np.zeros((5, 6))
    if what == "size":
        there.put("img_7.png", small)
    elif what == "nan":
        there.put("img_7.png", np.full(MASK.shape, np.nan), 32)
    elif what == "damaged":
        del there.pictures[there.folder / "img_7.png"]
    elif what == "mask size":
        there.put("mask.png", small + 1)
    elif what == "mask":
        there.put("mask.png", np.zeros(MASK.shape))
    elif what == "ambient size":
        there.put("ambient.png", small)
    elif what == "saturated":
        there.series(np.minimum(drawn.lambert(LIGHTS) * 1000, 1))
    elif what == "black":
        there.series(np.zeros((len(LIGHTS), *MASK.shape)))
    elif what == "no object":
        there.series(np.zeros((len(LIGHTS), *MASK.shape)))
        (there.folder / "mask.png").unlink()
    elif what == "behind":
        there.text("lights.txt", listed(-LIGHTS))


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("size", r"img_7\.png is 6x5 pixels, img_0\.png 96x96"),
        ("nan", r"img_7\.png holds values that are not numbers"),
        ("damaged", r"img_7\.png is damaged"),
        ("mask size", r"mask\.png is 6x5 pixels"),
        ("mask", r"mask\.png is black"),
        ("ambient size", "ambient picture differs in size"),
        ("saturated", "saturated in nearly every photograph"),
        ("black", "black in every photograph"),
        ("no object", "show no object"),
        ("behind", "every light stands behind"),
    ],
)
def test_photographs_that_cannot_be_used_are_told(there: Drawer, what: str, said: str) -> None:
    spoil(there, what)
    with pytest.raises(LightsphereError, match=said):
        imported(there)
    assert not (there.folder.parent / "capture" / "capture.json").exists()


@pytest.mark.parametrize(
    ("lights", "said"),
    [
        (LIGHTS[:2], "2 lights do not determine a normal"),
        (LIGHTS * [1, 1e-3, 1], "lie in one plane"),
        (np.concatenate([LIGHTS[:5], LIGHTS[2:3]]), "lights 3 and 6 coincide"),
        (np.concatenate([LIGHTS[:5], [[0.6, 0, -0.8]]]), "light 6 stands behind"),
    ],
)
def test_lights_of_little_use_are_warned_of(tmp_path: Path, lights: np.ndarray, said: str) -> None:
    there = Drawer(tmp_path / "photographs")
    there.series(drawn.lambert(LIGHTS[: len(lights)]))
    there.text("lights.txt", listed(lights))
    warnings = imported(there).notes["found"]["warnings"]
    assert any(said in warning for warning in warnings), warnings


def test_a_sensor_of_fewer_bits_clips_below_full_scale(there: Drawer) -> None:
    clip = 4095 * 16 / 65535  # 12 bits in a file of 16
    there.series(np.minimum(drawn.lambert(LIGHTS) * 1.4, clip))
    made = imported(there)
    assert made.notes["saturation"] == pytest.approx(clip, rel=1e-4)
    assert 1 < made.notes["found"]["saturated_pct"] < 60
