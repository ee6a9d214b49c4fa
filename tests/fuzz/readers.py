"""Every reader of files that others may have made, and a small good file for each."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from pipeline.core import images, light_file
from pipeline.core.brdf import files as brdf_files
from pipeline.core.brdf.parametric import Ward
from pipeline.core.capture import FILE, Capture
from pipeline.core.dataset import folder as dataset
from pipeline.core.dataset.draw import draw, sample_name
from pipeline.core.dataset.recipe import Recipe, template
from pipeline.core.photographs import formats, matlab, stack
from pipeline.core.photographs.settings import ImportSettings
from pipeline.core.photographs.tables import table
from pipeline.core.progress import finish
from pipeline.core.reflectance.bivariate import open_reflectance
from pipeline.core.shape import Shape
from pipeline.core.shape.mesh import Mesh
from pipeline.core.shape.ply import read_ply, write_ply
from tests import synthetic

SIDE = 12


@dataclass(frozen=True)
class Reader:
    """A reader of one kind of file.

    Parameters
    ----------
    files : tuple of Path
        Good files, in a folder where what belongs to them lies, too.
    read : callable
        Reads the file at a path, and all that is read because of it.
    """

    files: tuple[Path, ...]
    read: Callable[[Path], Any]


def readers(folder: Path) -> dict[str, Reader]:
    """Write good files into a folder, and return their readers by name."""
    from pipeline.blender import pictures

    capture = _capture(folder / "capture")
    shape = dataclasses.replace(synthetic.ball(synthetic.camera(SIDE)), notes={"capture": "../capture"})
    shape.save(folder / "shape")
    arrays = _arrays(folder)
    recipe = folder / "recipe.toml"
    recipe.write_text(template())
    short = folder / "short.toml"
    short.write_text('seed = 1\nlights = {count = [3, 9]}\n[output]\nformats = ["capture"]\n')
    lists = _lists(folder)
    kept = _dataset(folder / "dataset")
    return {
        "exr": Reader(tuple(sorted(capture.glob("*.exr"))), images.read_channels),
        "capture.json": Reader((capture / FILE,), lambda path: _every_picture(Capture.open(path.parent))),
        "lights": Reader(lists, lambda path: light_file.read(path, np.zeros(3))),
        "table": Reader((lists[1],), lambda path: table(path, 3)),
        "mat": Reader((arrays["mat"], arrays["plain"]), matlab.read),
        "npy": Reader((arrays["npy"],), lambda path: _shots(stack.read(path, ImportSettings()))),
        "npz": Reader((arrays["npz"],), lambda path: _shots(stack.read(path, ImportSettings()))),
        "brdf": Reader((arrays["brdf"], arrays["tables"]), _brdf),
        "recipe": Reader((recipe, short), Recipe.read),
        "dataset": Reader(kept, lambda path: finish(dataset.verify(folder / "dataset"))),
        "shape.json": Reader(tuple(sorted((folder / "shape").glob("*.json"))), lambda path: Shape.open(path.parent)),
        "reflectance": Reader(_reflectance(folder / "reflectance"), lambda path: open_reflectance(path.parent)),
        "ply": Reader((arrays["ply"],), read_ply),
        "picture": Reader(_pictures(folder), pictures.read),
        "diligent": Reader(
            _diligent(folder / "ballPNG"),
            lambda path: _shots(formats.find(path.parent, ImportSettings(), pictures.read)),
        ),
    }


def _capture(folder: Path) -> Path:
    folder.mkdir()
    synthetic.write_capture(
        folder, synthetic.ball(synthetic.camera(SIDE)), np.array([0.6, 0.4, 0.2]), np.full(3, 0.1), 0.5
    )
    whole = Capture.open(folder)
    whole.select(np.arange(3)).save()
    for name in whole.files[3:]:
        (folder / name).unlink()
    return folder


def _every_picture(capture: Capture) -> None:
    capture.mask()
    capture.truth()
    for light in range(len(capture)):
        capture.image(light)
    capture.damaged()


def _shots(found: Any) -> None:
    for group in found.shots[:3]:
        for shot in group:
            shot.read()
    if found.mask is not None:
        found.mask.read()


def _brdf(path: Path) -> None:
    for name in brdf_files.tables_in(path)[:2]:
        brdf_files.read_brdf(path, name).evaluate(np.array([[0.0, 0.6, 0.8]]), np.array([[0.0, 0.0, 1.0]]))


def _arrays(folder: Path) -> dict[str, Path]:
    paths = {name: folder / f"arrays.{name}" for name in ("mat", "npy", "npz", "ply")}
    paths |= {"brdf": folder / "brushed.npz", "tables": folder / "tables.npz"}
    paths["plain"] = folder / "plain.mat"
    chance = np.random.default_rng(3)
    pictures = chance.random((4, SIDE, SIDE, 3)).astype(np.float32)
    for name in ("mat", "plain"):
        savemat(paths[name], {"Normal_gt": pictures[0], "S": pictures[0, :4, 0]}, do_compression=name == "mat")
    np.save(paths["npy"], pictures)
    np.savez_compressed(paths["npz"], images=pictures, lights=np.eye(4, 3) + 0.1)
    brdf_files.write_npz(paths["brdf"], Ward(np.full(3, 0.1), np.full(3, 0.2), 0.1, 0.3))
    nodes = np.linspace(0.1, 1.4, 5)
    np.savez(
        paths["tables"], theta_h=nodes, theta_d=nodes, gold=chance.random((5, 5, 3)), wood=chance.random((5, 5, 3))
    )
    write_ply(paths["ply"], Mesh(np.eye(3), np.eye(3), np.zeros((3, 2)), np.array([[0, 1, 2]])))
    return paths


def _lists(folder: Path) -> tuple[Path, ...]:
    rows = [(0.0, 0.6, 0.8), (0.6, 0.0, 0.8), (0.0, 0.0, 1.0)]
    lp, text, listed = folder / "lights.lp", folder / "lights.txt", folder / "lights.json"
    lp.write_text("3\n" + "".join(f"a{i}.png {x} {y} {z}\n" for i, (x, y, z) in enumerate(rows)))
    text.write_text("".join(f"{x} {y} {z}\n" for x, y, z in rows))
    listed.write_text(json.dumps([{"position": row, "intensity": [1, 2, 3], "file": "a.png"} for row in rows]))
    return lp, text, listed


def _dataset(folder: Path) -> tuple[Path, ...]:
    recipe = Recipe.of({"count": 2})
    dataset.begin(folder, recipe, {})
    for index in range(2):
        made = folder / f"{index}{dataset.PART}"
        (made / "capture" / sample_name(index)).mkdir(parents=True)
        (made / "capture" / sample_name(index) / "light.exr").write_text("picture")
        dataset.commit(made, folder, index)
    dataset.remove_partial(folder)
    dataset.write_manifest(folder, [draw(recipe, index) for index in range(2)], {})
    dataset.list_shared(folder, [folder / dataset.MANIFEST])
    named = (dataset.RECIPE, dataset.MANIFEST, dataset.SHARED)
    return (*(folder / name for name in named), dataset.finished_list(folder, 1))


def _reflectance(folder: Path) -> tuple[Path, ...]:
    from pipeline.core.reflectance import Reflectance

    ones = np.ones((SIDE, SIDE, 3), np.float32)
    values: dict[str, Any] = {}
    for item in dataclasses.fields(Reflectance):
        if item.name != "notes":
            values[item.name] = 0.5 * (ones if item.name in ("albedo", "specular") else ones[..., 0])
    Reflectance(**values, notes={"model": "ggx"}).save(folder)
    return tuple(sorted(path for path in folder.iterdir() if path.is_file()))


def _pictures(folder: Path) -> tuple[Path, ...]:
    from pipeline.blender.exr import openimageio

    oiio = openimageio()
    pixels = np.random.default_rng(1).random((SIDE, SIDE, 3)).astype(np.float32)
    paths = []
    for name, kind in (("a.png", "uint16"), ("b.jpg", "uint8"), ("c.tif", "uint16"), ("d.hdr", "float")):
        file = oiio.ImageOutput.create(name)
        file.open(str(folder / name), oiio.ImageSpec(SIDE, SIDE, 3, kind))
        file.write_image(pixels)
        file.close()
        paths.append(folder / name)
    return tuple(paths)


def _diligent(folder: Path) -> tuple[Path, ...]:
    from pipeline.blender import exr

    folder.mkdir()
    for name in ("001.png", "002.png", "003.png"):
        exr.write_png(folder / name, np.full((SIDE, SIDE, 3), 0.5))
    (folder / "filenames.txt").write_text("001.png\n002.png\n003.png\n")
    for name in ("light_directions.txt", "light_intensities.txt"):
        (folder / name).write_text("0 0.6 0.8\n0.6 0 0.8\n0.1 0.1 1\n")
    savemat(folder / "Normal_gt.mat", {"Normal_gt": np.full((SIDE, SIDE, 3), 0.57)})
    return tuple(sorted(folder.iterdir()))
