"""Every bar that depth is held to, on captures of the built-in teapots: error, confidence, time and memory.

Run as ``.venv-3.13/bin/python tests/benchmarks/depth_bars.py [--cache FOLDER] [--full] [--source] [--memory]`` with the
Python that ``bootstrap.py`` set up. Captures are made where the folder does not hold them yet: 100x100 pixels, 320 and
80 lights at 2 and 3 m, direct light. ``--full`` adds full light transport (its capture takes several minutes),
``--source`` the original objective for comparison, and ``--memory`` a solve at 512x512. All solves use the default
settings; kernels are compiled before the first.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from pipeline import cli
from pipeline.core.camera import Camera
from pipeline.core.capture import Capture
from pipeline.core.compare.shapes import shape_errors
from pipeline.core.progress import finish
from pipeline.core.shape import Shape
from pipeline.core.shape.double_sphere import recover
from pipeline.core.shape.settings import ShapeSettings
from pipeline.core.tradeoff.thinning import thinned

RIG = ("--inner", "320", "--outer", "80", "--radius-inner", "2", "--radius-outer", "3", "--resolution", "100")
THIRDS = 0.25  # the highest confidence third's 95th percentile over the lowest third's, at most
MEMORY_MB = 3000
SIDE = 512
TIMED_SIDE = 200  # four teapots of the 100x100 captures: some 11,000 object pixels
SEED = 7_654_321
Change = Callable[[NDArray[np.float32], int], NDArray[np.float32]]


@dataclass(frozen=True)
class Bar:
    """What a capture is held to: percentages of the diameter; infinite for no bar."""

    label: str
    capture: Capture
    median: float = np.inf
    p95: float = np.inf
    objective: str = "joint"


@dataclass(frozen=True)
class Changed(Capture):
    """A capture whose pictures are changed as they are read."""

    change: Change = lambda picture, light: picture

    def image(self, light: int) -> NDArray[np.float32]:
        """Read one picture and change it."""
        return self.change(super().image(light), light)


@dataclass(frozen=True)
class TiledCamera(Camera):
    """A camera whose view is repeated to a larger picture."""

    tile: Camera | None = None

    def rays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the tile's rays, repeated."""
        assert self.tile is not None
        origins, directions = self.tile.rays()
        return repeated(origins, self.resolution[0]), repeated(directions, self.resolution[0])


@dataclass(frozen=True)
class Tiled(Capture):
    """A capture whose pictures are repeated to a larger one, so that no hours are spent on rendering it."""

    tile: Capture | None = None

    def image(self, light: int) -> NDArray[np.float32]:
        """Read one picture and repeat it."""
        assert self.tile is not None
        return repeated(self.tile.image(light), self.camera.resolution[0])

    def mask(self) -> NDArray[np.bool_]:
        """Read the mask and repeat it."""
        assert self.tile is not None
        return repeated(self.tile.mask(), self.camera.resolution[0])


