"""The source's experiments against Cycles: two area lights, two stretched spots, a profile, and the light that moves.

Run as ``.venv-3.13/bin/python tests/benchmarks/relight_lights.py [--cache FOLDER]`` with the Python that
``bootstrap.py`` set up. Captures and shapes are those of ``relight_bars.py``. The lights stand in the scene, Cycles
renders it, and ``relight`` takes them from it; the error is ``relight_rel_rmse`` on the object's pixels, beside it that
of the source's rule (Magda et al. 2001, equation 6).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import relight_bars as bars

from pipeline.blender import cycles, emitters, exr
from pipeline.blender import scene as scenes
from pipeline.core.compare.pictures import relative_rmse
from pipeline.core.progress import finish
from pipeline.core.relight import RelightSettings
from pipeline.core.relight.emitters import Emitter
from pipeline.core.relight.film import moving_light
from pipeline.core.relight.render import prepare, relit

SAMPLES = 256
FRAMES = 7
PLACES = ((1.6, -1.9, 1.4), (-1.9, -1.2, 1.2))
# 45 degrees from its axis it shines brightest, and to one side twice as much as to the other.
PROFILE = """IESNA:LM-63-2002
TILT=NONE
1 -1 1 4 5 1 2 0 0 0
1 1 1
0 20 45 90
0 90 180 270 360
300 400 900 0
300 400 700 0
300 400 450 0
300 400 700 0
300 400 900 0
"""


def lamp(scene: bpy.types.Scene, kind: str, place: tuple[float, float, float], **values: object) -> bpy.types.Object:
    """Add a light that looks at the middle of the object."""
    data = bpy.data.lights.new("Lamp", kind)
    for name, value in values.items():
        setattr(data, name, value)
    item = bpy.data.objects.new("Lamp", data)
    item.location = place
    item.rotation_euler = (Vector(place) - Vector((0, 0, 0.5))).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(item)
    return item


def areas(scene: bpy.types.Scene) -> None:
    """Two diffuse area lights, one red and one blue."""
    for place, colour in zip(PLACES, ((1.0, 0.5, 0.4), (0.4, 0.6, 1.0)), strict=True):
        lamp(scene, "AREA", place, energy=60.0, shape="SQUARE", size=0.8, color=colour)


def spots(scene: bpy.types.Scene) -> None:
    """Two spots, each wider along one axis."""
    for place, colour in zip(PLACES, ((1.0, 0.5, 0.4), (0.4, 0.6, 1.0)), strict=True):
        made = lamp(
            scene, "SPOT", place, energy=200.0, spot_size=0.6, spot_blend=0.4, shadow_soft_size=0.0, color=colour
        )
        made.scale = (1.6, 0.6, 1.0)


def profile(scene: bpy.types.Scene) -> None:
    """One light with an IES profile."""
    data = lamp(scene, "POINT", PLACES[0], energy=1.0, shadow_soft_size=0.0).data
    data.use_nodes = True
    tree = data.node_tree
    node = tree.nodes.new("ShaderNodeTexIES")
    node.mode, node.ies = "INTERNAL", bpy.data.texts.new("profile")
    node.ies.write(PROFILE)
    emission = next(one for one in tree.nodes if one.type == "EMISSION")
    tree.links.new(node.outputs[0], emission.inputs["Strength"])


def single(emitter: Emitter) -> Callable[[bpy.types.Scene], None]:
    """Return what adds a light of the film."""

    def add(scene: bpy.types.Scene) -> None:
        strength = float(emitter.intensity[0])
        if emitter.distant:
            direction = Vector(emitter.place.tolist())
            made = lamp(scene, "SUN", (0.0, 0.0, 0.0), energy=strength, angle=0.0)
            made.rotation_euler = direction.to_track_quat("Z", "Y").to_euler()
        else:
            lamp(scene, "POINT", tuple(emitter.place), energy=4 * np.pi * strength, shadow_soft_size=0.0)

    return add


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, help="folder that keeps the captures (default: a temporary one)")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        cache = chosen.cache or Path(folder)
        print(f"{'':10}" + "".join(f"{head:>18}" for head in ("two areas", "two spots", "a profile", "moving light")))
        for name in bars.BARS:
            print(f"{name:10}" + "".join(f"{words:>18}" for words in row(cache, name)), flush=True)


def row(cache: Path, name: str) -> list[str]:
    """Return the error under each kind of light, and that of the source's rule."""
    capture = bars.captured(cache, f"relight_{name}", name, bars.SIZE + bars.RIG)
    shape = bars.solved(cache / f"relight_{name}_shape", capture)
    film = moving_light(shape.camera, shape.points()[np.isfinite(shape.depth)], FRAMES)
    cases = [[areas], [spots], [profile], [single(one) for one in film]]
    prepared = [finish(prepare(capture, shape, RelightSettings(interpolation=one))) for one in ("model", "source")]
    mask, found = capture.mask(), []
    for case in cases:
        errors = []
        for add in case:
            lights, reference = shone(f"teapot-{name}", add, capture.camera)
            errors.append([relative_rmse(finish(relit(one, lights)), reference, mask) for one in prepared])
        own, source = np.mean(errors, axis=0)
        found.append(f"{own:.3f} ({source:.3f})")
    return found


def shone(name: str, add: Callable[[bpy.types.Scene], None], camera: object) -> tuple[list[Emitter], NDArray]:
    """Return the lights that stand in a scene, and what Cycles renders of direct light under them."""
    scene = scenes.load(name)
    for item in [one for one in scene.objects if one.type == "LIGHT"]:
        bpy.data.objects.remove(item)
    add(scene)
    lights = emitters.of_scene(scene)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "reference.exr"
        with cycles.measuring(scene, camera, cycles.Transport(samples=SAMPLES)), cycles.openexr(scene):
            cycles.render(scene, path)
        return lights, exr.read_rgb(path)


if __name__ == "__main__":
    main()
