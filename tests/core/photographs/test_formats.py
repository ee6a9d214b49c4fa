"""What lies in a folder is recognised, and which photograph belongs to which light."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from pipeline.core.camera import Camera
from pipeline.core.errors import LightsphereError
from pipeline.core.photographs.develop import framing
from pipeline.core.photographs.formats import find
from pipeline.core.photographs.photographs import Photographs
from pipeline.core.photographs.settings import ImportSettings
from tests import photographed as drawn
from tests.photographed import Drawer, listed

LIGHTS = drawn.directions(4)
GRAY = np.full((3, 4), 0.5)


@pytest.fixture
def there(tmp_path: Path) -> Drawer:
    return Drawer(tmp_path)


def found(there: Drawer, path: Path | None = None, **settings: Any) -> Photographs:
    return find(path or there.folder, ImportSettings(**settings), there.read)


def names(made: Photographs) -> list[list[str]]:
    return [[shot.name for shot in shots] for shots in made.shots]


def refused(there: Drawer, said: str, path: Path | None = None, **settings: Any) -> None:
    with pytest.raises(LightsphereError, match=said):
        found(there, path, **settings)


def test_photographs_alone_are_uncalibrated_in_the_order_of_their_numbers(there: Drawer) -> None:
    there.series(np.zeros((11, 3, 4)), "light{}.png")
    for extra in ("light_mask.png", "shading.png", "albedo.png", "ambient.png"):
        there.put(extra, GRAY)
    there.text("notes.txt", "hello")
    made = found(there)
    assert (made.format, made.lights.kind) == ("uncalibrated", "unknown")
    assert names(made) == [[f"light{i}.png"] for i in range(11)]
    assert made.mask is not None and made.mask.name == "light_mask.png"
    assert made.ambient is not None and made.ambient.name == "ambient.png"


def test_photographs_without_numbers_are_all_taken(there: Drawer) -> None:
    for name in ("left.jpg", "right.jpg", "above.jpg", "readme.png"):
        there.put(name, GRAY)
    assert names(found(there)) == [["above.jpg"], ["left.jpg"], ["right.jpg"]]


def test_raw_goes_before_the_jpeg_beside_it(there: Drawer) -> None:
    for suffix in ("JPG", "NEF"):
        there.series(GRAY[None].repeat(3, 0), f"DSC_000{{}}.{suffix}")
    assert names(found(there)) == [["DSC_0000.NEF"], ["DSC_0001.NEF"], ["DSC_0002.NEF"]]


def test_two_series_of_one_size_are_not_guessed(there: Drawer) -> None:
    there.series(np.zeros((3, 3, 4)), "raw_{}.png")
    there.series(np.zeros((3, 3, 4)), "jpg_{}.png")
    refused(there, "several series of pictures .*--pictures")
    assert names(found(there, pictures="raw_*.png"))[0] == ["raw_0.png"]
    refused(there, "no picture named x", pictures="x*")


def test_an_rti_list_names_its_pictures(there: Drawer) -> None:
    order = ["IMG 2.jpg", r"C:\dome\IMG 0.tif", "IMG 3.jpg", "old/IMG 1.jpg"]
    there.series(np.zeros((4, 3, 4)), "IMG {}.jpg")
    path = there.text("dome.lp", "4\n" + listed(LIGHTS, order))
    for made in (found(there), found(there, path)):
        assert made.format == "lp"
        assert names(made) == [[f"IMG {i}.jpg"] for i in (2, 0, 3, 1)]
        np.testing.assert_allclose(made.lights.position, LIGHTS, atol=1e-8)
    (there.folder / "IMG 3.jpg").unlink()
    refused(there, "names IMG 3.jpg, but no such photograph")


def test_a_list_that_names_a_picture_twice_is_refused(there: Drawer) -> None:
    there.series(np.zeros((4, 3, 4)))
    there.text("dome.lp", listed(LIGHTS, ["img_0.png", "img_1.png", "img_1.jpg", "img_2.png"]))
    refused(there, "names img_1.png twice")


def test_positions_in_a_list_are_taken_as_directions(there: Drawer) -> None:
    there.series(np.zeros((4, 3, 4)))
    there.text(
        "lights.csv", "name,x,y,z\n" + listed(LIGHTS * 250, [f"img_{i}.png" for i in range(4)]).replace(" ", ",")
    )
    made = found(there)
    assert made.lights.kind == "distant"
    np.testing.assert_allclose(made.lights.position, LIGHTS, atol=1e-6)
    assert any("taken as directions" in words for words in made.assumed)


def test_intensities_of_a_list_are_kept(there: Drawer) -> None:
    there.series(np.zeros((4, 3, 4)))
    entries = [{"position": light.tolist(), "intensity": [1, 2, i + 1]} for i, light in enumerate(LIGHTS)]
    there.text("lights.json", json.dumps(entries))
    made = found(there)
    assert made.lights.intensity[:, 2].tolist() == [1, 2, 3, 4]
    assert not made.assumed


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 0 1\n0 1 1\n", "lists 2 lights, but .* photographs of 4"),
        ("1 0 1\n0 1 1\n0 0 0\n0 0 1\n", "light 3 is zero"),
        ("1 0 1\n0 1 nan\n0 0 1\n0 1 1\n", "light 2 is zero or not a number"),
        ("1 0 1\n0 1 1\n0 0 1\n0 1 x\n", "line 4: 'x' is not a number"),
        ("1 0 1 -1\n0 1 1 1\n0 0 1 1\n0 1 1 1\n", "light 0 has no positive intensity"),
    ],
)
def test_a_list_that_cannot_be_is_refused(there: Drawer, text: str, said: str) -> None:
    there.series(np.zeros((4, 3, 4)))
    there.text("lights.txt", text)
    refused(there, said)


def test_two_lists_are_not_guessed(there: Drawer) -> None:
    there.series(np.zeros((4, 3, 4)))
    for name in ("a.lp", "b.lp"):
        there.text(name, listed(LIGHTS, [f"img_{i}" for i in range(4)]))
    refused(there, "several lists of lights .*--lights")
    assert found(there, lights=str(there.folder / "b.lp")).format == "lp"


@pytest.mark.parametrize("layout", ["names", "fractions", "folders", "bracket"])
def test_exposures_of_a_light_are_found(there: Drawer, layout: str) -> None:
    times = (0.0125, 0.1, 1.0)
    for light in range(2):
        for i, (time, part) in enumerate(zip(times, ("1-80", "1-10", "1"), strict=True)):
            name = {
                "names": f"light_{light:03d}_exp_{time}.png",
                "fractions": f"l{light} exposure{part}s.png",
                "folders": f"light {light}/shot_{i}.png",
                "bracket": f"IMG_{3 * light + i:04d}.png",
            }[layout]
            path = there.put(name, GRAY)
            if layout in ("folders", "bracket"):
                with (path.parent / "exposures.txt").open("a") as file:
                    file.write(f"{path.name} {time}\n")
    made = found(there, bracket=3 if layout == "bracket" else 1)
    assert [sorted(shot.seconds or 0 for shot in shots) for shots in made.shots] == [list(times), list(times)]


def test_brackets_that_do_not_come_out_even_are_told(there: Drawer) -> None:
    there.series(np.zeros((4, 3, 4)))
    refused(there, "4 photographs, which is no multiple of --bracket 3", bracket=3)


@pytest.mark.parametrize("line", ["img_0.png", "img_0.png soon", "img_0.png 0", "img_0.png inf"])
def test_exposure_times_that_are_none_are_told(there: Drawer, line: str) -> None:
    there.series(np.zeros((2, 3, 4)))
    there.text("exposures.txt", f"# times\n{line}\n")
    refused(there, r"exposures\.txt line 2 is not NAME SECONDS")


def diligent(there: Drawer, normal: np.ndarray | None = None) -> None:
    there.series(np.full((4, 3, 4), 0.25), "00{}.png")
    there.put("mask.png", np.ones((3, 4)))
    there.text("filenames.txt", "\n".join(f"00{i}.png" for i in (1, 0, 2, 3)))
    there.text("light_directions.txt", listed(LIGHTS))
    there.text("light_intensities.txt", "1 2 3\n" * 4)
    if normal is not None:
        savemat(there.folder / "Normal_gt.mat", {"Normal_gt": normal})


def test_a_diligent_folder_is_recognised(there: Drawer) -> None:
    normal = np.zeros((3, 4, 3))
    normal[1:, :, 2] = 1
    diligent(there, normal)
    made = found(there)
    assert made.format == "diligent"
    assert names(made)[:2] == [["001.png"], ["000.png"]]
    assert (made.lights.intensity == [1, 2, 3]).all()
    assert made.normal is not None
    assert np.isnan(made.normal[0]).all() and (made.normal[1:, :, 2] == 1).all()


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("filenames.txt", "001.png\n", "names 1 pictures, 4 directions and 4 intensities"),
        ("filenames.txt", "000.png 001.png 002.png 009.png", r"009\.png is missing \(1 of 4"),
        ("light_intensities.txt", "1 2\n" * 4, "2 columns"),
        ("light_intensities.txt", "nothing", "not a table"),
        ("light_directions.txt", "0 0 1\n0 0 1\n0 0 0\n0 0 1\n", "light 3 is zero"),
        ("Normal_gt.mat", "damaged", r"Normal_gt\.mat cannot be read"),
    ],
)
def test_a_damaged_diligent_folder_is_told(there: Drawer, name: str, text: str, said: str) -> None:
    diligent(there)
    there.text(name, text)
    refused(there, said)


def test_near_lights_of_a_matlab_rig_turn_into_metres_and_our_axes(there: Drawer) -> None:
    there.series(np.zeros((2, 3, 4)))
    position = np.array([[10.0, 20.0, -30.0], [-40.0, 50.0, 60.0]])
    axis = np.array([[0, 0, 1.0], [0, 1.0, 0]])
    values = {"S": position, "Phi": np.array([[1, 2, 3], [4, 5, 6]]), "mu": [[0.0], [1.5]], "Dir": axis}
    savemat(there.folder / "light.mat", values)
    savemat(there.folder / "camera.mat", {"K": np.array([[900.0, 0, 2.5], [0, 901.0, 2.0], [0, 0, 1]]).T})
    made = found(there)
    assert (made.format, made.lights.kind) == ("near", "near")
    np.testing.assert_allclose(made.lights.position, position * [1e-3, -1e-3, -1e-3])
    assert made.lights.intensity.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert made.camera is not None
    assert (made.camera.focal, made.camera.centre) == ((900.0, 901.0), (2.0, 1.5))
    assert made.notes["anisotropy"]["mu"] == [0, 1.5]
    assert made.notes["anisotropy"]["axis"][0] == [0, 0, -1]
    savemat(there.folder / "light.mat", {"Phi": np.ones(2)})
    refused(there, r"light\.mat lacks or misshapes 'S'")


def test_near_lights_in_json_keep_the_camera(there: Drawer) -> None:
    there.series(np.zeros((2, 3, 4)))
    camera = Camera("pinhole", np.eye(4), (4, 3), (9.0, 9.0), (2.0, 1.5))
    lights = [{"position": [0.1, 0.2, -0.1], "file": "img_1.png"}, {"position": [0, 0.3, 0], "file": "img_0.png"}]
    there.text("lights.json", json.dumps({"camera": camera.as_json(), "lights": lights}))
    made = found(there)
    assert made.camera is not None and made.camera.as_json() == camera.as_json()
    assert names(made) == [["img_1.png"], ["img_0.png"]]
    assert made.lights.position.tolist() == [[0.1, 0.2, -0.1], [0, 0.3, 0]]


@pytest.mark.parametrize("turned", [False, True], ids=["lights first", "lights last"])
def test_a_stack_is_read_in_both_orders(there: Drawer, turned: bool) -> None:
    images = np.random.default_rng(0).integers(0, 65536, (4, 5, 7, 3)).astype(np.uint16)
    path = there.folder / "stack.npz"
    stored = np.moveaxis(images, 0, -1) if turned else images
    np.savez(path, images=stored, lights=LIGHTS.T, mask=np.ones((5, 7), np.bool_), normal_gt=np.ones((5, 7, 3)))
    made = found(there, path)
    assert (made.format, len(made.shots), made.lights.kind) == ("stack", 4, "distant")
    picture = made.shots[2][0].read()
    assert picture.bits == 16
    np.testing.assert_allclose(picture.pixels * 65535, images[2], atol=0.01)
    assert made.normal is not None and np.isnan(made.normal).all()  # of length 1.7


def test_a_stack_of_images_alone_takes_a_list_of_lights(there: Drawer) -> None:
    path = there.folder / "stack.npy"
    np.save(path, np.zeros((4, 5, 7), np.float32))
    assert found(there, path).lights.kind == "unknown"
    there.text("lights.txt", listed(LIGHTS))
    made = found(there, path, lights=str(there.folder / "lights.txt"))
    assert made.lights.kind == "distant" and made.shots[0][0].read().pixels.shape == (5, 7, 3)


@pytest.mark.parametrize(
    ("arrays", "said"),
    [
        ({"pixels": np.zeros((4, 5, 7))}, "needs the images"),
        ({"images": np.zeros((5, 7))}, "images are 5x7"),
        ({"images": np.zeros((3, 5, 7)), "lights": LIGHTS}, "3x5x7, but 4 lights"),
        ({"images": np.zeros((4, 5, 7, 2)), "lights": LIGHTS}, "2 colours"),
        ({"images": np.zeros((4, 5, 7)), "lights": np.zeros((4, 2))}, "lights are 4x2"),
        ({"images": np.zeros((4, 5, 7)), "lights": np.zeros((4, 3))}, "light 1 is zero"),
    ],
)
def test_a_stack_that_does_not_fit_is_told(there: Drawer, arrays: dict[str, Any], said: str) -> None:
    path = there.folder / "stack.npz"
    np.savez(path, **arrays)
    refused(there, said, path)


def test_what_is_no_input_is_told(there: Drawer) -> None:
    refused(there, "holds no photographs")
    refused(there, "does not exist", there.folder / "nowhere")
    refused(there, "no known format", there.text("a.txt", "x"))
    refused(there, "no .npz", there.text("a.npz", "x"))
    np.savez(there.folder / "b.npz", images=np.zeros((4, 5, 7)))
    (there.folder / "b.npz").write_bytes((there.folder / "b.npz").read_bytes()[:300])
    refused(there, "damaged", there.folder / "b.npz")
    refused(there, "missing; correct --lights", lights="nowhere.txt")
    there.series(np.zeros((2, 3, 4)))
    refused(there, "has no list of lights", format="folder")
    there.text("capture.json", "{}")
    refused(there, "is a capture already")


@pytest.mark.parametrize("focal", [0.0, 50.0])
def test_stated_focal_length_is_the_cameras(focal: float) -> None:
    """The object's extent is 1 m about the origin, and a picture 36 mm wide is 2 atan(18 / focal) wide."""
    mask = np.zeros((40, 60), bool)
    mask[10:30, 5:55] = True
    camera = framing(mask, focal)
    edges, _ = camera.project(np.array([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]]))
    assert np.ptp(edges[:, 0]) == pytest.approx(50)
    if focal:
        assert camera.resolution[0] / camera.focal[0] / 2 == pytest.approx(18 / focal)
