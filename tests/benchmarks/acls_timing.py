"""What a round of the alternation costs: seconds against pixels, lights and bases, beside plain numpy; peak memory.

Run as ``python tests/benchmarks/acls_timing.py [--pixels N]``. A round is one update of the bases (normal equations and
constrained solve) and one of every pixel's normal and weights. The pixels are those of a drawn sphere, repeated.
Kernels are compiled before the first row. CPU s are those of all threads, by which a busy machine is told from a slow
program.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import plain_numpy
import tabulated

from pipeline.core.progress import finish
from pipeline.core.shape.photometric import acls, bases, pixel
from pipeline.core.shape.photometric.sight import Sight, see
from tests import oracles

NODES = (acls.Options().nodes_h, acls.Options().nodes_d)
BAR_SECONDS, BAR_MB = 60, 3000
FULL = (300_000, 100, 3)
NUMPY_PIXELS = 2000


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pixels", type=int, default=FULL[0], help=f"pixels of the largest row (default {FULL[0]})")
    most = parser.parse_args().pixels
    drawn = {count: sight(count) for count in (25, 50, 100)}
    seconds(drawn[25].select(np.arange(100)), 3)  # compiles
    print(f"{os.cpu_count()} cores")
    print(
        f"{'pixels':>8}{'lights':>8}{'bases':>7}{'equations s':>13}{'solve s':>9}{'pixels s':>10}{'round s':>9}"
        f"{'ratio':>7}{'CPU s':>8}"
    )
    _, lights, count = FULL
    whole = row(drawn[lights], most, count)
    for pixels, lamps, k in [(most // 4, 100, 3), (most // 2, 100, 3), (most, 25, 3), (most, 50, 3)]:
        row(drawn[lamps], pixels, k, whole)
    for k in (1, 2, 4):
        row(drawn[100], most, k, whole)
    scaled = whole * FULL[0] / most
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{FULL[0]} pixels: {scaled:.1f} s a round (bar {BAR_SECONDS})  {'yes' if scaled <= BAR_SECONDS else 'no'}")
    print(f"peak memory {peak:.0f} MB (bar {BAR_MB})  {'yes' if peak <= BAR_MB else 'no'}")
    compare(drawn[100])


def sight(lights: int) -> Sight:
    """Return what the pixels of a glossy sphere saw."""

    def glossy(normal: plain_numpy.Array, wi: plain_numpy.Array, wo: plain_numpy.Array) -> plain_numpy.Array:
        cosine = np.maximum(oracles.dot(normal, wi), 1e-9)
        lobe = oracles.ggx_cosine(normal, wi, np.broadcast_to(wo, normal.shape), 0.4) / cosine
        return np.array([0.2, 0.15, 0.1]) + 0.2 * lobe[:, None]

    capture = tabulated.sphere(glossy, lights)
    return finish(see(capture, capture.mask()))


def row(part: Sight, pixels: int, count: int, whole: float | None = None) -> float:
    """Time a round on the pixels repeated to so many, print a line and return the seconds."""
    repeated = part.select(np.arange(pixels) % len(part.values))
    before = time.process_time()
    equations, solve, each = seconds(repeated, count)
    total, processor = equations + solve + each, time.process_time() - before
    print(
        f"{pixels:8d}{part.values.shape[1]:8d}{count:7d}{equations:13.2f}{solve:9.2f}{each:10.2f}{total:9.2f}"
        f"{total / (whole or total):7.2f}{processor:8.1f}",
        flush=True,
    )
    return total


def seconds(part: Sight, count: int) -> tuple[float, float, float]:
    """Return the seconds of the normal equations, of their solution, and of all normals and weights."""
    normals, weights, certainty, table = state(part, count)
    start = time.perf_counter()
    equations = bases.gather(part, certainty, normals, weights, table.shape)
    gathered = time.perf_counter()
    even = np.full((*NODES, count), equations.band[:, 0].mean())
    smooth = bases.smoothness(np.ones(even.shape), even, 1e-3, 1e-3, 1e-6)
    band = bases.total(equations.band, smooth)
    for colour in range(3):
        bases.minimise(band, equations.moments[:, colour], (NODES[0], NODES[1] * count))
    solved = time.perf_counter()
    left = np.empty((2, len(normals)))
    geometry = (part.lights, part.near, part.points, part.views)
    pixel.refine(*geometry, part.values, certainty, table, acls.STEPS, normals, weights, *left)
    return gathered - start, solved - gathered, time.perf_counter() - solved


def state(part: Sight, count: int) -> tuple[plain_numpy.Array, ...]:
    """Return normals some degrees off, weights, certainty and a table, as they are between two rounds."""
    rng = np.random.default_rng(1)
    normals = oracles.unit(part.views + rng.normal(0, 0.3, part.views.shape))
    weights = rng.uniform(0.1, 1, (len(normals), count, 1))
    certainty = np.ones(part.usable.shape, np.float32)
    fall = np.linspace(1, 0, NODES[0])[:, None, None, None] ** np.arange(1, count + 1)[:, None]
    return normals, weights, certainty, np.tile(0.3 * fall, (1, NODES[1], 1, 3))


def compare(part: Sight) -> None:
    """Print the ratio of plain numpy's time to the compiled one's for the same pixels, lights and bases."""
    part = part.select(np.arange(NUMPY_PIXELS) % len(part.values))
    normals, weights, certainty, table = state(part, 3)
    start = time.perf_counter()
    plain_numpy.gather(part, certainty, normals, weights[..., 0], table.shape)
    gathered = time.perf_counter()
    plain_numpy.refine(part, certainty, table, acls.STEPS, normals)
    each = time.perf_counter() - gathered
    equations, _, compiled = seconds(part, 3)
    print(
        f"plain numpy over compiled, {NUMPY_PIXELS} pixels x {part.values.shape[1]} lights x 3 bases: "
        f"equations {(gathered - start) / equations:.0f}, pixels {each / compiled:.0f}"
    )


if __name__ == "__main__":
    main()
