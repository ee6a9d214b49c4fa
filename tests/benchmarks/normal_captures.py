"""The captures that normals, bases and weight maps are measured on, made where a folder does not hold them yet."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from pipeline.core import images
from pipeline.core.capture import Capture, with_lights
from pipeline.core.capture_settings import CaptureSettings
from pipeline.core.progress import finish

REPOSITORY = Path(__file__).resolve().parents[2]
GOURD = "gourd"
NEAR = CaptureSettings(resolution=96, effects="direct", workers=1)  # 320 and 80 lights at 2 and 3 m
CENTRE = np.zeros(3)  # of the gourd and its rig
MATERIAL = 64  # width of the pictures of a material's sphere [px]
RADIUS = 0.8  # of that sphere [m]


def command(*words: object) -> None:
    """Run a command of the pipeline in a process of its own; its summary is not shown.

    Linux counts what a process held before it became another program as that program's own peak memory. The shell
    between is small, so that the command's figure is its own.
    """
    pipeline = (sys.executable, "-m", "pipeline", *map(str, words))
    subprocess.run(
        ["sh", "-c", '"$@"; exit $?', "sh", *pipeline], cwd=REPOSITORY, stdout=subprocess.DEVNULL, check=True
    )


def distant(cache: Path, scene: str, lights: int, effects: str = "direct") -> Capture:
    """Return a built-in scene under distant lights over the hemisphere about the view, 128x128."""
    folder = cache / f"{scene}-{lights}-{effects}"
    if not _whole(folder):
        rig = ("--rig", "distant", "--inner", lights, "--resolution", 128, "--effects", effects)
        command("capture", scene, "-o", folder, *rig)
    return Capture.open(folder)


def near(cache: Path, degrees: float = 0.0) -> Capture:
    """Return the gourd under the lights of two spheres, from its camera or one orbited about the vertical."""
    from pipeline.blender import capture, scene
    from pipeline.blender.camera import add_camera, camera_of

    folder = cache / f"gourd-near-{degrees:g}"
    if not _whole(folder):
        loaded = scene.load(GOURD)
        loaded.view_layers[0].update()
        add_camera(loaded, camera_of(loaded, NEAR.resolution).orbited(CENTRE, degrees))
        finish(capture.capture(loaded, GOURD, folder, NEAR))
    return Capture.open(folder)


def material(cache: Path, index: int) -> Capture:
    """Return a sphere of one of the gourd's materials under the lights of two spheres: f cos of every light."""
    from pipeline.blender import capture, scene
    from scenes import gourd, stage
    from scenes.surfaces import Mesh, grid

    folder = cache / f"gourd-material-{index}"
    if not _whole(folder):
        loaded = scene.load(GOURD)
        kept = loaded.objects["Gourd"].data.materials[0]
        for item in [item for item in loaded.objects if item.type == "MESH"]:
            loaded.collection.objects.unlink(item)
        polar, around = np.meshgrid(np.linspace(0, np.pi, 181), np.arange(0, 2 * np.pi, np.pi / 180), indexing="ij")
        points = [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)]
        ball: Mesh = grid(RADIUS * np.stack(points, axis=-1))
        item = stage.add_object(loaded, "Ball", ball, kept)
        stage.add_attribute(item, gourd.WEIGHTS, np.tile(np.eye(3)[index], (len(ball.vertices), 1)))
        finish(capture.capture(loaded, GOURD, folder, dataclasses.replace(NEAR, resolution=MATERIAL)))
    return Capture.open(folder)


def true_weights(capture: Capture) -> NDArray[np.float64]:
    """Return how much of each of the gourd's materials every pixel shows, (H, W, 3); NaN off the object."""
    from scenes import gourd

    truth = capture.truth()
    assert truth is not None
    weights = gourd.weights(truth.position.reshape(-1, 3).astype(np.float64)).reshape(truth.position.shape)
    return np.where(capture.mask()[..., None], weights, np.nan)


def imported(cache: Path, path: Path) -> Capture:
    """Return photographs or a stack of them as a capture."""
    folder = cache / path.stem
    if not _whole(folder):
        command("import", path, "-o", folder)
    return Capture.open(folder)


def written(drawn: Capture, folder: Path) -> Capture:
    """Write a capture that is held in memory, with its truth."""
    truth = drawn.truth()
    assert truth is not None
    for light, name in enumerate(drawn.files):
        images.write_rgb(folder / name, drawn.image(light))
    layers = {"depth.V": truth.depth, "material.V": truth.material.astype(np.float32)}
    for name, vectors in (("normal", truth.normal), ("position", truth.position)):
        layers |= {f"{name}.{axis}": vectors[..., i] for i, axis in enumerate("XYZ")}
    images.write_channels(folder / "truth.exr", layers)
    images.write_channels(folder / "mask.exr", {"mask.V": drawn.mask().astype(np.float32)})
    made = Capture(folder, drawn.camera, drawn.lights, drawn.files, drawn.checksums, drawn.notes)
    made.save()
    return made


def without(capture: Capture, left_out: NDArray[np.int64], folder: Path) -> Capture:
    """Write a capture that lacks some lights; its pictures stay where they are."""
    kept = capture.select(np.setdiff1d(np.arange(len(capture)), left_out))
    return with_lights(kept, kept.lights, folder)


def _whole(folder: Path) -> bool:
    return (folder / "capture.json").is_file() and not Capture.open(folder).changed()
