"""Every bar that materials are held to: measured-like tables as mixtures, the gourd from its capture to Cycles.

Run as ``.venv-3.13/bin/python tests/benchmarks/material_bars.py [--cache FOLDER] [--data FOLDER] [--every N]`` with the
Python that ``bootstrap.py`` set up. Tables need the third-party data; the gourd is captured (128x128 pixels, 320 and 80
lights at 2 and 3 m, direct light) and recovered by ``shape --method acls`` where the folder does not hold it yet. Its
asset takes the place of the true gourd in the true scene, under sixteen near lights that no capture light coincides
with; errors are ``relight_rel_rmse`` on the true object's pixels, the mean over the lights. Global illumination is
rendered with other seeds on either side, and what another seed alone changes stands beside it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import normal_captures as captures
import tabulated

from pipeline.blender import cycles, exr, lamps, render_cost, scene, truth, views
from pipeline.blender.camera import add_camera
from pipeline.blender.round_trip import round_trip
from pipeline.commands.demo_stages import new_lamps
from pipeline.core import images
from pipeline.core.camera import Camera
from pipeline.core.capture import Capture
from pipeline.core.compare import relative_rmse
from pipeline.core.lights import Lights
from pipeline.core.material.fit import fit
from pipeline.core.material.principled import fit_principled
from pipeline.core.material.surface import Surface, surface
from pipeline.core.progress import finish
from pipeline.core.reflectance.bivariate import Bivariate
from pipeline.core.shape import Shape

LOBES = 4
UP = np.array([0.0, 0.0, 1.0])
BOUNCES, SAMPLES = 4, 64
Pictures = NDArray[np.float32]


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
        rows += gourd(chosen.cache or Path(folder))
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


def gourd(cache: Path) -> Iterator[tuple[str, float, float]]:
    """Bring the gourd from its capture to an asset in Cycles."""
    folder = cache / "material-gourd"
    if not (folder / "capture" / "capture.json").is_file():
        captures.command("capture", "gourd", "-o", folder / "capture", "--effects", "direct")
    if not (folder / "shape" / "reflectance" / "bases.npz").is_file():
        captures.command("shape", folder / "capture", "-o", folder / "shape", "--method", "acls")
    capture, shape = Capture.open(folder / "capture"), Shape.open(folder / "shape")
    found = finish(surface(Bivariate.open(folder / "shape" / "reflectance"), LOBES))
    lights, camera = new_lamps(capture), capture.camera
    show = partial(pictures, shape=shape, found=found)
    for words, seen_by, bar in (("direct", camera, 0.08), ("20 degrees away", camera.orbited(np.zeros(3), 20), 0.15)):
        true, mask = show(seen_by, lights, asset=False)
        yield f"gourd, unseen lights, {words}", mean_error(show(seen_by, lights, asset=True)[0], true, mask), bar
    some = lights.select(np.arange(0, len(lights), 2))
    bounced = cycles.Transport(BOUNCES, samples=SAMPLES)
    true, mask = show(camera, some, asset=False, transport=bounced, seed=1)
    asset = show(camera, some, asset=True, transport=bounced, seed=2)[0]
    again = show(camera, some, asset=False, transport=bounced, seed=3)[0]
    yield "gourd, unseen lights, global illumination", mean_error(asset, true, mask), 0.10
    yield "  of which noise", mean_error(again, true, mask), 0
    costs = finish(render_cost.relative_cost(found.mixture))
    yield "gourd, render time over one Principled", costs[-1], 1.25


def pictures(
    camera: Camera,
    lights: Lights,
    shape: Shape,
    found: Surface,
    asset: bool,
    transport: cycles.Transport = cycles.DIRECT,
    seed: int = 0,
) -> tuple[Pictures, NDArray[np.bool_]]:
    """Render the gourd's scene, with the asset in its place, under single lights (L, H, W, 3); return its mask, too."""
    loaded = scene.load(captures.GOURD)
    if asset:
        views.exchange(loaded, shape, found).cycles.shadow_terminator_geometry_offset = 0.0
    add_camera(loaded, camera)
    shown = []
    with tempfile.TemporaryDirectory() as name:
        with (
            cycles.measuring(loaded, camera.resolution[0], transport, seed),
            cycles.openexr(loaded),
            cycles.own_lights_hidden(loaded),
            lamps.lamp(loaded, lights.kind) as lamp,
        ):
            for index in range(len(lights)):
                lamps.shine(lamp, lights, index)
                cycles.render(loaded, Path(name) / "light.exr")
                channels = exr.read(Path(name) / "light.exr")
                shown.append(np.stack([channels[letter] for letter in "RGB"], axis=-1))
        hide_lights(loaded)
        truth.write(loaded, camera, Path(name))
        mask = images.read_channels(Path(name) / "mask.exr")["mask.V"] > 0
    return np.stack(shown), mask


def hide_lights(loaded: bpy.types.Scene) -> None:
    """Hide a scene's own lights: truth is written in the dark."""
    for item in loaded.objects:
        if item.type == "LIGHT":
            item.hide_render = True


def mean_error(shown: Pictures, true: Pictures, mask: NDArray[np.bool_]) -> float:
    """Return the mean over the lights of relight_rel_rmse on the object's pixels."""
    return float(np.mean([relative_rmse(a, b, mask) for a, b in zip(shown, true, strict=True)]))


if __name__ == "__main__":
    main()
