"""Rooms drawn by lot, on which nothing was tuned: what inverse finds of each surface, beside what it is.

Run as ``.venv-3.13/bin/python tests/benchmarks/drawn_rooms.py [--cache FOLDER] [--budget SECONDS] [SEED ...]`` with the
Python that ``bootstrap.py`` set up. Walls, a picture on one of them, five things on the floor and a lamp, 160x120
pixels, photographed with 1024 samples a pixel. A level is right, too, where plastic is found as the lobe that its
boundary has.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import normal_captures as captures

from pipeline.blender.inverse.photograph import photographed
from pipeline.core.inverse import GGX, Model
from pipeline.core.progress import finish
from scenes import rooms, stage

THINGS = ("diffuse", "diffuse", "isotropic", "isotropic", "metal", "anisotropic", "mirror", "plastic")
FLOORS = ("diffuse", "diffuse", "isotropic", "plastic")
PICTURES = ("texture", "mirror", "diffuse")
NOTHING = np.zeros(3)
SHARP = 1e-3


class Draw:
    """A room in the open file, and what its surfaces are."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.truth: dict[str, Model] = {}
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        self._walls()
        for number, x in enumerate(np.linspace(0.4 - self.width, self.width - 0.4, 5)):
            self._thing(f"Thing {number}", float(x))
        uniform = self.rng.uniform
        lamp = (uniform(-0.5, 0.5), uniform(-0.5, 0.8), self.height - 0.02)
        rooms.lamp(self.scene, lamp, tuple(uniform(0.4, 1.2, 2)), uniform(60, 120))
        view = (uniform(-0.5, 0.5), 0.15 - self.depth, uniform(1.3, 1.7))
        rooms.camera(self.scene, view, (0, 0.9, 0.7), uniform(58, 70))

    def _walls(self) -> None:
        uniform, quad = self.rng.uniform, rooms.quad
        x, y, z = self.width, self.depth, self.height = uniform(1.5, 2.2), uniform(1.8, 2.6), uniform(2.2, 2.8)
        wall, floor = self._surface("Walls", "diffuse"), self._surface("Floor", self.rng.choice(FLOORS))
        ceiling, left = (self._surface(name, "diffuse") for name in ("Ceiling", "Left wall"))
        quad(self.scene, "Floor", [(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)], floor)
        quad(self.scene, "Ceiling", [(-x, y, z), (x, y, z), (x, -y, z), (-x, -y, z)], ceiling)
        quad(self.scene, "Back", [(-x, y, 0), (x, y, 0), (x, y, z), (-x, y, z)], wall)
        quad(self.scene, "Front", [(x, -y, 0), (-x, -y, 0), (-x, -y, z), (x, -y, z)], wall)
        quad(self.scene, "Left", [(-x, -y, 0), (-x, y, 0), (-x, y, z), (-x, -y, z)], left)
        quad(self.scene, "Right", [(x, y, 0), (x, -y, 0), (x, -y, z), (x, y, z)], wall)
        half, at, up = uniform(0.4, 0.8), uniform(-0.6, 0.6), uniform(1.1, 1.5)
        corners = [(-half, -0.4), (half, -0.4), (half, 0.4), (-half, 0.4)]
        picture = self._surface("Picture", self.rng.choice(PICTURES))
        quad(self.scene, "Picture", [(at + side, y - 0.01, up + rise) for side, rise in corners], picture)

    def _thing(self, name: str, x: float) -> None:
        level = self.rng.choice(THINGS)
        y, size = self.rng.uniform(-0.2, self.depth - 0.7), self.rng.uniform(0.22, 0.38)
        if level == "anisotropic":  # brushed along a flat top
            stand = self._surface(f"{name} stand", "diffuse")
            rooms.block(self.scene, f"{name} stand", (x, y, 0.15), (1.6 * size, 1.6 * size, 0.3), stand)
            corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
            plate = [(x + 1.2 * size * right, y + 1.2 * size * back, 0.31) for right, back in corners]
            rooms.quad(self.scene, name, plate, self._surface(name, level))
        elif self.rng.uniform() < 0.55:
            bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=size, location=(x, y, size))
            bpy.ops.object.shade_smooth()
            bpy.context.object.name = name
            bpy.context.object.data.materials.append(self._surface(name, level))
        else:
            turn, surface = self.rng.uniform(0, 90), self._surface(name, level)
            rooms.block(self.scene, name, (x, y, size), (1.4 * size, 1.4 * size, 2 * size), surface, turn)

    def _surface(self, name: str, kind: str) -> bpy.types.Material:
        uniform = self.rng.uniform
        colour = uniform(0.08, 0.75) * (0.35 + 0.65 * uniform(size=3))
        drawn: dict[str, Callable[[], Model]] = {
            "diffuse": lambda: Model("diffuse", colour, NOTHING),
            "isotropic": lambda: Model("isotropic", colour, np.full(3, uniform(0.05, 0.35)), uniform(0.06, 0.35)),
            "metal": lambda: Model("isotropic", NOTHING, uniform(0.4, 0.9, 3), uniform(0.05, 0.3)),
            "anisotropic": lambda: Model(
                "anisotropic", np.full(3, 0.04), np.full(3, uniform(0.4, 0.7)),
                uniform(0.09, 0.22), uniform(2.5, 4), uniform(0, 180),
            ),
            "mirror": lambda: Model("mirror", NOTHING, np.full(3, uniform(0.6, 0.95)), SHARP),
            "plastic": lambda: Model("plastic", colour, NOTHING, uniform(0.15, 0.5) ** 2, distribution=GGX),
            "texture": lambda: Model("texture", np.ones(3), NOTHING),
        }  # fmt: skip
        model = self.truth[name] = drawn[kind]()
        if kind == "texture":
            count = self.rng.integers(3, 7)
            return rooms.textured(name, np.kron(uniform(0.1, 0.7, (count, count, 3)), np.ones((12, 12, 1))))
        if kind == "plastic":
            inputs = {"Base Color": (*model.diffuse, 1.0), "Roughness": model.alpha**0.5}
            return stage.material(name, "ShaderNodeBsdfPrincipled", inputs)
        specular = model.specular if model.specular.any() else None
        return rooms.surface(name, model.diffuse, specular, model.alphas, model.angle)


