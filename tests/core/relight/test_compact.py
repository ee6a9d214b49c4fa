"""A capture and its shape in one small file: what it says of itself, and pictures that are relit from it."""

from __future__ import annotations

import dataclasses
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.capture import Capture
from pipeline.core.compare.pictures import relative_rmse
from pipeline.core.errors import LightsphereError
from pipeline.core.progress import finish
from pipeline.core.relight import RelightSettings, compact, remainder
from pipeline.core.relight.emitters import point
from pipeline.core.relight.render import prepare, relit
from pipeline.core.shape import Shape
from tests import synthetic

MEMORY = 500.0
NEW = point([0.9, -0.7, 2.1], [1.0] * 3)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Capture, Shape]:
    shape = synthetic.ball(synthetic.camera(48))
    folder = tmp_path_factory.mktemp("capture")
    return synthetic.write_capture(folder, shape, np.array([0.6, 0.4, 0.2]), np.full(3, 0.3), 0.3), shape


def under_new_light(capture: Capture, shape: Shape) -> NDArray[np.float32]:
    return finish(relit(finish(prepare(capture, shape, RelightSettings())), [NEW]))


def test_a_file_relights_like_its_capture(made: tuple[Capture, Shape], tmp_path: Path) -> None:
    path = tmp_path / "small.npz"
    told = finish(compact.write(path, *made, rate=10, memory=MEMORY))
    assert told["bytes"] == path.stat().st_size
    assert told["rate"] == pytest.approx(6 * made[0].mask().sum() * len(made[0]) / told["bytes"])
    assert told["rate"] >= 10
    capture, shape = compact.read(path)
    assert relative_rmse(under_new_light(capture, shape), under_new_light(*made)) < 0.01
    mask = made[0].mask()
    seen, kept = (np.stack([one.image(n)[mask] for n in range(len(one))]) for one in (made[0], capture))
    assert told["coded_rel_rmse"] == pytest.approx(np.linalg.norm(kept - seen) / np.linalg.norm(seen), rel=1e-3)
    assert told["coded_rel_rmse"] < 0.01
    assert np.array_equal(np.isfinite(shape.depth), np.isfinite(made[1].depth))
    assert np.nanmax(np.abs(shape.depth - made[1].depth)) == 0.0


def test_changes_from_pixel_to_pixel_are_exact_and_take_less_room() -> None:
    whole = np.iinfo(np.int32)
    numbers = np.array([[0, -1, whole.max, whole.min, whole.max, 7], [whole.min, 0, 1, -1, 255, -256]], np.int32)
    assert np.array_equal(compact.sums(compact.changes(numbers)), numbers)
    depth = (4.0 + np.sin(np.linspace(0.0, 9.0, 5000))).astype(np.float32)
    coded = compact.changes(depth.view(np.int32))
    assert compact.sums(coded).view(np.float32).tobytes() == depth.tobytes()
    assert len(zlib.compress(coded.tobytes())) < 0.8 * len(zlib.compress(depth.tobytes()))
    assert (compact.changes(np.array([3, 2, 4, 4], np.int32))[1:] == 0).all()  # falling ones need no upper bytes either


def test_what_is_not_expected_of_a_surface_is_kept_too(made: tuple[Capture, Shape], tmp_path: Path) -> None:
    """A stripe that glows in the dark, and a square that is 1.7 times as bright to one side: no lobe says that."""

    class Odd(Capture):
        def image(self, light: int) -> NDArray[np.float32]:
            seen = super().image(light).copy()
            seen[20:24] += np.float32(0.02) * self.mask()[20:24, :, None]
            if self.lights.position[light, 0] > 0:
                seen[28:36, 16:30] *= np.float32(1.7)
            return seen

    odd = Odd(**{field.name: getattr(made[0], field.name) for field in dataclasses.fields(made[0])})
    fine, coarse = (
        finish(compact.write(tmp_path / f"{rate}.npz", odd, made[1], rate=rate, memory=MEMORY))["coded_rel_rmse"]
        for rate in (5, 1000)
    )
    assert fine < 0.05
    assert coarse > 3 * fine


def test_some_of_the_lights_are_those_of_the_whole(made: tuple[Capture, Shape], tmp_path: Path) -> None:
    finish(compact.write(tmp_path / "a.npz", *made, rate=10, memory=MEMORY))
    capture, _ = compact.read(tmp_path / "a.npz")
    chosen = np.array([7, 3])
    np.testing.assert_array_equal(capture.select(chosen).image(1), capture.image(3))


@pytest.mark.parametrize("keep", [0, 100, -20])
def test_a_damaged_file_is_told(made: tuple[Capture, Shape], tmp_path: Path, keep: int) -> None:
    path = tmp_path / "a.npz"
    finish(compact.write(path, *made, rate=10, memory=MEMORY))
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(LightsphereError, match="no relightable file"):
        compact.read(path)


@pytest.mark.parametrize("name", ["weights", "lit", "octave", "low", "basis", "depth"])
def test_arrays_that_do_not_belong_together_are_told(made: tuple[Capture, Shape], tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.npz"
    finish(compact.write(path, *made, rate=5, memory=MEMORY))
    with np.load(path) as kept:
        arrays = dict(kept)
    arrays[name] = arrays[name][..., :-1] if name != "basis" else arrays[name][:-1]
    np.savez_compressed(path, **arrays)
    with pytest.raises(LightsphereError, match="no relightable file"):
        compact.read(path)


def test_what_is_saturated_is_as_expected(made: tuple[Capture, Shape], tmp_path: Path) -> None:
    light = int(np.argmax([made[0].image(n).max() for n in range(len(made[0]))]))
    whole = made[0].image(light)
    cut = dataclasses.replace(made[0], notes={"saturation": float(whole.max()) / 2})
    finish(compact.write(tmp_path / "a.npz", cut, made[1], rate=5, memory=MEMORY))
    found = compact.read(tmp_path / "a.npz")[0].image(light)
    over = (whole > whole.max() / 2).any(axis=-1)
    assert over.any()
    assert relative_rmse(found, whole, ~over & made[0].mask()) < 0.01
    assert found[over].max() > whole.max() / 2  # a highlight that no picture has, told from the others


def test_numbers_take_the_bytes_that_they_may_and_no_more() -> None:
    random = np.random.default_rng(5)
    rest = (random.normal(size=(900, 5)) @ random.normal(size=(5, 90))).reshape(900, 30, 3).astype(np.float32)
    lost = []
    for size in (15_000, 60_000):
        arrays = finish(remainder.coded(rest, size))
        found = remainder.decoded(arrays)
        decoded = np.stack([np.broadcast_to(found.of(light), (900, 3)) for light in range(30)], axis=1)
        lost.append(float(np.sqrt(np.square(decoded - rest).mean() / np.square(rest).mean())))
    assert lost[1] < 0.02
    assert lost[0] > 4 * lost[1]
    nothing = remainder.decoded(finish(remainder.coded(rest, -1.0)))
    assert np.array_equal(nothing.of(3), np.zeros((1, 1)))
