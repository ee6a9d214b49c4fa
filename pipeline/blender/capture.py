"""Render an OLAT capture with Cycles: truth first, then one picture per light, each written atomically."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import tempfile
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..core import images
from ..core import rig as layouts
from ..core.capture import FILE, Capture
from ..core.capture_settings import CaptureSettings, PlanSettings
from ..core.errors import LightsphereError
from ..core.journal import Journal
from ..core.progress import Progress, Work
from ..core.tradeoff.goal import Goal, Promise
from . import closed_form, cycles, devices, geometry, olat, plan, rig, sampling, truth, workers
from .camera import camera_of
from .plan.audit import audit

JOURNAL = "finished.sha256"
CHOSEN = ("samples", "error")  # settings that a goal decides
TIMED = 8  # pictures without Cycles that are timed for a promise


def capture(
    scene: bpy.types.Scene, source: str, folder: Path, settings: CaptureSettings, goal: Goal | None = None
) -> Work[Capture]:
    """Capture a scene into a folder, or continue the capture that is there.

    Parameters
    ----------
    scene : Scene
        Its camera sees the object; its own lights and world are left out.
    source : str
        Name of the built-in scene or path of the .blend, from which workers load the same scene.
    folder : Path
    settings : CaptureSettings
    goal : Goal, optional
        For which a new capture's samples are chosen, and effects by its target; a capture that is continued keeps its
        own.

    Yields
    ------
    Progress

    Returns
    -------
    Capture
        Complete. The files depend on scene, settings, Blender version and device: not on workers or interruptions.
        A new one with a goal has the note ``"promise"``; see :meth:`~pipeline.core.tradeoff.goal.Promise.kept`.

    Raises
    ------
    LightsphereError
        For a scene or rig that cannot be captured, a folder that holds another capture, or a full disk.
    """
    settings = settings if goal is None else _aimed(settings, goal)
    started = describe(scene, source, folder, settings)
    folder.mkdir(parents=True, exist_ok=True)
    form, promise = None, None
    if (folder / FILE).is_file():
        started = _continued(scene, Capture.open(folder), started, () if goal is None else CHOSEN)
    else:
        started, form, promise = yield from _begun(scene, started, settings, goal)
    journal = Journal(folder / JOURNAL)
    done = _intact(started, journal)
    try:
        _remove_partial_files(folder)  # of a killed run
        if _without_cycles(started):
            yield from _make_all(scene, form, started, done, journal)
        else:
            yield from _render_all(scene, source, started, settings.workers, done, journal)
    finally:
        _remove_partial_files(folder)  # of workers that were stopped
    finished = dataclasses.replace(started, checksums=tuple(done[name] for name in started.files))
    if settings.effects == "auto" and "audit" not in finished.notes:
        found = yield from audit(scene, finished)
        finished = dataclasses.replace(finished, notes=finished.notes | {"audit": dataclasses.asdict(found)})
    if promise is not None:
        missing = finished.notes.get("audit", {}).get("error_pct", 0.0) / 100
        errors = yield from sampling.obtained(scene, finished, missing)
        finished = dataclasses.replace(finished, notes=finished.notes | {"promise": promise.kept(errors)})
    finished.save()
    journal.remove()
    return finished


def foresee(scene: bpy.types.Scene, source: str, settings: CaptureSettings, goal: Goal) -> Work[Promise]:
    """Return what a capture is expected to cost, its plan included, and give, by trials that leave nothing behind."""
    settings = _aimed(settings, goal)
    with tempfile.TemporaryDirectory() as folder:
        started = describe(scene, source, Path(folder), settings)
        start = time.perf_counter()
        planned, _, form, missing = yield from _planned(scene, started, settings)
        planning = time.perf_counter() - start
        found = yield from _promised(scene, planned, form, goal, missing, settings.workers)
        trials = [dataclasses.replace(trial, seconds=trial.seconds + planning) for trial in found.trials]
        return dataclasses.replace(found, trials=trials)


def describe(scene: bpy.types.Scene, source: str, folder: Path, settings: CaptureSettings) -> Capture:
    """Return the capture that a scene and settings ask for, its pictures not yet rendered.

    Raises
    ------
    LightsphereError
        When the scene has no camera or object, or a light stands inside the object.
    """
    scene.view_layers[0].update()
    camera = camera_of(scene, settings.resolution)
    triangles = geometry.object_triangles(scene)
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    centre = (low + high) / 2
    if settings.rig == "scene":
        lights = rig.lights_of(rig.find(scene))
    else:
        view = camera.to_world[:3, 3] - centre
        lights = layouts.lights_for(settings, centre, view / np.linalg.norm(view))
    if lights.kind == "near":
        geometry.check_outside(lights.position, triangles)
    notes: dict[str, Any] = {"scene": Path(source).name, "blender": bpy.app.version_string}
    notes["device"] = devices.chosen().kind
    if Path(source).suffix == ".blend":
        notes["scene_sha256"] = images.checksum(Path(source))
    notes["settings"] = {k: v for k, v in dataclasses.asdict(settings).items() if k != "workers"}
    notes["diameter"] = float((high - low).max())
    files = picture_names(len(lights))
    return Capture(folder, camera, lights, files, ("",) * len(files), notes)


def picture_names(count: int) -> tuple[str, ...]:
    """Return the names of a capture's pictures."""
    digits = max(4, len(str(count - 1)))
    return tuple(f"light_{i:0{digits}d}.exr" for i in range(count))