def main() -> None:
    """Print a table for every room."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", nargs="*", type=int, default=[1, 2, 3, 4], metavar="SEED")
    parser.add_argument("--cache", type=Path, help="folder that keeps rooms and photographs (default: a temporary one)")
    parser.add_argument("--budget", type=float, default=240.0, help="seconds for each room")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for seed in chosen.seeds:
            room, photograph = ((chosen.cache or Path(folder)) / f"{seed}.{kind}" for kind in ("blend", "exr"))
            room.parent.mkdir(parents=True, exist_ok=True)
            truth = Draw(seed).truth
            if not photograph.is_file():
                bpy.ops.wm.save_as_mainfile(filepath=str(room))
                finish(photographed(str(room), photograph, passes=16))
            out = Path(folder) / f"{seed}"
            words = ("-o", out, "--json", out.with_suffix(".json"), "--budget", chosen.budget)
            captures.command("inverse", room, photograph, *words)
            report(seed, truth, json.loads(out.with_suffix(".json").read_text(encoding="utf-8")))


def report(seed: int, truth: dict[str, Model], found: dict[str, object]) -> None:
    """Print what was found of every group beside what it is."""
    groups = found["groups"]
    right = sum(matches(truth[name].level, one["level"]) for name, one in groups.items())
    print(f"room {seed}: {right} of {len(groups)} levels right, {found['seconds']:.0f} s", flush=True)
    for name, one in groups.items():
        true = truth[name]
        words = [f"  {name:14}{true.level:12}{one['level']:17}{one['pixels']:6} pixels, {one['seen']:15}"]
        if "rho_d" in one and true.level != "texture":
            words.append(f"rho_d {np.abs(np.array(one['rho_d']) - true.diffuse).max():.3f} off")
        if "rho_s" in one and true.specular.any():
            words.append(f"rho_s {100 * np.abs(np.array(one['rho_s']) / true.specular - 1).max():.0f} %")
        if "alpha_y" in one and true.alpha > SHARP:
            words.append(f"larger slope {100 * abs(one['alpha_y'] / true.alphas[1] - 1):.0f} %")
        print(", ".join(words), flush=True)


def matches(true: str, found: str) -> bool:
    """Return whether a level is the true one; plastic is isotropic, too."""
    return found == true or (true, found) in {("plastic", "isotropic"), ("mirror", "perfect-mirror")}


if __name__ == "__main__":
    main()
