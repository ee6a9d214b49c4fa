"""Every bar that normals, basis BRDFs and weight maps from known lights are held to.

Run as ``python tests/benchmarks/normal_bars.py [NAME ...] [--cache FOLDER] [--data FOLDER]``. A name is that of a row,
or its beginning: ``gourd``, ``near``, ``merl``, ``merl/steel``, ``diligent``, ``timing``; all rows where none is given.
Captures are made where the cache does not hold them yet. Every solve is a run of the command line with default
settings in a process of its own, so that its seconds and its peak memory are what a user meets. Rows that need
third-party data say so without ``--data``.

Angles are in degrees over all pixels of the object, as mean / median / 95th percentile; a pixel without a normal counts
90. LS is plain Lambertian least squares over all lights, start the method's own robust Lambertian start. Table is the
cosine-weighted relative RMS of each basis against its true material where it was ever observed, weights the correlation
of each weight map with the true one, both after matching; held out, the relative RMS error of every tenth picture,
solved without it, on the pixels of each material.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import normal_captures as captures
import normal_figures as figures
import tabulated

from pipeline.core.capture import Capture
from pipeline.core.compare.shapes import depth_error_pct
from pipeline.core.reflectance.bivariate import Bivariate
from pipeline.core.shape import Shape

WORSE = 0.1  # degrees by which no result may be worse than its own start
EVERY = 10  # every so many-th light is held out
DILIGENT = {"diligent/ball": ("diligent/ballPNG", 1.5), "diligent/cat": ("diligent/catPNG", 4.9)}
SPECULAR = ("teapot-plastic", "teapot-metal", "teapot-coat", "thin", "steps")
HEAD = f"{'':24}{'LS':>7}{'start':>25}{'acls (bar)':>32}{'seconds':>9}{'MB':>7}  holds"
Angles = NDArray[np.float64]


@dataclass(frozen=True)
class Solve:
    """What a run of ``lightsphere shape`` gave."""

    shape: Shape
    values: dict[str, Any]
    folder: Path

    def reflectance(self) -> Bivariate:
        """Open the bases and weight maps beside the shape."""
        return Bivariate.open(self.folder / "reflectance")


@dataclass
class Table:
    """Prints rows and counts the bars that do not hold."""

    work: Path
    missed: list[str] = field(default_factory=list)

    def solve(self, capture: Capture, name: str, *options: object) -> Solve:
        """Run ``lightsphere shape`` on a capture."""
        folder = self.work / name
        log = folder.with_suffix(".json")
        captures.command("shape", capture.folder, "-o", folder, "--json", log, *options)
        return Solve(Shape.open(folder), json.loads(log.read_text()), folder)

    def bar(self, name: str, value: float, limit: float) -> str:
        """Return a value with its bar, and remember when it does not hold."""
        if not value <= limit:
            self.missed.append(f"{name}: {value:.3g} ({limit:.3g})")
        return f"{value:.3f} " + (f"({limit:g})" if np.isfinite(limit) else "(-)")

    def normals(self, name: str, capture: Capture, limit: float) -> tuple[Solve, Angles]:
        """Solve a capture and print how far its normals are from the truth."""
        before = len(self.missed)
        start = figures.angles(self.solve(capture, "start", "--method", "lambertian").shape.normal, capture)
        found = self.solve(capture, "acls", "--method", "acls")
        angles = figures.angles(found.shape.normal, capture)
        plain = figures.angles(figures.least_squares(capture), capture).mean()
        self.bar(f"{name}, worse than its start by", float(angles.mean() - start.mean()), WORSE)
        shown = f"{self.bar(name, float(angles.mean()), limit)} {_spread(angles)}"
        seconds, memory = found.values["seconds"], found.values["peak_memory_mb"]
        held = "yes" if len(self.missed) == before else "no"
        begun = f"{start.mean():.3f} {_spread(start)}"
        print(f"{name:24}{plain:7.2f}{begun:>25}{shown:>32}{seconds:9.1f}{memory:7.0f}  {held}", flush=True)
        return found, angles

    def say(self, words: str) -> None:
        """Print a line below a row."""
        print(f"{'':26}{words}", flush=True)


def _spread(angles: Angles) -> str:
    return f"/ {np.median(angles):.3f} / {np.quantile(angles, 0.95):.2f}"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="rows to measure, or their beginnings; all by default")
    parser.add_argument("--cache", type=Path, help="folder that keeps the captures (default: a temporary one)")
    parser.add_argument("--data", type=Path, help="folder of third-party sets: merl_fits, diligent, bunny")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        table, cache = Table(Path(folder) / "solved"), chosen.cache or Path(folder) / "captures"
        table.work.mkdir()
        print(HEAD)
        for name, measure in rows(cache, chosen.data):
            if not chosen.names or any(name.startswith(wanted) for wanted in chosen.names):
                measure(table, name)
            elif name == "merl" and (some := [n.removeprefix("merl/") for n in chosen.names if n.startswith("merl/")]):
                merl(chosen.data, some)(table, name)
    print("missed: " + ("; ".join(table.missed) or "none"))


Row = Callable[[Table, str], None]


def rows(cache: Path, data: Path | None) -> Iterator[tuple[str, Row]]:
    """Yield all rows by name, in order."""
    yield "gourd-100", gourd(cache, 100, 0.5, 0.1)
    yield "gourd-25", gourd(cache, 25, 0.8)
    yield "gourd-12", gourd(cache, 12, 2.0)
    yield "gourd-100-full", gourd(cache, 100, 0.8, effects="full")
    for scene in SPECULAR:
        yield scene, lambda table, name: _plain(table, name, captures.distant(cache, name, 100))
    yield "near", near(cache)
    for name, (path, limit) in DILIGENT.items():
        yield name, photographs(cache, data, path, limit)
    yield "bunny", photographs(cache, data, "bunny/bunny_lambert.npz", np.inf)
    yield "merl", merl(data)


def _plain(table: Table, name: str, capture: Capture) -> None:
    table.normals(name, capture, np.inf)


def gourd(cache: Path, lights: int, limit: float, tables: float = np.inf, effects: str = "direct") -> Row:
    """Return a row of the gourd under distant lights."""

    def measure(table: Table, name: str) -> None:
        capture = captures.distant(cache, captures.GOURD, lights, effects)
        found, _ = table.normals(name, capture, limit)
        true = captures.true_weights(capture)
        materials(table, name, found.reflectance(), true, cache, tables)
        if np.isfinite(tables):
            predict(table, capture, np.nan_to_num(true).argmax(axis=-1), ("matt", "waxy", "metallic"))

    return measure


def materials(table: Table, name: str, found: Bivariate, true: Angles, cache: Path, limit: float) -> None:
    """Print how far bases and weight maps are from the gourd's."""
    errors, basis, seen = figures.table_errors(found, [captures.material(cache, k) for k in range(3)])
    correlation = figures.weight_correlation(found.weights, basis, true)
    worst = table.bar(f"{name}, table", float(errors.max()), limit)
    least = table.bar(f"{name}, 1 - weights", float(1 - correlation.min()), 0.1 if np.isfinite(limit) else np.inf)
    table.say(
        f"table {' '.join(f'{e:.3f}' for e in errors)}, worst {worst}, {100 * seen:.0f} % observed; "
        f"weights {' '.join(f'{c:.3f}' for c in correlation)}, 1 - least {least}"
    )


