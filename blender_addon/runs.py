"""One run of a stage at a time, in a worker process, and the numbered folders of their results."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import Any

import bpy

from ..pipeline.core.errors import LightsphereError
from . import costs, preferences, results, worker
from .stages import STAGES, Stage
from .task import Task

COMMAND = "command.json"  # in a result's folder: the words that make it, so that it can be continued
FORECAST = "forecast.json"

running: Run | None = None
last: Run | None = None


class Run:
    """One run of a stage, driven by timer events or by waiting.

    Parameters
    ----------
    stage : Stage
    scene : bpy.types.Scene
    folder : Path, optional
        That of a stopped run, which is continued; else a new one.
    """

    def __init__(self, stage: Stage, scene: bpy.types.Scene, folder: Path | None = None) -> None:
        global running, last
        self.stage, self.scene_name = stage, scene.name
        self.folder = folder or new_folder(stage.name)
        command = self.folder / COMMAND
        if not command.is_file():
            command.write_text(json.dumps(self._words(scene)), encoding="utf-8")
        words = json.loads(command.read_text(encoding="utf-8"))
        self._began, self._seconds = time.monotonic(), 0.0
        self.task = Task(*worker.command_line(words), worker.first_words(words))
        running = last = self

    def _words(self, scene: bpy.types.Scene) -> list[str]:
        return self.stage.words(scene, self.folder)

    def event(self, kind: str) -> str:
        """Take a window event; return ``"running"``, ``"stopped"`` or ``"ended"``."""
        global running
        if kind == "ESC":
            self.task.stop()
        if self.task.poll():
            return "running"
        running = None
        self._seconds = time.monotonic() - self._began
        return "stopped" if self.task.stopped else "ended"

    def wait(self) -> None:
        """Wait for the end; an interrupt stops the worker and goes on to the caller."""
        try:
            while self.event("TIMER") == "running":
                time.sleep(0.05)
        except BaseException:
            self.stop()
            raise

    def stop(self) -> None:
        """Stop the worker and wait for its end; finished pictures are kept."""
        while self.event("TIMER" if self.task.stopped else "ESC") == "running":
            time.sleep(0.05)

    def stopped(self) -> str:
        """Put what a stopped run leaves into its scene, and say what that is."""
        scene = bpy.data.scenes.get(self.scene_name)
        left = self.stage.left(scene, self.folder) if scene else ""
        return f"Stopped; {left or f'what is finished is kept in {self.folder}'}"

    def bring(self) -> str:
        """Put the ended run's result into its scene; raise LightsphereError when the worker failed."""
        if self.task.error:
            raise LightsphereError(self.task.error)
        scene = bpy.data.scenes.get(self.scene_name)
        if scene is None:
            raise LightsphereError(f"the scene {self.scene_name!r} is gone; the result is in {self.folder}")
        return self._bring(scene)

    def _bring(self, scene: bpy.types.Scene) -> str:
        costs.remember_time(scene, self.stage.name, self._seconds)
        return self.stage.bring(scene, self.folder)


class Estimate(Run):
    """Trials that tell what presets of a stage would take and give, see :mod:`.costs`; leaves no folder."""

    def __init__(self, stage: Stage, scene: bpy.types.Scene) -> None:
        self._signature, self._presets = costs.signature(stage, scene), {}
        super().__init__(stage, scene, new_folder("estimate"))

    def _words(self, scene: bpy.types.Scene) -> list[str]:
        return [*self.stage.words(scene, self.folder), "--dry-run", "--json", str(self.folder / FORECAST)]

    def event(self, kind: str) -> str:
        state = super().event(kind)
        if state != "running":
            if (self.folder / FORECAST).is_file():
                self._read(json.loads((self.folder / FORECAST).read_text(encoding="utf-8")))
            shutil.rmtree(self.folder)
        return state

    def _read(self, figures: dict[str, Any]) -> None:
        start_up = self._seconds - figures["seconds"]  # of the worker, which every run has, too
        self._presets = figures["presets"]
        for preset in self._presets.values():
            preset["seconds"] += start_up

    def stopped(self) -> str:
        return "Stopped"

    def _bring(self, scene: bpy.types.Scene) -> str:
        costs.remember_presets(scene, self.stage.name, self._signature, self._presets)
        return f"{self.stage.name.title()}: choose a preset by what it takes and gives"


def stop() -> None:
    """Stop whatever runs."""
    if running is not None:
        running.stop()


def busy() -> str:
    """Return what runs and keeps all else from starting, empty when nothing does."""
    return f"{running.stage.doing}: Esc stops it" if running is not None else ""


def lacks(name: str, scene: bpy.types.Scene) -> str:
    """Return why a stage cannot start now, empty when it can."""
    return busy() or STAGES[name].lacks(scene)


def results_folder() -> Path:
    """Return where results go: beside the saved file, else where the preferences say."""
    if bpy.data.filepath:
        return Path(bpy.data.filepath).with_suffix(".lightsphere")
    return preferences.results_folder()


def new_folder(name: str) -> Path:
    """Make the next free numbered folder for a stage's result: nothing is overwritten."""
    number = 1
    while True:
        folder = results_folder() / f"{name}_{number:03d}"
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            number += 1
        else:
            return folder


def stopped_capture() -> Path | None:
    """Return the folder of the newest capture here when it was stopped before its end."""
    folders = sorted(results_folder().glob("capture_*"))
    if folders and (folders[-1] / COMMAND).is_file() and not results.finished(folders[-1]):
        return folders[-1]
    return None


def told(task: Task) -> tuple[float, str]:
    """Return the share of the work that is done and the words for it: how much, how fast, how long still."""
    share = task.done / task.total if task.total else 0.0
    count = f" {task.done:g} of {task.total:g} {task.unit}" if task.total else ""
    left = f", {costs.duration(task.seconds_left)} left" if task.seconds_left is not None else ""
    rate = f", {task.rate:.3g}/s" if task.rate and task.unit not in ("", "%") else ""
    return share, f"{task.stage}{count}{rate}{left}"
