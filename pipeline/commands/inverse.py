"""`lightsphere inverse`: reflectances of a known scene from one picture."""

from __future__ import annotations

import dataclasses
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..core import images
from ..core.compare.pictures import relative_rmse
from ..core.errors import LightsphereError
from ..core.inverse import InverseSettings
from ..core.inverse.estimate import noiseless_rmse
from ..core.inverse.photograph import prepared
from ..core.tradeoff import Trial
from ..core.tradeoff.goal import Goal, Promise, choose
from .device import Device, render_on
from .stage import DryRun, Figures, JsonFile, run_with_bar, settings_options

BLEND, PAGE = "recovered.blend", "report.html"
FINAL_SAMPLES, STOPPED_SAMPLES = 64, 16
FINAL_SEEDS = (2_000_000, 2_000_001)
PILOT_SAMPLES, PILOTS, SPARE = 8, 3, 1.5  # by which is told what follows a search, beside so many seconds
LEAST_SEARCH = 0.1  # of the budget, however long what follows it takes


@settings_options(InverseSettings)
def inverse(
    scene: Annotated[str, typer.Argument(help="the .blend with geometry, camera and lights; or a built-in scene")],
    photograph: Annotated[
        Path,
        typer.Argument(help="the picture of the real thing: EXR, PNG, TIFF, JPEG, RAW; or a folder of its exposures"),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of the results")],
    settings: InverseSettings,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace earlier results")] = False,
    dry_run: DryRun = False,
    device: Device = "cpu",
    json: JsonFile = None,
) -> None:
    """Recover what every group of surfaces reflects, with global illumination, from one picture of a known scene.

    The scene's own materials are not looked at: surfaces that share one are a group, and every group gets the simplest
    level that explains its pixels: diffuse, mirror, diffuse-specular, isotropic, anisotropic, or a texture. What only a
    mirror shows is found through it. Writes recovered.blend, the scene with the recovered materials as nodes, the
    picture that it renders, and a page with what was tried, the errors and what they cost. Ctrl-C ends the search and
    writes what is known by then. The scene's file stays as it is. Materials that do more than reflect (glass, lamps)
    are kept, and so is what the picture tells nothing of.

    The search ends when every reflectance is as sure as --target says, and early enough for all to be written within
    --budget; the closing line says what was obtained of both.
    """
    from ..blender import scene as scenes
    from ..blender.cycles import changed
    from ..blender.inverse import groups
    from ..blender.inverse.forecast import ERROR, Forecast
    from ..blender.inverse.room import Room
    from ..blender.inverse.solve import Search
    from ..blender.inverse.source import Source
    from ..blender.inverse.uses import SAMPLES, WAYS, pictures
    from ..blender.pictures import merged, read

    if (output / BLEND).exists() and not overwrite and not dry_run:
        raise LightsphereError(f"{output / BLEND} exists; choose another folder, or replace it with --overwrite")
    goal = Goal(settings.budget, settings.target)
    with Figures("inverse", json) as figures:
        figures.values["device"] = render_on(device)
        several = photograph.is_dir()
        picture = merged(photograph, settings.response) if several else read(photograph)
        loaded = scenes.load(scene)
        loaded.view_layers[0].update()
        size = (loaded.render.resolution_x, loaded.render.resolution_y)
        response = "linear" if several else settings.response
        seen = prepared(picture.pixels, picture.bits, response, size, settings.resolution)
        every = groups.find(loaded, settings.groups)
        room = Room(loaded, every, seen)
        follows = SPARE + _sample_seconds(room) * (FINAL_SAMPLES + len(WAYS) * SAMPLES)
        if dry_run:
            work = Forecast(room, seen, settings).foretold(goal.spent, follows)
            figures.foreseen(choose(run_with_bar(work, one_bar=True), Goal()))
            return
        left = max(settings.budget - goal.spent - follows, LEAST_SEARCH * settings.budget)
        asked = dataclasses.replace(settings, budget=left)
        search = {"joint": Search, "source": Source}[settings.method](room, seen, asked)
        found, stopped = _searched(search)
        figures.values.update(_figures(room, found, every))
        samples = STOPPED_SAMPLES if stopped else FINAL_SAMPLES
        seeds = [room.render(samples // 2, seed) for seed in FINAL_SEEDS]
        shown = np.mean(seeds, axis=0)
        figures.values["rerendered_rel_rmse"] = noiseless_rmse(seen.pixels - np.array(seeds), seen.pixels, seen.trusted)
        figures.values["rerendered_noise"] = relative_rmse(shown, seeds[0], seen.trusted)
        output.mkdir(parents=True, exist_ok=True)
        images.write_rgb(output / "rerendered.exr", shown.astype("float32"))
        room.restore(_untold(room, found))
        with changed(loaded.render, room.own):
            scenes.save(output / BLEND)
        from ..report.inverse import Results, report

        uses = {} if stopped else run_with_bar(pictures(room))
        results = Results(Path(scene).stem, seen.pixels, seen.trusted, figures.values, found.pictures, uses)
        images.write_text(output / PAGE, report(results))
        levels = [one["level"] for one in figures.values["groups"].values()]
        counted = ", ".join(f"{levels.count(level)} {level}" for level in dict.fromkeys(levels))
        figures.summary = (
            f"{counted}; rerendered_rel_rmse {figures.values['rerendered_rel_rmse']:.3g}; look at {output / PAGE}"
        )
        if search.deviations:  # the source's method knows none
            sure = {ERROR: 100 * search.uncertainty()}
            figures.promise = _promise(settings, goal, sure)
            figures.obtained(sure)
    if stopped:
        print(f"lightsphere: what was found so far is in {output}; --overwrite searches anew", file=sys.stderr)
        raise KeyboardInterrupt


def _sample_seconds(room: Any) -> float:
    """Return what a sample a pixel of the room's picture takes [s], by the quickest pilot: others were disturbed."""
    room.render(1, FINAL_SEEDS[0])  # builds what all renders share
    lasted = []
    for _ in range(PILOTS):
        start = time.perf_counter()
        room.render(PILOT_SAMPLES, FINAL_SEEDS[0])
        lasted.append(time.perf_counter() - start)
    return min(lasted) / PILOT_SAMPLES


def _promise(settings: InverseSettings, goal: Goal, sure: dict[str, float]) -> Promise:
    """Return time and uncertainty that were asked for as a promise, of which is known what was obtained."""
    missed = any(value > settings.target for value in sure.values())
    lacks = "the search ended before all reflectances were as sure as asked for" if missed else ""
    asked = {"budget": settings.budget, "target": settings.target}
    expected = Trial("", asked, settings.budget, dict.fromkeys(sure, settings.target))
    return Promise(goal, expected, settings.budget, lacks, ())


def _searched(search: Any) -> tuple[Any, bool]:
    """Return what a search found, or knew when it was stopped, and whether it was."""
    work = search.run()
    try:
        return run_with_bar(work, one_bar=True), False
    except KeyboardInterrupt:
        work.close()
        if (known := search.stopped()) is None:
            raise
        return known, True


def _untold(room: Any, found: Any) -> list[int]:
    """Return the groups of which nothing is known, not from the picture and not beforehand."""
    return [number for number, word in enumerate(found.seen) if word == "not at all" and number not in room.known]


def _figures(room: Any, found: Any, every: list[Any]) -> dict[str, Any]:
    """Return what was found about every group, and what it cost."""
    described: dict[str, Any] = {}
    untold = _untold(room, found)
    for number, group in enumerate(room.groups):
        seen = found.seen[number]
        described[group.name] = {
            **found.models[number].as_json(),
            "material": room.materials[number].name,
            **({"known": True} if number in room.known else {"deviation": found.deviations[number]}),
            "seen": seen,
            "pixels": found.pixels[number],
            "tried": found.tried[number],
            "cost": found.costs[number],
        }
        if number in untold:
            described[group.name] = {"level": "kept", "seen": seen, "why": "the picture tells nothing of it"}
    for group in every:
        if group.kept:
            described[group.name] = {"level": "kept", "why": f"it {group.kept}"}
    cost = {"renders": room.renders, "render_seconds": room.seconds, "samples": room.samples}
    return {"groups": described, "lamps": found.lamps, "history": found.history, **cost}
