"""Pictures of direct light in closed form against Cycles: time of a picture on one core, EXR written, and difference.

Run as ``.venv-3.13/bin/python tests/benchmarks/direct_light.py [--resolution PX ...] [SCENE ...]`` with the Python that
``bootstrap.py`` set up. The bar is eight times as fast.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np

from pipeline.blender import capture, closed_form, cycles, exr, lamps, scene
from pipeline.core.capture_settings import CaptureSettings

SCENES = ("teapot-lambert", "teapot-plastic", "teapot-metal", "teapot-beckmann", "gourd", "steps", "thin")
PICTURES = 25  # of the 400 lights
BAR = 8


def main() -> None:
    """Print a row for every scene and resolution."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--resolution", type=int, nargs="+", default=[128, 512])
    chosen = parser.parse_args()
    print(f"{'':24}{'Cycles':>10}{'closed form':>13}{'ratio':>7}{'read once':>11}{'light that differs':>20}")
    for resolution in chosen.resolution:
        for name in chosen.scenes:
            with tempfile.TemporaryDirectory() as folder:
                print(_row(name, resolution, Path(folder)), flush=True)


def _row(name: str, resolution: int, folder: Path) -> str:
    loaded = scene.load(name)
    described = capture.describe(loaded, name, folder, CaptureSettings(resolution=resolution))
    lights = range(0, len(described), len(described) // PICTURES)
    closed_form.prepare(loaded, described.camera)  # Blender, Embree and the compiler are awake
    before = time.perf_counter()
    form = closed_form.prepare(loaded, described.camera)
    read = time.perf_counter() - before

    def made(light: int) -> None:
        picture = form.picture(described.lights, light)
        exr.write(folder / f"made_{light}.exr", {c: picture[..., i] for i, c in enumerate("RGB")})

    with (
        cycles.measuring(loaded, described.camera, cycles.DIRECT, threads=1),
        cycles.openexr(loaded),
        cycles.own_lights_hidden(loaded),
        cycles.meshes_cached(loaded),
        lamps.lamp(loaded, described.lights.kind) as lamp,
    ):

        def rendered(light: int) -> None:
            lamps.shine(lamp, described.lights, light)
            cycles.render(loaded, folder / f"rendered_{light}.exr")

        rendered(lights[0])
        slow = _processor_seconds(rendered, lights)
    with exr.one_thread_each():
        made(lights[0])
        fast = _processor_seconds(made, lights)
    one, other = (
        np.stack([exr.read_rgb(folder / f"{kind}_{light}.exr") for light in lights]) for kind in ("rendered", "made")
    )
    differs = abs(one - other).sum() / one.sum()
    return (
        f"{name:16}{resolution:5} px{1e3 * slow:7.1f} ms{1e3 * fast:10.1f} ms{slow / fast:6.1f}x{read:9.2f} s"
        f"{100 * differs:18.5f} %  (bar: {BAR}x)"
    )


def _processor_seconds(work: Callable[[int], None], lights: range) -> float:
    before = time.process_time()
    for light in lights:
        work(light)
    return (time.process_time() - before) / len(lights)


if __name__ == "__main__":
    main()
