"""The bars that inverse is held to: both rooms, photographed by Cycles with other seeds and more light, then recovered.

The photographs have 4096 samples a pixel; rendering the desk room's takes four minutes and a half.
Run as ``.venv-3.13/bin/python tests/benchmarks/inverse_bars.py [--cache FOLDER] [ROOM ...]`` with the Python that
``bootstrap.py`` set up. The truth is in the scenes' own materials, which ``lightsphere inverse`` does not look at.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import normal_captures as captures

from pipeline.blender import scene as scenes
from pipeline.blender.inverse.photograph import photographed
from pipeline.blender.pixels import array
from pipeline.core.images import read_rgb
from pipeline.core.inverse.estimate import noiseless_rmse
from pipeline.core.inverse.photograph import averaged
from pipeline.core.progress import finish
from scenes import desk_room

ROOMS = ("colour-box", "desk-room")
SECONDS = {"colour-box": 25, "desk-room": 275}
LEVEL = {"Mirror": "mirror", "Tinted mirror": "mirror", "Poster": "texture", "Brushed plate": "anisotropic"}
LEVEL |= {"Glaze": "isotropic"}
BARS = {"colour-box": 2.0, "desk-room": 4.0}  # of diffuse reflectances [%]
HIDDEN, SPECULAR, SLOPE, ANGLE, TEXTURE, PICTURE = 8.0, 6.0, 15.0, 8.0, 6.0, 3.0
OTHER_SEED = 4_000_000
PASSES = 64  # of the photograph, of 64 samples each: with 16 its own noise moves the brushed plate by per cents
CELLS = (24, 18)  # of the poster


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="*", default=ROOMS, metavar="ROOM")
    parser.add_argument("--cache", type=Path, help="folder that keeps the photographs (default: a temporary one)")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for room in chosen.rooms:
            cache = chosen.cache or Path(folder)
            photograph = cache / f"{room}.exr"
            if not photograph.is_file():
                finish(photographed(room, photograph, passes=PASSES))
            out = Path(folder) / room
            words = ("-o", out, "--json", out.with_suffix(".json"), "--budget", SECONDS[room])
            captures.command("inverse", room, photograph, *words)
            found = json.loads(out.with_suffix(".json").read_text(encoding="utf-8"))
            print(f"{room}: {found['seconds']:.0f} s, {found['renders']} renders")
            second = cache / f"{room}-again.exr"
            if not second.is_file():
                finish(photographed(room, second, seed=OTHER_SEED))
            found["picture"] = picture_error(out / "recovered.blend", (photograph, second))
            found["texture"] = texture_error(out / "recovered.blend") if room == "desk-room" else None
            for row in rows(room, found):
                print("  {:34}{:>12}{:>8}  {}".format(*row))


def rows(room: str, found: dict[str, Any]) -> Iterator[tuple[str, str, str, str]]:
    """Yield what, measured, bar and whether it holds."""

    def row(words: str, value: float, bar: float) -> tuple[str, str, str, str]:
        return words, f"{value:.2f}", f"{bar:g}", "yes" if value <= bar else "NO"

    for name, (diffuse, specular, alphas, angle) in truth(room).items():
        one = found["groups"][name]
        right = LEVEL.get(name, "diffuse")
        yield f"{name}: level", one["level"], right, "yes" if one["level"] == right else "NO"
        if one["level"] != right:
            continue
        if right == "texture":
            yield row(f"{name}: mean error of the texture, %", found["texture"], TEXTURE)
        bar = HIDDEN if one["seen"] != "directly" else BARS[room]
        if right == "diffuse":
            yield row(f"{name}: rho_max_pct", farthest(one["rho_d"], diffuse), bar)
        if specular is not None:
            yield row(f"{name}: rho_s, %", farthest(one["rho_s"], specular), SPECULAR)
        if right == "isotropic":
            yield row(f"{name}: alpha, %", farthest([one["alpha_x"]], alphas[:1]), SLOPE)
        if right == "anisotropic":
            yield row(f"{name}: larger alpha, %", farthest([one["alpha_y"]], alphas[1:]), SLOPE)
            yield row(f"{name}: angle, degrees", abs((one["angle"] - angle + 90) % 180 - 90), ANGLE)
    yield "picture against the photograph, noise of both, %", f"{100 * found['rerendered_rel_rmse']:.2f}", "", ""
    yield row("picture against the truth without noise, %", found["picture"], PICTURE)


def picture_error(recovered: Path, photographs: tuple[Path, Path]) -> float:
    """Return how far what is recovered renders off the truth [%], the noise of both taken off by two seeds of each."""
    missing = []
    with tempfile.TemporaryDirectory() as folder:
        for number, photograph in enumerate(photographs):
            path = Path(folder) / f"{number}.exr"
            finish(photographed(str(recovered), path, seed=2 * OTHER_SEED + 100 * number, passes=4))
            missing.append(read_rgb(photograph).astype(np.float64) - read_rgb(path))
    return 100 * noiseless_rmse(np.stack(missing), read_rgb(photographs[0]), np.ones(missing[0].shape[:2], bool))


def texture_error(recovered: Path) -> float:
    """Return the mean relative error of the poster's reflectance over cells of about two pixels [%]."""
    scenes.load(str(recovered))
    found = array(bpy.data.images["Poster Reflectance"])[..., :3]
    seen, true = (averaged(averaged(one, CELLS[0], 0), CELLS[1], 1) for one in (found, desk_room.poster()))
    return float(100 * np.abs(seen / true - 1).mean())


def truth(room: str) -> dict[str, Any]:
    """Return diffuse and specular reflectance, slopes and angle of every material of a room."""
    scenes.load(room)
    known = {}
    for material in bpy.data.materials:
        nodes = {node.type: node for node in material.node_tree.nodes}
        glossy = nodes.get("BSDF_GLOSSY") or nodes.get("BSDF_ANISOTROPIC")
        diffuse = np.array(nodes["BSDF_DIFFUSE"].inputs["Color"].default_value[:3])
        if glossy is None:
            known[material.name] = diffuse, None, np.zeros(2), 0.0
            continue
        alpha, stretch = glossy.inputs["Roughness"].default_value ** 2, 1 - glossy.inputs["Anisotropy"].default_value
        alphas = np.array([alpha * stretch, alpha / stretch])
        specular, turns = np.array(glossy.inputs["Color"].default_value[:3]), glossy.inputs["Rotation"].default_value
        known[material.name] = diffuse, specular, alphas, 360 * turns
    return known


def farthest(found: Any, true: Any) -> float:
    """Return the largest relative difference [%]."""
    return float(100 * np.abs(np.asarray(found) / np.asarray(true) - 1).max())


if __name__ == "__main__":
    main()
