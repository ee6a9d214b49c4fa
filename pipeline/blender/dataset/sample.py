"""One sample of a dataset as a capture, with all that is known of it, in the layouts that the recipe asks for."""

from __future__ import annotations

import dataclasses
import os
import shutil
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import images
from ...core.capture import Capture
from ...core.capture_settings import PlanSettings
from ...core.dataset import folder as dataset
from ...core.dataset.draw import Sample, draw, lights_of
from ...core.dataset.recipe import CAPTURE, PRINCIPLED, Recipe
from ...core.dataset.sensor import is_ideal, noise_of, sensor_of
from ...core.photographs.develop import HALF_BITS
from ...core.progress import finish
from ...core.rig import check_apart
from .. import closed_form, cycles, devices, exr, geometry, olat, plan, truth
from ..capture import picture_names
from . import formats, layers
from .scene import ball_about, build, light_axis, place_camera

DIRECT = "direct_"  # what names of pictures of direct light alone begin with


def make(recipe: Recipe, folder: Path, index: int, threads: int) -> None:
    """Make one sample of a dataset.

    Parameters
    ----------
    recipe : Recipe
    folder : Path
        Of the dataset, which was begun.
    index : int
    threads : int
        That render.

    Raises
    ------
    LightsphereError
        When what the sample is made of cannot be read or rendered, or the disk is full.
    """
    sample = draw(recipe, index)
    made = folder / f".{sample.name}.{socket.gethostname()}.{os.getpid()}{dataset.PART}"
    shutil.rmtree(made, ignore_errors=True)
    place = made / CAPTURE / sample.name
    place.mkdir(parents=True)
    try:
        capture = render(recipe, sample, place, threads)
        formats.write(recipe.output.formats, capture, made, sample)
        dataset.commit(made, folder, index)
    finally:
        shutil.rmtree(made, ignore_errors=True)


def render(recipe: Recipe, sample: Sample, place: Path, threads: int) -> Capture:
    """Build and render a sample as a capture in a folder."""
    scene, material = build(recipe, sample)
    triangles = geometry.object_triangles(scene)
    centre, radius = ball_about(triangles)
    camera = place_camera(scene, recipe, sample, centre, radius)
    scene.view_layers[0].update()
    lights = lights_of(recipe, sample, centre, radius, light_axis(recipe, camera, centre))
    check_apart(lights)
    if lights.kind == "near":
        geometry.check_outside(lights.position, triangles)
    settings = PlanSettings(
        effects="auto",
        error=recipe.render.error,
        samples=recipe.render.samples,
        resolution=recipe.camera.resolution,
        seed=sample.render_seed,
        pixel_type=recipe.render.pixel_type,
    )
    kept = ("renderer", "samples", "seed", "pixel_type")
    notes: dict[str, Any] = {"scene": sample.name, "blender": bpy.app.version_string}
    notes |= {"device": devices.chosen().kind, "settings": {name: getattr(settings, name) for name in kept}}
    notes |= {"diameter": float(np.ptp(triangles, axis=(0, 1)).max()), "material": material}
    notes["sample"] = sample.as_json()
    files = picture_names(len(lights))
    capture = Capture(place, camera, lights, files, ("",) * len(files), notes)
    with cycles.own_lights_hidden(scene):
        truth.write(scene, camera, place)
        if recipe.truth.layers:
            layers.write(scene, camera, place, sample.material == PRINCIPLED)
    planned = (
        finish(plan.decide(scene, lights, settings))
        if recipe.render.probe
        else plan.unmeasured(scene, lights, recipe.render.bounces, recipe.render.samples)
    )
    capture = dataclasses.replace(capture, notes=notes | planned.as_notes())
    capture = _pictures(scene, capture, threads)
    if recipe.truth.direct:
        _direct_pictures(scene, capture, threads)
    return _finished(capture if is_ideal(recipe.sensor) else _exposed(recipe, sample, capture))


def _pictures(scene: bpy.types.Scene, capture: Capture, threads: int) -> Capture:
    """Make the pictures of a described capture; return it with what made them."""
    renderer, form = finish(closed_form.choose(scene, capture))
    every = range(len(capture))
    work: Iterator[int] = (
        olat.render_lights(scene, capture, every, threads)
        if form is None
        else closed_form.make(form, capture, every, threads)
    )
    for _ in work:
        pass
    return dataclasses.replace(capture, notes=capture.notes | {"renderer": dataclasses.asdict(renderer)})


def _direct_pictures(scene: bpy.types.Scene, capture: Capture, threads: int) -> None:
    """Make the pictures of direct light alone beside a capture's; where nothing bounces they are the same."""
    direct = _of_direct_light(capture)
    if capture.notes["transport"]["bounces"]:
        _pictures(scene, direct, threads)
        return
    for name, same in zip(direct.files, capture.files, strict=True):
        shutil.copyfile(capture.folder / same, capture.folder / name)


def _of_direct_light(capture: Capture) -> Capture:
    """Return the description of a capture of the same sample under direct light alone."""
    files = tuple(DIRECT + name.removeprefix("light_") for name in capture.files)
    notes = capture.notes | {"transport": dataclasses.asdict(cycles.DIRECT)}
    return dataclasses.replace(capture, files=files, notes=notes)


def _exposed(recipe: Recipe, sample: Sample, capture: Capture) -> Capture:
    """Make photographs of a capture's pictures: radiances and intensities become shares of the sensor's white."""
    mask = capture.mask()
    every = range(len(capture))
    sensor = sensor_of(recipe.sensor, sample, (capture.image(light)[mask] for light in every))
    kind = "float" if sensor.bits > HALF_BITS else recipe.render.pixel_type
    for light in every:
        picture = sensor.expose(capture.image(light), noise_of(recipe.seed, sample, light))
        _write(capture.folder / capture.files[light], picture, kind)
    for name in _of_direct_light(capture).files if recipe.truth.direct else ():
        direct = images.read_rgb(capture.folder / name) / np.float32(sensor.white)
        _write(capture.folder / name, direct, recipe.render.pixel_type)
    notes = capture.notes | {"sensor": dataclasses.asdict(sensor), "saturation": 1.0}
    notes |= {"bit_depth": sensor.bits} if sensor.bits else {}
    simulated = {plan.NOISE: sensor.full_well > 0, plan.SATURATION: True}
    notes["effects"] = [
        row | {"simulated": True, "reason": "of the recipe's sensor"} if simulated.get(row["effect"]) else row
        for row in notes["effects"]
    ]
    lights = dataclasses.replace(capture.lights, intensity=capture.lights.intensity / sensor.white)
    return dataclasses.replace(capture, lights=lights, notes=notes)


def _write(path: Path, picture: NDArray[np.float32], kind: str) -> None:
    exr.write(path, {name: picture[..., i] for i, name in enumerate("RGB")}, kind)


def _finished(capture: Capture) -> Capture:
    """Note the checksums of a capture's files, and write its description."""
    beside = sorted(set(path.name for path in capture.folder.iterdir()) - set(capture.files))
    sums = {name: images.checksum(capture.folder / name) for name in beside}
    pictures = tuple(images.checksum(capture.folder / name) for name in capture.files)
    finished = dataclasses.replace(capture, checksums=pictures, notes=capture.notes | {"sha256": sums})
    finished.save()
    return finished
