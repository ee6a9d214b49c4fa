"""Samples a second of a capture of small pictures against one large render of as many samples on the same cores.

Run as ``.venv-3.13/bin/python tests/benchmarks/capture_throughput.py [PICTURES]`` with the Python that ``bootstrap.py``
set up. The bar is 85 % at 128x128 with two workers.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import os
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from pipeline.blender import capture, cycles, lamps, scene
from pipeline.core.capture_settings import CaptureSettings
from pipeline.core.progress import finish

SCENE = "teapot-metal"
RESOLUTION = 128
BAR = 85


def main() -> None:
    """Print both rates and their ratio, by the clock and by processor time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pictures", type=int, nargs="?", default=1600, help="how many small pictures (default: 1600)")
    pictures: int = parser.parse_args().pictures
    inner = pictures * 4 // 5
    settings = CaptureSettings(inner=inner, outer=pictures - inner, resolution=RESOLUTION, effects="direct", workers=2)
    settings = dataclasses.replace(settings, renderer="cycles")
    side = round(RESOLUTION * math.sqrt(pictures))
    with tempfile.TemporaryDirectory() as folder:
        small = _capture(Path(folder), settings)
        large = _render(Path(folder), settings, side)
    print(f"{pictures} pictures of {RESOLUTION}x{RESOLUTION} by 2 workers against one of {side}x{side}, EXR written")
    print(f"{'':24}{'small pictures':>16}{'large picture':>16}{'ratio':>8}")
    for name, few, many in zip(("by the clock", "by processor time"), small, large, strict=True):
        rates = pictures * RESOLUTION**2 / few / 1e6, side**2 / many / 1e6
        ratio = 100 * rates[0] / rates[1]
        print(f"{name:24}{rates[0]:9.3f} Msamples/s{rates[1]:9.3f} Msamples/s{ratio:6.0f} %  (bar: {BAR} %)")


def _capture(folder: Path, settings: CaptureSettings) -> tuple[float, float]:
    loaded = scene.load(SCENE)
    before = _now()
    finish(capture.capture(loaded, SCENE, folder / "capture", settings))
    return _since(before)


def _render(folder: Path, settings: CaptureSettings, side: int) -> tuple[float, float]:
    loaded = scene.load(SCENE)
    described = capture.describe(loaded, SCENE, folder, settings)
    with (
        cycles.measuring(loaded, described.camera.resized(side), cycles.DIRECT, threads=2),
        cycles.openexr(loaded),
        cycles.meshes_cached(loaded),
        lamps.lamp(loaded, "near") as lamp,
    ):
        lamps.shine(lamp, described.lights, settings.inner // 3)
        before = _now()
        cycles.render(loaded, folder / "large.exr")
        return _since(before)


def _now() -> tuple[float, float]:
    times = os.times()
    return times.elapsed, times.user + times.system + times.children_user + times.children_system


def _since(before: tuple[float, float]) -> tuple[float, float]:
    now = _now()
    return now[0] - before[0], now[1] - before[1]


if __name__ == "__main__":
    main()