def predict(table: Table, capture: Capture, part: NDArray[np.int64], names: tuple[str, ...]) -> None:
    """Print the error of every tenth picture, solved without it."""
    left_out = np.arange(EVERY // 2, len(capture), EVERY)
    with tempfile.TemporaryDirectory() as folder:
        kept = captures.without(capture, left_out, Path(folder) / "kept")
        found = table.solve(kept, "kept", "--method", "acls")
    errors = figures.held_out(found.shape.normal, found.reflectance(), capture, left_out, part)
    table.say("held out " + ", ".join(f"{name} {error:.3f}" for name, error in zip(names, errors, strict=True)))


def near(cache: Path) -> Row:
    """Return the row of the gourd inside two spheres of lights: depth, normals, bases, new views."""

    def measure(table: Table, name: str) -> None:
        capture = captures.near(cache)
        truth, mask = capture.truth(), capture.mask()
        assert truth is not None
        depth = table.solve(capture, "depth", "--method", "double-sphere").shape
        found, _ = table.normals(name, capture, 0.9)
        reflectance = found.reflectance()
        before, after = (depth_error_pct(shape, truth)[mask] for shape in (depth, found.shape))
        both = np.isfinite(before) & np.isfinite(after)
        for word, figure, share in (("median", np.median, 2 / 3), ("mean", np.mean, 1 / 3)):
            first, last = float(figure(before[both])), float(figure(after[both]))
            ratio = table.bar(f"{name}, depth {word} ratio", last / first, share)
            table.say(f"depth {word} {first:.4f} -> {last:.4f} % of the diameter, ratio {ratio}")
        materials(table, name, reflectance, captures.true_weights(capture), cache, np.inf)
        every = np.arange(len(capture))
        for degrees, limit in ((20, 0.25), (45, 0.35)):
            other = captures.near(cache, degrees)
            error, seen = figures.new_view(found.shape, reflectance, capture, other, every)
            shown = table.bar(f"{name}, view at {degrees} degrees", error, limit)
            table.say(f"f cos from {degrees} degrees aside: relative RMS {shown}, {100 * seen:.0f} % observed")

    return measure


def photographs(cache: Path, data: Path | None, path: str, limit: float) -> Row:
    """Return a row of photographs with true normals."""

    def measure(table: Table, name: str) -> None:
        if data is None or not (data / path).exists():
            print(f"{name:24}not measured: needs {path} in --data")
            return
        capture = captures.imported(cache, data / path)
        table.normals(name, capture, limit)
        predict(table, capture, np.zeros(capture.mask().shape, np.int64), ("all",))

    return measure


def merl(data: Path | None, names: Sequence[str] = ()) -> Row:
    """Return the rows of the spheres of one measured-like material each: all of them where none is named."""

    def measure(table: Table, name: str) -> None:
        if data is None or not (data / tabulated.TABLES).exists():
            print(f"{name:24}not measured: needs {tabulated.TABLES} in --data")
            return
        normals, tables = [], []
        for material in names or tabulated.materials(data):
            with tempfile.TemporaryDirectory() as folder:
                capture = captures.written(tabulated.sphere(tabulated.measured(data, material)), Path(folder))
                found, angles = table.normals(f"merl/{material}"[:23], capture, np.inf)
                errors, _, seen = figures.table_errors(figures.as_one(found.reflectance()), [capture])
            table.say(f"table {errors[0]:.3f}, {100 * seen:.0f} % observed")
            normals.append(float(angles.mean()))
            tables.append(float(errors[0]))
        for word, quantile, values, limit in (
            ("normals, median over materials", 0.5, normals, 0.5),
            ("normals, 90th percentile", 0.9, normals, 2.0),
            ("table, median over materials", 0.5, tables, 0.15),
        ):
            shown = table.bar(f"{name} {word}", float(np.quantile(values, quantile)), limit)
            table.say(f"{len(values)} materials, {word} {shown}")

    return measure


if __name__ == "__main__":
    main()
