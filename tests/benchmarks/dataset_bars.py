"""Samples a second of a dataset against Cycles' own, two processes against one, and whether cost and memory stay flat.

Run as ``.venv-3.13/bin/python tests/benchmarks/dataset_bars.py [--flat SAMPLES]`` with the Python that ``bootstrap.py``
set up. Cycles' own rate is that of one large render of every sample's scene with as many pixels as all its pictures,
light paths and samples a pixel the same, on as many threads. Bars: 85 % of it at 128x128 with two processes; two
processes 1.7 times as fast as one where the work around a picture dominates; cost and memory flat to 1,000 samples. The
samples are enough that the last one, beside which a process has nothing left to do, weighs little.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from pipeline.blender import cycles, geometry, lamps, plan
from pipeline.blender.dataset import made_by, scene
from pipeline.commands.dataset import worker
from pipeline.core.dataset import folder as dataset
from pipeline.core.dataset.draw import draw, lights_of
from pipeline.core.dataset.farm import Farm
from pipeline.core.dataset.recipe import Recipe

LARGE: dict[str, Any] = {"count": 24, "seed": 1}  # 128x128, 20 to 50 lights, 32 samples, 2 bounces: the defaults
SMALL: dict[str, Any] = {"seed": 2, "camera": {"resolution": 32}, "lights": {"count": 3}, "render": {"samples": 1}}
FEW = 40  # small samples that one and two processes make


def main() -> None:
    """Print rates, ratios and bars."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else None)
    parser.add_argument("--flat", type=int, default=0, help="small samples of one process whose cost is followed")
    flat = parser.parse_args().flat
    if flat:
        _follow(flat)
        return
    recipe = Recipe.of(LARGE)
    ours = _made(recipe, 2)
    theirs = sum(_large_render(recipe, index) for index in range(recipe.count))
    print(f"{recipe.count} samples of {recipe.camera.resolution} px by 2 processes, their start left out: {ours:.1f} s")
    print(f"Cycles alone, one render for each: {theirs:.1f} s; {100 * theirs / ours:.0f} % of its rate (bar: 85 %)")
    small = Recipe.of(SMALL | {"count": FEW})
    one, two = _made(small, 1), _made(small, 2)
    print(f"{FEW} small samples: {one:.1f} s by 1 process, {two:.1f} s by 2: {one / two:.2f} times (bar: 1.7)")


def _made(recipe: Recipe, processes: int) -> float:
    """Return the seconds that processes take, once they have started."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        dataset.begin(folder, recipe, made_by())
        warm = [worker(folder, 2 // processes, "cpu") for _ in range(processes)]
        for process in warm:
            process.ask(0, "sample")
        start = time.perf_counter()
        with Farm(processes, warm.pop, range(recipe.count)) as farm:
            assert not any(outcome.missing for outcome in farm.outcomes())
            return time.perf_counter() - start


def _large_render(recipe: Recipe, index: int) -> float:
    """Return the seconds of one render with as many pixels as a sample's pictures have."""
    sample = draw(recipe, index)
    built, _ = scene.build(recipe, sample)
    centre, radius = scene.ball_about(geometry.object_triangles(built))
    camera = scene.place_camera(built, recipe, sample, centre, radius)
    lights = lights_of(recipe, sample, centre, radius, scene.light_axis(recipe, camera, centre))
    transport = plan.unmeasured(built, lights, recipe.render.bounces, recipe.render.samples).transport
    side = round(recipe.camera.resolution * math.sqrt(sample.lights))
    with (
        tempfile.TemporaryDirectory() as folder,
        cycles.measuring(built, camera.resized(side), transport, threads=2),
        cycles.openexr(built),
        cycles.meshes_cached(built),
        lamps.lamp(built, lights.kind) as lamp,
    ):
        lamps.shine(lamp, lights, sample.lights // 2)
        start = time.perf_counter()
        cycles.render(built, Path(folder) / "large.exr")
        return time.perf_counter() - start


def _follow(count: int) -> None:
    """Print what a sample costs one process, and what memory that holds, after 10, 100, ... samples."""
    recipe = Recipe.of(SMALL | {"count": count})
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        dataset.begin(folder, recipe, made_by())
        process = worker(folder, 2, "cpu")
        process.ask(0, "sample")
        seconds: list[float] = []
        for index in range(count):
            start = time.perf_counter()
            process.ask(index, "sample")
            seconds.append(time.perf_counter() - start)
            if index + 1 in (10, 30, 100, 300, 1000) or index + 1 == count:
                latest = seconds[-min(30, len(seconds)) :]
                print(f"{index + 1:5} samples: {sum(latest) / len(latest):.3f} s each, {_memory(process.pid):.0f} MB")
        process.close()


def _memory(pid: int) -> float:
    """Return what a process holds [MB], as Linux tells."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS"))


if __name__ == "__main__":
    main()
