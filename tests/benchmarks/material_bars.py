"""Every bar that materials are held to: measured-like tables as mixtures, the gourd from its capture to Cycles.

Run as ``.venv-3.13/bin/python tests/benchmarks/material_bars.py [--cache FOLDER] [--data FOLDER] [--every N]`` with the
Python that ``bootstrap.py`` set up. Tables need the third-party data; the gourd is captured (default settings, 320 and
80 lights at 2 and 3 m), once with direct light and once with all of it, and recovered by ``shape --method acls`` where
the folder does not hold it yet; ``lightsphere compare`` renders its asset in place of the true gourd.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import normal_captures as captures
import tabulated

from pipeline.blender.round_trip import round_trip
from pipeline.core.material.fit import fit
from pipeline.core.material.principled import fit_principled
from pipeline.core.progress import finish

LOBES = 4
UP = np.array([0.0, 0.0, 1.0])
BARS = {"captured": 0.08, "new_lights": 0.08, "global_illumination": 0.10, "new_view": 0.15}


@dataclass(frozen=True)
class Measured:
    """A table of the third-party data as a BRDF."""

    f: tabulated.Brdf
    isotropic: bool = True

    def evaluate(self, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.f(UP, wi, wo)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, help="folder that keeps the captures (default: a temporary one)")
    parser.add_argument("--data", type=Path, help="folder of the third-party data; without it no tables")
    parser.add_argument("--every", type=int, default=1, help="of the tables, every how many-th")
    chosen = parser.parse_args()
    rows = [*tables(chosen.data, chosen.every)] if chosen.data else []
    with tempfile.TemporaryDirectory() as folder:
        for effects in ("direct", "full"):
            rows += gourd(chosen.cache or Path(folder), effects)
    print(f"{'':48}{'measured':>10}{'bar':>8}  holds")
    for words, value, bar in rows:
        print(f"{words:48}{value:10.4f}" + (f"{bar:8.4g}  {'yes' if value <= bar else 'NO'}" if bar else ""))


def tables(data: Path, every: int) -> Iterator[tuple[str, float, float]]:
    """Fit single tables with four lobes and render each; a line a table, then the rows."""
    found = []
    for name in tabulated.materials(data)[::every]:
        brdf = Measured(tabulated.measured(data, name))
        mixture = finish(fit([brdf], LOBES))
        turn = finish(round_trip(mixture, [brdf]))
        nearest = fit_principled([brdf], np.ones((1, 1, 1, 1), np.float32)).notes
        notes = mixture.notes
        found.append(
            [
                *(notes[key][0] for key in ("material_rel_rms", "cube_root_rel_rms", "reciprocity_error", "albedo")),
                turn.against_mixture[0],
                *(nearest[key][0] for key in ("principled_rel_rms", "principled_cube_root_rel_rms")),
            ]
        )
        print(f"{name:30}" + "".join(f"{value:9.4f}" for value in found[-1]), flush=True)
    error, roots, exchanged, albedo, rendered, plain, plain_roots = np.array(found).T
    yield f"{len(found)} tables, median material_rel_rms", float(np.median(error)), 0.13
    yield "  90th percentile", float(np.percentile(error, 90)), 0.22
    yield "  cube roots, median", float(np.median(roots)), 0
    yield "  reciprocity error, median", float(np.median(exchanged)), 0
    yield "  largest albedo", float(albedo.max()), 1.0
    yield "  rendered against predicted, largest", float(rendered.max()), 0.002
    yield "  nearest Principled, median", float(np.median(plain)), 0
    yield "  nearest Principled, cube roots, median", float(np.median(plain_roots)), 0


def gourd(cache: Path, effects: str) -> Iterator[tuple[str, float, float]]:
    """Bring the gourd, captured with some effects of light, from its capture to an asset that Cycles compares."""
    folder = cache / f"material-gourd-{effects}"
    if not (folder / "capture" / "capture.json").is_file():
        captures.command("capture", captures.GOURD, "-o", folder / "capture", "--effects", effects)
    if not (folder / "shape" / "reflectance" / "bases.npz").is_file():
        captures.command("shape", folder / "capture", "-o", folder / "shape", "--method", "acls")
    made, compared = folder / "asset.json", folder / "compared.json"
    captures.command("material", folder / "shape", "-o", folder / "asset.blend", "--overwrite", "--json", made)
    words = ("-o", folder / "comparison", "--overwrite", "--json", compared)
    captures.command("compare", folder / "asset.blend", folder / "capture", *words)
    found = json.loads(compared.read_text(encoding="utf-8"))["comparisons"]
    for name, bar in BARS.items():
        yield f"gourd, {effects} light captured: {name}", found[name]["relight_rel_rmse"], bar
    yield "  of which noise of global illumination", found["global_illumination"]["noise"], 0
    yield "  render time over one Principled", json.loads(made.read_text(encoding="utf-8"))["render_cost"], 1.25


if __name__ == "__main__":
    main()
