"""The bars that unknown lights are held to: rendered bodies under a dozen hand-held lamps, and a dozen drawn by lot,
DiLiGenT's ball and cat, and three real bodies under ten lights that nobody knows.

Run as ``.venv-3.13/bin/python tests/benchmarks/unknown_bars.py [--cache FOLDER] [--data FOLDER]`` with the Python that
``bootstrap.py`` set up. The rendered gourd and the body like a bunny were used for tuning, the drawn ones were not.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import normal_captures as captures
from unknown_captures import COUNT, Case, made

from pipeline.core.capture import Capture
from pipeline.core.compare.pictures import relative_rmse
from pipeline.core.reflectance.bivariate import Bivariate
from pipeline.core.reflectance.picture import picture
from pipeline.core.shape import Shape, level

BARS = {(50, False): (2.5, 6.0), (20, True): (1.0, 5.0), (20, False): (4.0, 8.0)}
NEAR = ((50, False), (20, True))  # fields of view and whether powers are equal, of lamps at arm's length
UNSEEN = Path(__file__).with_name("unseen_bodies.toml")
PICTURE = 0.10  # relative RMSE under a light not in the set
MEASURED = {"ballPNG": 7.0, "catPNG": 10.0}  # mean angle of the normals [degrees]
REAL, LEFT_OUT, PREDICTED = ("frog1", "panther", "apple"), 3, 0.12  # sets, photograph, relative RMSE


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, help="folder that keeps the captures (default: a temporary one)")
    parser.add_argument("--data", type=Path, help="folder with diligent/ballPNG, diligent/catPNG and mit_lab")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        cache = chosen.cache or Path(folder)
        print(f"{'capture':32} light (bar)   stated  normal (bar)  median  new light (bar)  seconds")
        for view, equal in BARS:
            for body in ("gourd", "bunny"):
                for lights in (1, 2):
                    rendered(cache, Case(body, view, equal, lights))
        for view, equal in NEAR:
            for body in ("gourd", "bunny"):
                for lights in (1, 2):
                    rendered(cache, Case(body, view, equal, lights, near=True))
        for body in ("gourd", "bunny", "bowl"):
            rendered(cache, Case(body, 20, False, 2, matt=True))
        rendered(cache, Case("bowl", 20, False, 2))
        for view, equal in BARS:
            rendered(cache, Case("gourd", view, equal, 1), "source")
        drawn(cache)
        if chosen.data:
            for name in MEASURED:
                for every in (1, 8):
                    measured(cache, chosen.data / "diligent" / name, every)
            for name in REAL:
                predicted(cache, chosen.data / "mit_lab" / name)


def rendered(cache: Path, case: Case, objective: str = "joint") -> None:
    """Recover one rendered case and print its row."""
    whole = made(cache, case)
    folder = cache / f"{case.name}-given"
    if not (folder / "capture.json").is_file():
        captures.without(whole, np.arange(COUNT, len(whole)), folder)
    name = case.name if objective == "joint" else f"{case.name}-{objective}"
    out = cache / f"{name}-shape"
    options = ("--strengths", "equal" if case.equal else "similar", "--lamps", "near" if case.near else "distant")
    found = recovered(folder, out, *options, "--objective", objective)
    light, normal = BARS[case.view, case.equal]
    error = max(new_light(whole, out, number) for number in range(COUNT, len(whole)))
    far = "".join(f" {name} {found[name]:.2f}" for name in ("light_distance_pct", "light_power_pct") if name in found)
    print(
        f"{name:32} {found['light_mae_deg']:5.2f} ({light:3.1f}) {found['light_deviation_deg']:7.2f} "
        f"{found['normal_mae_deg']:7.2f} ({normal:3.1f}) {found['normal_median_deg']:7.2f} "
        f"{error:10.3f} ({PICTURE:.2f}) {found['seconds']:8.1f}{far}",
        flush=True,
    )


def drawn(cache: Path) -> None:
    """Recover bodies whose shapes and materials were drawn by lot, and print their rows."""
    folder = cache / UNSEEN.stem
    if not (folder / "finished").is_file():
        captures.command("dataset", UNSEEN, "-o", folder)
    for sample in sorted((folder / "capture").iterdir()):
        found = recovered(sample, cache / f"{UNSEEN.stem}-{sample.name}-shape")
        print(
            f"drawn by lot {sample.name:19} {found['light_mae_deg']:5.2f} {found['light_deviation_deg']:13.2f} "
            f"{found['normal_mae_deg']:7.2f} {found['normal_median_deg']:13.2f} {found['seconds']:27.1f}",
            flush=True,
        )


def recovered(capture: Path, out: Path, *options: str) -> dict[str, Any]:
    """Return the figures of the command."""
    figures = out.with_suffix(".json")
    captures.command("shape", capture, "-o", out, "--method", "uncalibrated", "--json", figures, *options)
    values: dict[str, Any] = json.loads(figures.read_text(encoding="utf-8"))
    return values


def new_light(whole: Capture, out: Path, number: int) -> float:
    """Return the relative RMSE of the picture under a light that was not given.

    It is turned into the recovered frame as the given lights are, near ones with their distances, and one number of
    brightness is fitted; cast shadows are not foreseen.
    """
    shape, reflectance, given = Shape.open(out), Bivariate.open(out / "reflectance"), Capture.open(out / "capture")
    near, truth = whole.lights.kind == "near", whole.truth()
    assert truth is not None
    lights = level.lights_at(shape.camera, whole.lights, level.change(shape.camera, truth.depth, shape.depth))
    middle = shape.middle() if near else np.zeros(3)
    true, found = lights.position - middle, given.lights.position - middle
    left, size, right = np.linalg.svd(true[:COUNT].T @ found)
    grown = size.sum() / (true[:COUNT] ** 2).sum() if near else 1.0
    place = grown * true[number] @ left @ right + middle
    made = picture(shape, reflectance, place, np.ones(3), near).astype(np.float64)
    seen = whole.image(number)
    return relative_rmse(made * (made * seen).sum() / (made**2).sum(), seen, whole.mask() & (shape.confidence > 0))


def measured(cache: Path, photographs: Path, every: int) -> None:
    """Recover photographs of which the lights are hidden, and print the error of the normals.

    The lights stand in rows of eight; one of every eight is taken, each time another one of the row.
    """
    whole = captures.imported(cache, photographs)
    folder = cache / f"{photographs.name}-{every}"
    if not (folder / "capture.json").is_file():
        row = np.arange(len(whole) // every)
        captures.without(whole, np.setdiff1d(np.arange(len(whole)), every * row + 3 * row % every), folder)
    found = recovered(folder, cache / f"{folder.name}-shape")
    print(
        f"{photographs.name} {len(Capture.open(folder)):3} photographs: lights {found['light_mae_deg']:.2f}, normals "
        f"{found['normal_mae_deg']:.2f} ({MEASURED[photographs.name]:g}) degrees, {found['seconds']:.0f} s",
        flush=True,
    )


def predicted(cache: Path, photographs: Path) -> None:
    """Recover a real set without one of its ten photographs, and print how well that is predicted.

    Nobody knows where its light stood: of all directions and strengths that is taken which predicts it best.
    """
    folder, out = cache / photographs.name, cache / f"{photographs.name}-shape"
    if not (folder / "capture.json").is_file():
        options = ("--pictures", "light*.png", "--mask", photographs / "mask.png", "--format", "uncalibrated")
        captures.command("import", photographs, "-o", folder, *options)
    whole, part = Capture.open(folder), cache / f"{photographs.name}-given"
    if not (part / "capture.json").is_file():
        captures.without(whole, np.array([LEFT_OUT]), part)
    found = recovered(part, out)
    shape, reflectance, given = Shape.open(out), Bivariate.open(out / "reflectance"), Capture.open(out / "capture")
    true, known = whole.image(LEFT_OUT).astype(np.float64), whole.mask() & (shape.confidence > 0)

    def shown(direction: Any) -> Any:
        unit = np.asarray(direction) / np.linalg.norm(direction)
        made = picture(shape, reflectance, unit, np.ones(3)).astype(np.float64)
        return made * (made * true)[known].sum() / max((made[known] ** 2).sum(), 1e-12)

    def error(direction: Any) -> float:
        return relative_rmse(shown(direction), true, known)

    start = min(given.lights.position, key=error)
    best = minimize(error, start, method="Nelder-Mead", options={"maxfev": 120})
    print(
        f"{photographs.name} photograph {LEFT_OUT + 1} of {len(whole)} from the others: {best.fun:.3f} "
        f"({PREDICTED:.2f}), lights known to {found['light_deviation_deg']:.1f} degrees, {found['seconds']:.0f} s",
        flush=True,
    )


if __name__ == "__main__":
    main()