def repeated(picture: NDArray[Any], side: int) -> NDArray[Any]:
    times = -(-side // picture.shape[0])
    return np.tile(picture, (times, times, *[1] * (picture.ndim - 2)))[:side, :side]


def tiled(capture: Capture, side: int) -> Tiled:
    """Return the capture repeated to pictures of side x side."""
    camera = TiledCamera(**{**vars(capture.camera), "resolution": (side, side)}, tile=capture.camera)
    return Tiled(**{**vars(capture), "camera": camera}, tile=capture)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cache", type=Path, help="folder that keeps the captures (default: a temporary one)")
    parser.add_argument("--full", action="store_true", help="also capture and solve with full light transport")
    parser.add_argument("--source", action="store_true", help="also solve by the source's objective")
    parser.add_argument("--memory", action="store_true", help=f"also solve at {SIDE}x{SIDE}")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        cache = chosen.cache or Path(folder)
        first = captured(cache, "teapot-lambert")
        finish(recover(thinned(first, 40, 20), ShapeSettings()))  # compiles
        print(
            f"{'':32}{'median % (bar)':>18}{'p95 % (bar)':>18}{'found %':>9}{'high/low':>10}"
            f"{'pixels':>8}{'solve s':>9}{'CPU s':>8}  holds"
        )
        for bar in bars(cache, chosen.full, chosen.source):
            print(row(bar), flush=True)
        print("high/low: depth p95 of the highest confidence third over the lowest third's, bar 0.25.")
        print(f"Seconds include reading 400 pictures; {os.cpu_count()} cores.")
        print(exposure(captured(cache, "teapot-plastic")))
        for scene, limit in (("teapot-lambert", 6), ("teapot-metal", 60)):
            print(timing(scene, captured(cache, scene), limit), flush=True)
        if chosen.memory:
            print(memory(first))


def bars(cache: Path, full: bool, source: bool) -> Iterator[Bar]:
    """Yield what is solved, in order."""
    lambert, plastic, metal, coat, beckmann = (
        captured(cache, f"teapot-{name}") for name in ("lambert", "plastic", "metal", "coat", "beckmann")
    )
    yield Bar("Lambert", lambert, 0.02, 0.2)
    yield Bar("plastic", plastic, 0.06, 0.4)
    yield Bar("metal", metal, 0.1, 1.0)
    yield Bar("coat", coat, 0.15, 1.0)
    yield Bar("Beckmann, at least 12 lit", beckmann, 2.0)
    largest, usual = brightest(plastic)
    yield Bar("plastic, 8 bits to the largest", changed(plastic, eight_bit(largest)), 0.5)
    yield Bar("plastic, 8 bits to 99.9 %", changed(plastic, eight_bit(usual)), 0.5)
    yield Bar("metal, 1 % noise", changed(metal, noisy(metal, False)), 0.6)
    yield Bar("metal, 1 % noise, cut at 0", changed(metal, noisy(metal, True)), 0.6)
    if full:
        yield Bar("Lambert, full light transport", captured(cache, "teapot-lambert", "full"), 0.15)
    if source:
        for name, found in (("Lambert", lambert), ("plastic", plastic), ("metal", metal)):
            yield Bar(f"{name}, source's objective", found, objective="source")


def row(bar: Bar) -> str:
    """Solve and return one row of the table."""
    truth, mask = bar.capture.truth(), bar.capture.mask()
    assert truth is not None
    shape, wall, processor = solved(bar.capture, ShapeSettings(objective=bar.objective))
    errors = shape_errors(shape, truth, mask)
    median, p95, low = (errors[f"{name}_pct"] for name in ("depth_median", "depth_p95", "confidence_low_p95"))
    thirds = errors["confidence_high_p95_pct"] / low
    checks = {"median": median <= bar.median, "p95": p95 <= bar.p95, "confidence": thirds <= THIRDS}
    failed = ", ".join(name for name, held in checks.items() if not held)
    held = "-" if bar.objective == "source" else f"no: {failed}" if failed else "yes"
    return (
        f"{bar.label:32}{against(median, bar.median):>18}{against(p95, bar.p95):>18}{errors['recovered_pct']:9.1f}"
        f"{thirds:10.3f}{mask.sum():8d}{wall:9.1f}{processor:8.1f}  {held}"
    )


def timing(scene: str, capture: Capture, limit: float) -> str:
    """Solve the capture repeated to some 10,000 object pixels and return a line on the time for exactly so many."""
    larger = tiled(capture, TIMED_SIDE)
    pixels = int(larger.mask().sum())
    _, wall, processor = solved(larger, ShapeSettings())
    scaled = wall * 10_000 / pixels
    return (
        f"{scene}, 10,000 object pixels: {scaled:.1f} s (bar {limit}), from {pixels} in {wall:.1f} s, "
        f"{processor:.1f} s of processor time  {'yes' if scaled <= limit else 'no'}"
    )


def solved(capture: Capture, settings: ShapeSettings) -> tuple[Shape, float, float]:
    """Return a solve's shape, seconds and processor seconds of all threads."""
    wall, processor = time.perf_counter(), time.process_time()
    shape = finish(recover(capture, settings))
    return shape, time.perf_counter() - wall, time.process_time() - processor


def against(value: float, limit: float) -> str:
    return f"{value:.3g}" + (f" ({limit:g})" if np.isfinite(limit) else " (-)")


def captured(cache: Path, scene: str, effects: str = "direct") -> Capture:
    """Return a capture of a scene, rendered where the folder does not hold it."""
    folder = cache / (scene if effects == "direct" else f"{scene}-{effects}")
    if not (folder / "truth.exr").is_file() or Capture.open(folder).changed():
        cli.main(["capture", scene, "-o", str(folder), *RIG, "--effects", effects])
    return Capture.open(folder)


def changed(capture: Capture, change: Change) -> Capture:
    return Changed(**vars(capture), change=change)


def brightest(capture: Capture) -> tuple[float, float]:
    """Return the largest value of the object's pixels and their 99.9th percentile."""
    mask = capture.mask()
    values = np.concatenate([capture.image(i)[mask].ravel() for i in range(len(capture))])
    return float(values.max()), float(np.quantile(values, 0.999))


def exposure(capture: Capture) -> str:
    """Return a line on what 8 bits keep of the capture when its largest value is white."""
    mask = capture.mask()
    values = np.concatenate([capture.image(i)[mask].ravel() for i in range(len(capture))])
    largest, usual = brightest(capture)
    steps = 255 * float(np.median(values[values > 0])) / largest
    return (
        f"8 bits to the largest: the brightest highlight is {largest / usual:.0f} times the 99.9th percentile, so that "
        f"the median lit value is {steps:.2f} of one step: what is rounded away, no solver brings back."
    )


def eight_bit(white: float) -> Change:
    """Return a change to 255 even levels up to a white value, saturated above it."""
    return lambda picture, light: (np.round(np.clip(picture / white, 0, 1) * 255) / 255 * white).astype(np.float32)


def noisy(capture: Capture, cut: bool) -> Change:
    """Return a change that adds 1 % of each value and .1 % of the median lit value, both Gaussian."""
    mask = capture.mask()
    values = np.concatenate([capture.image(i)[mask].ravel() for i in range(len(capture))])
    floor = 1e-3 * float(np.median(values[values > 0]))

    def change(picture: NDArray[np.float32], light: int) -> NDArray[np.float32]:
        relative, absolute = np.random.default_rng((SEED, light)).standard_normal((2, *picture.shape))
        noise = picture * (1 + 0.01 * relative) + floor * absolute
        return (np.maximum(noise, 0) if cut else noise).astype(np.float32)

    return change


def memory(capture: Capture) -> str:
    """Solve the capture repeated to a large picture and return a line on the process's peak memory."""
    larger = tiled(capture, SIDE)
    pixels = int(larger.mask().sum())
    _, wall, _ = solved(larger, ShapeSettings())
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return (
        f"{SIDE}x{SIDE}, {len(capture)} lights, {pixels} object pixels: peak memory {peak:.0f} MB (bar {MEMORY_MB}), "
        f"{wall:.0f} s  {'yes' if peak <= MEMORY_MB else 'no'}"
    )


if __name__ == "__main__":
    main()
