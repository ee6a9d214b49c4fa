"""Every bar that relit pictures are held to: teapots under twelve near lights that no capture light coincides with.

Run as ``.venv-3.13/bin/python tests/benchmarks/relight_bars.py [--cache FOLDER] [--frame]`` with the Python that
``bootstrap.py`` set up. Captures are made where the folder does not hold them yet: 128x128 pixels, 320 and 80 lights at
2 and 3 m, direct light. The twelve lights stand at 1.75, 2.4 and 6 m in turn, in directions spread evenly over the part
of the sky that is more than 15 degrees above the ground; Cycles renders the reference under each. The error is
``relight_rel_rmse`` on the object's pixels, the mean over the lights; beside it what capture and shape in one file of
1/20 of their bytes make of that. ``--frame`` also times one light at 512x512.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from pipeline import cli
from pipeline.commands.relight import opened
from pipeline.core.capture import Capture
from pipeline.core.compare.pictures import relative_rmse
from pipeline.core.compare.shapes import shape_errors
from pipeline.core.progress import finish
from pipeline.core.relight import RelightSettings, compact
from pipeline.core.relight.emitters import point
from pipeline.core.relight.render import prepare, relit
from pipeline.core.relight.stack import Expected
from pipeline.core.rig import hemisphere
from pipeline.core.shape import Shape
from pipeline.core.shape.double_sphere import recover
from pipeline.core.shape.settings import ShapeSettings

RIG = ("--inner", "320", "--outer", "80", "--radius-inner", "2", "--radius-outer", "3", "--effects", "direct")
SIZE = ("--resolution", "128")
BARS = {"lambert": 0.06, "plastic": 0.06, "metal": 0.06, "coat": 0.25}
OVER_SOURCE = 0.5  # of the source's error in the same run, at most
RATE, OVER_WHOLE = 20.0, 1.15  # of a compact file, and of the error without it, at most
RADII = (1.75, 2.4, 6.0)  # inside, between and outside the two spheres
TURN = 0.7  # rad, about the vertical: away from the capture's lights
FRAME_BAR = 0.1  # s


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cache", type=Path, help="folder that keeps the captures (default: a temporary one)")
    parser.add_argument("--frame", action="store_true", help="also time a frame of 512x512 pixels")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        cache = chosen.cache or Path(folder)
        heads = "".join(
            f"{head:>12}" for head in ("error", "bar", "true depth", "source", "of 1/20", "rate", "depth % med", *RADII)
        )
        print(f"{'':10}{heads}  holds")
        for scene in BARS:
            print(row(cache, scene), flush=True)
        if chosen.frame:
            print(frame(cache))


def row(cache: Path, scene: str) -> str:
    """Relight one teapot by recovered depth, true depth and the source's rule; return a row of the table."""
    capture = captured(cache, f"relight_{scene}", scene, SIZE + RIG)
    reference = captured(
        cache, f"relight_{scene}_ref", scene, (*SIZE, "--effects", "direct", "--rig", str(list_of(cache)))
    )
    shape = solved(cache / f"relight_{scene}_shape", capture)
    truth = capture.truth()
    assert truth is not None
    errors = errors_of(capture, shape, reference, "model")
    source = errors_of(capture, shape, reference, "source").mean()
    true = errors_of(capture, opened(capture.folder, true_depth=True)[1], reference, "model").mean()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "small.npz"
        rate = finish(compact.write(file, capture, shape, RATE, RelightSettings().memory))["rate"]
        small = errors_of(*compact.read(file), reference, "model").mean()
    depth = shape_errors(shape, truth, capture.mask())["depth_median_pct"]
    failed = [
        name
        for name, held in (
            ("error", errors.mean() <= BARS[scene]),
            ("source", errors.mean() <= OVER_SOURCE * source),
            ("of 1/20", small <= OVER_WHOLE * errors.mean() and rate >= RATE),
        )
        if not held
    ]
    figures = (
        errors.mean(),
        BARS[scene],
        true,
        source,
        small,
        rate,
        depth,
        *errors.reshape(-1, len(RADII)).mean(axis=0),
    )
    return (
        f"{scene:10}"
        + "".join(f"{value:12.3g}" for value in figures)
        + f"  {'no: ' + ', '.join(failed) if failed else 'yes'}"
    )