def _begun(
    scene: bpy.types.Scene, started: Capture, settings: CaptureSettings, goal: Goal | None
) -> Work[tuple[Capture, closed_form.ClosedForm | None, Promise | None]]:
    """Write truth and description of a new capture, the description last.

    Returns it, what makes its pictures where Cycles need not, and what is promised for a goal.
    """
    with cycles.own_lights_hidden(scene):
        truth.write(scene, started.camera, started.folder)
    planned, renderer, form, missing = yield from _planned(scene, started, settings)
    promise = None
    if goal is not None:
        promise = yield from _promised(scene, planned, form, goal, missing, settings.workers)
        samples = promise.expected.settings["samples"]
        for part in (planned.notes["settings"], planned.notes["transport"]):
            part["samples"] = samples
    notes = planned.notes | {"renderer": dataclasses.asdict(renderer)}
    notes["sha256"] = {name: images.checksum(started.folder / name) for name in truth.FILES}
    begun = dataclasses.replace(started, notes=notes)
    begun.save()
    return begun, form, promise


def _planned(
    scene: bpy.types.Scene, started: Capture, settings: CaptureSettings
) -> Work[tuple[Capture, closed_form.Renderer, closed_form.ClosedForm | None, float]]:
    """Decide which light paths pictures have and what makes them; return that, and the share of light left out."""
    decided = yield from plan.decide(scene, started.lights, PlanSettings(**dataclasses.asdict(settings)))
    planned = dataclasses.replace(started, notes=started.notes | decided.as_notes())
    renderer, form = yield from closed_form.choose(scene, planned)
    missing = decided.missing.contribution_pct if decided.missing is not None else None
    return planned, renderer, form, (missing or 0.0) / 100


def _aimed(settings: CaptureSettings, goal: Goal) -> CaptureSettings:
    """Return the settings with effects decided by a goal's target."""
    return settings if goal.target is None else dataclasses.replace(settings, error=min(goal.target, 100.0))


def _promised(
    scene: bpy.types.Scene,
    planned: Capture,
    form: closed_form.ClosedForm | None,
    goal: Goal,
    missing: float,
    processes: int,
) -> Work[Promise]:
    """Choose the samples of a planned capture for a goal."""
    processes = _processes(processes, len(planned))
    if form is None:
        cost = yield from sampling.measured(scene, planned)
    else:
        some = range(min(len(planned), TIMED))
        start = time.perf_counter()
        for light in closed_form.make(form, planned, some, processes):
            yield Progress("samples", light + 1, len(some), "pictures")
        cost = sampling.Cost(0.0, 0.0, processes * (time.perf_counter() - start) / len(some), 0.0)
    return sampling.promise(cost, planned, goal, processes, missing)


