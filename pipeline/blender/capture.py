"""Render an OLAT capture with Cycles: truth first, then one picture per light, each written atomically."""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections import deque
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
from . import closed_form, cycles, devices, geometry, olat, plan, rig, truth, workers
from .camera import camera_of
from .plan.audit import audit

JOURNAL = "finished.sha256"


def capture(scene: bpy.types.Scene, source: str, folder: Path, settings: CaptureSettings) -> Work[Capture]:
    """Capture a scene into a folder, or continue the capture that is there.

    Parameters
    ----------
    scene : Scene
        Its camera sees the object; its own lights and world are left out.
    source : str
        Name of the built-in scene or path of the .blend, from which workers load the same scene.
    folder : Path
    settings : CaptureSettings

    Yields
    ------
    Progress

    Returns
    -------
    Capture
        Complete. The files depend on scene, settings, Blender version and device: not on workers or interruptions.

    Raises
    ------
    LightsphereError
        For a scene or rig that cannot be captured, a folder that holds another capture, or a full disk.
    """
    started = describe(scene, source, folder, settings)
    folder.mkdir(parents=True, exist_ok=True)
    form = None
    if (folder / FILE).is_file():
        started = _continued(scene, Capture.open(folder), started)
    else:
        started, form = yield from _begun(scene, started, settings)
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
    finished.save()
    journal.remove()
    return finished


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
    digits = max(4, len(str(len(lights) - 1)))
    files = tuple(f"light_{i:0{digits}d}.exr" for i in range(len(lights)))
    return Capture(folder, camera, lights, files, ("",) * len(files), notes)


def _begun(
    scene: bpy.types.Scene, started: Capture, settings: CaptureSettings
) -> Work[tuple[Capture, closed_form.ClosedForm | None]]:
    """Write truth and description of a new capture, the description last.

    Returns it, and what makes its pictures where Cycles need not.
    """
    with cycles.own_lights_hidden(scene):
        truth.write(scene, started.camera, started.folder)
    decided = yield from plan.decide(scene, started.lights, PlanSettings(**dataclasses.asdict(settings)))
    planned = dataclasses.replace(started, notes=started.notes | decided.as_notes())
    renderer, form = yield from closed_form.choose(scene, planned)
    notes = planned.notes | {"renderer": dataclasses.asdict(renderer)}
    notes["sha256"] = {name: images.checksum(started.folder / name) for name in truth.FILES}
    begun = dataclasses.replace(started, notes=notes)
    begun.save()
    return begun, form


def _continued(scene: bpy.types.Scene, found: Capture, wanted: Capture) -> Capture:
    """Return the capture found in the folder, its truth intact; raise LightsphereError when another one is wanted."""
    before = {"device": devices.PROCESSOR.kind, **found.notes}  # older captures do not say it: there was no other
    for name in ("scene", "scene_sha256", "blender", "device"):
        if before.get(name) != wanted.notes.get(name):
            raise LightsphereError(
                f"{found.folder} holds a capture with {name} {before.get(name)}, not {wanted.notes.get(name)}; "
                "choose another folder or delete it"
            )
    now = wanted.notes["settings"]
    earlier = dataclasses.asdict(CaptureSettings()) | found.notes.get("settings", {})  # older captures lack new ones
    if different := [name for name in now if earlier[name] != now[name]]:
        words = ", ".join(f"{name} {earlier.get(name)}, not {now[name]}" for name in different)
        raise LightsphereError(f"{found.folder} holds a capture with {words}; choose another folder or delete it")
    if found.lights.as_json() != wanted.lights.as_json() or found.camera.as_json() != wanted.camera.as_json():
        raise LightsphereError(
            f"{found.folder} holds a capture with other lights or another camera; choose another folder or delete it"
        )
    if any(not _is_intact(found.folder / name, found.notes["sha256"][name]) for name in truth.FILES):
        with cycles.own_lights_hidden(scene):
            truth.write(scene, found.camera, found.folder)
    return found


def _remove_partial_files(folder: Path) -> None:
    for left in folder.glob(".*.part"):
        left.unlink(missing_ok=True)


def _is_intact(path: Path, checksum: str) -> bool:
    return path.is_file() and images.checksum(path) == checksum


def _intact(started: Capture, journal: Journal) -> dict[str, str]:
    """Return the recorded checksum of every picture by name, ``""`` where it is missing or damaged."""
    recorded = dict(zip(started.files, started.checksums, strict=True)) | journal.read()
    return {name: recorded[name] * _is_intact(started.folder / name, recorded[name]) for name in started.files}


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
    processor_cores = _processor_cores()
    on_gpu = devices.chosen().is_gpu  # which one process keeps busy
    processes = max(1, min(processes or (1 if on_gpu else processor_cores), len(pending)))
    threads = max(1, processor_cores // processes)
    words = ["capture-worker", source, str(started.folder), "--threads", str(threads)]
    words += ["--device", "gpu" if on_gpu else "cpu"]
    with workers.Pool(processes - 1, words, pending) as pool:
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


def _processor_cores() -> int:
    """Return how many cores this process may use."""
    count = getattr(os, "process_cpu_count", os.cpu_count)  # the former from Python 3.13 on
    return count() or 1