def errors_of(capture: Capture, shape: Shape, reference: Capture, interpolation: str) -> NDArray[np.float64]:
    """Return the error under every light of the reference."""
    prepared = finish(prepare(capture, shape, RelightSettings(interpolation=interpolation)))
    mask = capture.mask()
    found = []
    for light, (place, intensity) in enumerate(zip(reference.lights.position, reference.lights.intensity, strict=True)):
        picture = finish(relit(prepared, [point(list(place), list(intensity))]))
        found.append(relative_rmse(picture, reference.image(light), mask))
    return np.array(found)


def list_of(cache: Path) -> Path:
    """Write the twelve lights and return the file."""
    cache.mkdir(parents=True, exist_ok=True)
    c, s = np.cos(TURN), np.sin(TURN)
    directions = hemisphere(16)[:12] @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    places = directions * np.resize(RADII, 12)[:, None]
    lines = [f"{x!r} {y!r} {z!r} {np.pi * (x * x + y * y + z * z)!r}" for x, y, z in places.tolist()]
    path = cache / "relight_lights.txt"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def captured(cache: Path, name: str, scene: str, words: tuple[str, ...]) -> Capture:
    """Return a capture, rendered where the folder does not hold it."""
    folder = cache / name
    if not (folder / "truth.exr").is_file() or Capture.open(folder).changed():
        cli.main(["capture", f"teapot-{scene}", "-o", str(folder), *words])
    return Capture.open(folder)


def solved(folder: Path, capture: Capture) -> Shape:
    """Return the capture's shape, recovered where the folder does not hold it."""
    if not (folder / "shape.json").is_file():
        finish(recover(capture, ShapeSettings())).save(folder)
    return Shape.open(folder)


def frame(cache: Path) -> str:
    """Time one light on the plastic teapot, its pixels repeated to a picture of 512x512."""
    capture = captured(cache, "relight_plastic", "plastic", SIZE + RIG)
    prepared = finish(prepare(capture, solved(cache / "relight_plastic_shape", capture), RelightSettings()))
    assert isinstance(prepared, Expected)
    large = repeated(prepared, 4)
    finish(relit(large, [point([2.0, -1.0, 2.0], [1.0] * 3)]))
    seconds = []
    processor = time.process_time()
    for x in np.linspace(-2, 2, 20):
        start = time.perf_counter()
        finish(relit(large, [point([float(x), -2.0, 2.0], [1.0] * 3)]))
        seconds.append(time.perf_counter() - start)
    processor = (time.process_time() - processor) / len(seconds)
    wall = float(np.median(seconds))
    return (
        f"512x512, {len(large.stack.points)} object pixels, 400 lights: {wall:.3f} s a frame (bar {FRAME_BAR}) on "
        f"{os.cpu_count()} cores, {processor:.3f} s of processor time  {'yes' if wall <= FRAME_BAR else 'no'}"
    )


def repeated(prepared: Expected, times: int) -> Expected:
    """Return a stack whose picture is repeated ``times`` in each direction."""
    s = prepared.stack
    width, height = s.resolution
    count, tiles = len(s.points), times * times
    steps = np.array([[i * height, j * width] for i in range(times) for j in range(times)])
    place = (s.place[:, None, :] + steps.T[:, :, None]).reshape(2, -1)

    def tile(array: NDArray) -> NDArray:
        return np.tile(array, (tiles, *(1,) * (array.ndim - 1)))

    stack = dataclasses.replace(
        s,
        resolution=(times * width, times * height),
        place=place,
        points=tile(s.points),
        normals=tile(s.normals),
        views=tile(s.views),
        values=tile(s.values),
    )
    shift = np.repeat(np.arange(tiles) * count, count)[:, None]
    around = tile(prepared.around)
    around = np.where(around < 0, -1, around + shift).astype(np.int32)
    return dataclasses.replace(
        prepared,
        stack=stack,
        weights=tile(prepared.weights),
        kinds=tile(prepared.kinds),
        around=around,
        reach=np.tile(prepared.reach, tiles),
        space=dataclasses.replace(prepared.space, points=tile(prepared.space.points), ahead=tile(prepared.space.ahead)),
    )


if __name__ == "__main__":
    main()