def _continued(scene: bpy.types.Scene, found: Capture, wanted: Capture, chosen: Sequence[str]) -> Capture:
    """Return the capture found in the folder, its truth intact; raise LightsphereError when another one is wanted.

    ``chosen`` are settings that it may have chosen for itself.
    """
    before = {"device": devices.PROCESSOR.kind, **found.notes}  # older captures do not say it: there was no other
    for name in ("scene", "scene_sha256", "blender", "device"):
        if before.get(name) != wanted.notes.get(name):
            raise LightsphereError(
                f"{found.folder} holds a capture with {name} {before.get(name)}, not {wanted.notes.get(name)}; "
                "choose another folder or delete it"
            )
    now = wanted.notes["settings"]
    earlier = dataclasses.asdict(CaptureSettings()) | found.notes.get("settings", {})  # older captures lack new ones
    if different := [name for name in now if earlier[name] != now[name] and name not in chosen]:
        words = ", ".join(f"{name} {earlier.get(name)}, not {now[name]}" for name in different)
        raise LightsphereError(f"{found.folder} holds a capture with {words}; choose another folder or delete it")
    parts = [(one.lights.as_json(), one.camera.as_json(), one.files) for one in (found, wanted)]
    if parts[0] != parts[1]:
        raise LightsphereError(
            f"{found.folder} holds a capture with other lights or another camera; choose another folder or delete it"
        )
    if any(not images.is_intact(found.folder / name, found.notes["sha256"][name]) for name in truth.FILES):
        with cycles.own_lights_hidden(scene):
            truth.write(scene, found.camera, found.folder)
    return found


def _remove_partial_files(folder: Path) -> None:
    for left in folder.glob(".*.part"):
        left.unlink(missing_ok=True)


def _intact(started: Capture, journal: Journal) -> dict[str, str]:
    """Return the recorded checksum of every picture by name, ``""`` where it is missing or damaged."""
    recorded = dict(zip(started.files, started.checksums, strict=True)) | journal.read()
    return {name: recorded[name] * images.is_intact(started.folder / name, recorded[name]) for name in started.files}


def _without_cycles(started: Capture) -> bool:
    return bool(started.notes.get("renderer", {}).get("name") == closed_form.CLOSED_FORM)


def _make_all(
    scene: bpy.types.Scene,
    form: closed_form.ClosedForm | None,
    started: Capture,
    done: dict[str, str],
    journal: Journal,
) -> Work[None]:
    """Make the pictures not done without Cycles, noting each in ``done`` and the journal."""
    pending = [i for i, name in enumerate(started.files) if not done[name]]
    if not pending:
        return
    form = form or closed_form.again(scene, started)
    for light in closed_form.make(form, started, pending, _processor_cores()):
        yield _note(started, light, images.checksum(started.folder / started.files[light]), done, journal)


def _render_all(
    scene: bpy.types.Scene,
    source: str,
    started: Capture,
    processes: int,
    done: dict[str, str],
    journal: Journal,
) -> Work[None]:
    """Render the pictures not done, here and in workers, noting each in ``done`` and the journal."""
    pending = deque(i for i, name in enumerate(started.files) if not done[name])
    processes = _processes(processes, len(pending))
    threads = max(1, _processor_cores() // processes)
    device = "gpu" if devices.chosen().is_gpu else "cpu"
    words = ["capture-worker", source, str(started.folder), "--device", device]
    with workers.Pool(processes - 1, words, pending, threads) as pool:
        own = olat.render_lights(scene, started, workers.taken(pending), threads)
        with contextlib.closing(own):
            for light in own:
                yield _note(started, light, images.checksum(started.folder / started.files[light]), done, journal)
                for other, checksum in pool.finished():
                    yield _note(started, other, checksum, done, journal)
        while not all(done.values()):
            yield _note(started, *pool.wait(), done, journal)


def _note(started: Capture, light: int, checksum: str, done: dict[str, str], journal: Journal) -> Progress:
    name = started.files[light]
    journal.add(name, checksum)
    done[name] = checksum
    return Progress("render", sum(map(bool, done.values())), len(started), "pictures")


def _processes(wanted: int, pictures: int) -> int:
    """Return how many processes render so many pictures; a GPU is kept busy by one."""
    return max(1, min(wanted or (1 if devices.chosen().is_gpu else _processor_cores()), pictures))


def _processor_cores() -> int:
    """Return how many cores this process may use."""
    count = getattr(os, "process_cpu_count", os.cpu_count)  # the former from Python 3.13 on
    return count() or 1
