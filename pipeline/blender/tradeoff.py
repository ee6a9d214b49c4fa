"""Error against time of the stages that render: capture, material and inverse."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.brdf import Brdf
from ..core.capture_settings import CaptureSettings
from ..core.inverse import InverseSettings
from ..core.inverse.estimate import noiseless_rmse
from ..core.inverse.photograph import Photograph, prepared
from ..core.material.fit import fit
from ..core.material.principled import fit_principled
from ..core.progress import Progress, Work, retold
from ..core.tradeoff import Trial, Variant
from ..core.tradeoff.thinning import evenly
from . import capture, cycles, plan, truth, views
from . import scene as scenes
from .camera import camera_of
from .inverse import groups
from .inverse.room import Room
from .inverse.solve import Search
from .pictures import Picture
from .render_cost import render_seconds

LIGHTS, SIDE = 4, 64  # of the trial pictures of a capture
PATHS = ((1, 64), (2, 64), (4, 64), (plan.MOST_BOUNCES, 16), (plan.MOST_BOUNCES, 64), (plan.MOST_BOUNCES, 256))
REFERENCE_SAMPLES = 512  # of either of the two references
LOBES = (1, 2, 3, 4, 6, 8)
SEARCHES = ((80, 20.0, "all"), (160, 20.0, "diffuse"), (160, 20.0, "all"), (160, 60.0, "all"), (160, 180.0, "all"))
JUDGED_SAMPLES, JUDGED_SEEDS = 128, (2_000_000, 2_000_001)


def of_capture(name: str) -> Work[list[Variant]]:
    """Return bounces and samples that are tried on a scene, judged by the mean of two references of other seeds.

    The references' own noise, told by their difference, is taken off.
    """
    scene = scenes.load(name)
    described = capture.describe(scene, name, Path(), CaptureSettings(resolution=SIDE))
    chosen = evenly(len(described), LIGHTS)
    lights, camera = described.lights.select(chosen), camera_of(scene, SIDE)
    mask = truth.object_mask(scene, camera)
    best = cycles.Transport(plan.MOST_BOUNCES, samples=REFERENCE_SAMPLES)
    references = []
    for seed in (1, 2):
        work = views.under_lights(scene, camera, lights, best, seed)
        pictures = yield from retold(work, lambda step: dataclasses.replace(step, stage="reference"))
        references.append(pictures[:, mask].astype(np.float64))
    first, second = references
    power = float((((first + second) / 2) ** 2).mean())
    noise = float(((first - second) ** 2).mean()) / 4

    def judged(pictures: NDArray[np.float32]) -> dict[str, float]:
        squared = float(((pictures[:, mask] - (first + second) / 2) ** 2).mean())
        return {"relight_rel_rmse": float(np.sqrt(max(squared - noise, 0.0) / power))}

    found = []
    for bounces, samples in ((0, 1), *PATHS):
        transport = cycles.Transport(bounces, samples=samples)
        label = f"{bounces} bounces, {samples}" if bounces else "direct"
        work = partial(views.under_lights, scene, camera, lights, transport)
        found.append(
            Variant(label, {"bounces": bounces, "samples": samples}, 1.0 + samples * (1 + bounces) / 50, work, judged)
        )
    return found


def of_material(brdfs: Sequence[Brdf], fresnel: bool) -> Work[list[Trial]]:
    """Fit basis BRDFs with more and more closures; return error and the time that Cycles takes to render a sphere.

    The last trial is the nearest Principled BSDF.
    """
    mixtures = {}
    for number, most in enumerate(LOBES):
        mixture = yield from retold(fit(brdfs, most, fresnel), partial(_fitting, number))
        mixtures[len(mixture.lobes) - 1] = mixture
    seconds = yield from render_seconds(list(mixtures.values()))
    trials = []
    for (count, mixture), taken in zip(mixtures.items(), seconds[:-1], strict=True):
        error = float(np.mean(mixture.notes["material_rel_rms"]))
        label = f"diffuse + {count}"
        trials.append(Trial(label, {"lobes": count}, taken, {"material_rel_rms": error}))
    nearest = fit_principled(brdfs, np.ones((1, 1, len(brdfs), 1), np.float32))
    error = float(np.mean(nearest.notes["principled_rel_rms"]))
    return [*trials, Trial("Principled", {"lobes": None}, seconds[-1], {"material_rel_rms": error})]


def of_inverse(name: str, picture: Picture, settings: InverseSettings) -> list[Variant]:
    """Return sizes, times and levels that are tried on a photograph, judged by what the result renders beside it."""
    found = []
    for width, budget, levels in SEARCHES:
        chosen = dataclasses.replace(settings, resolution=width, budget=budget, levels=levels)
        label = f"{width} px, {budget:g} s" + ("" if levels == "all" else f", {levels}")
        described = {"resolution": width, "budget": budget, "levels": levels}
        judge = partial(_rerendered, picture, settings)
        found.append(Variant(label, described, budget, partial(_searched, name, picture, chosen), judge))
    return found


def _searched(name: str, picture: Picture, settings: InverseSettings) -> Work[Room]:
    """Search a room anew; return it as it was found."""
    scene = scenes.load(name)
    scene.view_layers[0].update()
    seen = _photograph(scene, picture, settings)
    room = Room(scene, groups.find(scene, settings.groups), seen)
    yield from Search(room, seen, settings).run()
    return room


def _rerendered(picture: Picture, settings: InverseSettings, room: Room) -> dict[str, float]:
    seen = _photograph(room.scene, picture, settings)
    room.render_like(seen)
    residuals = seen.pixels - np.stack([room.render(JUDGED_SAMPLES // 2, seed) for seed in JUDGED_SEEDS])
    return {"rerendered_rel_rmse": noiseless_rmse(residuals, seen.pixels, seen.trusted)}


def _photograph(scene: bpy.types.Scene, picture: Picture, settings: InverseSettings) -> Photograph:
    size = (scene.render.resolution_x, scene.render.resolution_y)
    return prepared(picture.pixels, picture.bits, settings.response, size, settings.resolution)


def _fitting(number: int, step: Progress) -> Progress:
    """Tell of a fit as a part of all."""
    return Progress("fit", number + step.done / max(step.total, 1e-30), len(LOBES), "fits")
