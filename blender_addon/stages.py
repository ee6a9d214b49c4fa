"""What runs behind the buttons: one stage at a time, in a worker process, on a saved copy of the file."""

from __future__ import annotations

import json
import time
from pathlib import Path

import bpy

from ..pipeline.core.capture_settings import CaptureSettings
from ..pipeline.core.compare import CompareSettings
from ..pipeline.core.errors import LightsphereError
from ..pipeline.core.material import MaterialSettings
from ..pipeline.core.photographs.settings import ImportSettings
from ..pipeline.core.shape.settings import ShapeSettings
from . import preferences, properties, results, settings, worker
from .task import Task

COMMAND = "command.json"  # in a result's folder: the words that make it, so that it can be continued
SCENE_COPY = "scene.blend"

running: Run | None = None


class Stage:
    """A stage as the add-on sees it: what it lacks to run, the words of its command, what its result brings."""

    name: str
    doing: str

    def lacks(self, scene: bpy.types.Scene) -> str:
        """Return why the stage cannot run, empty when it can."""
        raise NotImplementedError

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        """Return the command's words; the result goes into the folder."""
        raise NotImplementedError

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        """Put the result into the scene; return what to tell the artist."""
        raise NotImplementedError


class Capture(Stage):
    """Render the scene under one light at a time."""

    name = "capture"
    doing = "Capturing"

    def lacks(self, scene: bpy.types.Scene) -> str:
        if properties.of(scene).capture.rig == results.OWN_RIG and not results.rigs(scene):
            return "The scene has no rig: add one"
        return lacks_rig(scene)

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        chosen = settings.values(properties.of(scene).capture, CaptureSettings)
        copy = folder / SCENE_COPY
        bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True, check_existing=False)
        return ["capture", str(copy), "-o", str(folder), *settings.options(chosen)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        properties.of(scene).capture_folder = shown(folder)
        pictures = results.pictures(folder)
        return f"{pictures} pictures in {folder}"


class Import(Stage):
    """Make a capture from photographs."""

    name = "import_photographs"
    doing = "Importing"

    def lacks(self, scene: bpy.types.Scene) -> str:
        path = properties.of(scene).photographs
        if not path:
            return "No photographs are chosen yet"
        return "" if absolute(path).exists() else "No photographs are there"

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        chosen = settings.values(properties.of(scene).import_photographs, ImportSettings)
        path = absolute(properties.of(scene).photographs)
        return ["import", str(path), "-o", str(folder), *settings.options(settings.absolute(chosen))]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        properties.of(scene).capture_folder = shown(folder)
        pictures = results.pictures(folder)
        return f"{pictures} pictures in {folder}"


class Shape(Stage):
    """Recover depth and mesh from a capture."""

    name = "shape"
    doing = "Recovering the shape"

    def lacks(self, scene: bpy.types.Scene) -> str:
        return lacks_capture(scene)

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        chosen = settings.values(properties.of(scene).shape, ShapeSettings)
        capture = absolute(properties.of(scene).capture_folder)
        return ["shape", str(capture), "-o", str(folder), *settings.options(chosen)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        properties.of(scene).shape_folder = shown(folder)
        return f"The mesh {results.mesh(scene, folder).name!r} is in the scene"


class Material(Stage):
    """Give the recovered shape a material that Cycles renders."""

    name = "material"
    doing = "Fitting the material"

    def lacks(self, scene: bpy.types.Scene) -> str:
        folder = properties.of(scene).shape_folder
        if not folder:
            return "No shape is chosen yet"
        return "" if (absolute(folder) / "shape.json").is_file() else "No recovered shape is there"

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        chosen = settings.values(properties.of(scene).material, MaterialSettings)
        shape = absolute(properties.of(scene).shape_folder)
        return ["material", str(shape), "-o", str(folder / results.ASSET), *settings.options(chosen)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        return f"The asset {results.asset(scene, folder / results.ASSET).name!r} is in the scene"


class Compare(Stage):
    """Render the asset beside its capture."""

    name = "compare"
    doing = "Comparing"

    def lacks(self, scene: bpy.types.Scene) -> str:
        lacking = "" if results.assets(scene) else "The scene has no asset: make one"
        return lacks_capture(scene) or lacking

    def words(self, scene: bpy.types.Scene, folder: Path) -> list[str]:
        chosen = settings.values(properties.of(scene).compare, CompareSettings)
        copy = folder / SCENE_COPY
        bpy.ops.wm.save_as_mainfile(filepath=str(copy), copy=True, check_existing=False)
        capture = absolute(properties.of(scene).capture_folder)
        figures = ["--json", str(folder / results.FIGURES)]
        return ["compare", str(copy), str(capture), "-o", str(folder), *figures, *settings.options(chosen)]

    def bring(self, scene: bpy.types.Scene, folder: Path) -> str:
        results.error_maps(folder)
        found = results.errors(folder).items()
        words = ", ".join(f"{name.replace('_', ' ')} {100 * error:.2g} %" for name, error in found)
        return f"Relative RMSE: {words}. Error maps are among the images, a page is in {folder}"


STAGES: dict[str, Stage] = {stage.name: stage for stage in (Capture(), Import(), Shape(), Material(), Compare())}


class Run:
    """One run of a stage, driven by timer events or by waiting."""

    def __init__(self, stage: Stage, scene: bpy.types.Scene, folder: Path | None = None) -> None:
        """Start the stage; a folder is that of a stopped run, which is continued."""
        global running
        self.stage, self.scene_name = stage, scene.name
        if folder is None:
            self.folder = new_folder(stage.name)
            words = stage.words(scene, self.folder)
            (self.folder / COMMAND).write_text(json.dumps(words), encoding="utf-8")
        else:
            self.folder = folder
            words = json.loads((folder / COMMAND).read_text(encoding="utf-8"))
        self.task = Task(*worker.command_line(words), worker.first_words(words))
        running = self

    def event(self, kind: str) -> str:
        """Take a window event; return ``"running"``, ``"stopped"`` or ``"ended"``."""
        global running
        if kind == "ESC":
            self.task.stop()
        if self.task.poll():
            return "running"
        running = None
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

    def bring(self) -> str:
        """Put the ended run's result into its scene; raise LightsphereError when the worker failed."""
        if self.task.error:
            raise LightsphereError(self.task.error)
        scene = bpy.data.scenes.get(self.scene_name)
        if scene is None:
            raise LightsphereError(f"the scene {self.scene_name!r} is gone; the result is in {self.folder}")
        return self.stage.bring(scene, self.folder)


def stop() -> None:
    """Stop whatever runs."""
    if running is not None:
        running.stop()


def lacks(name: str, scene: bpy.types.Scene) -> str:
    """Return why a stage cannot start now, empty when it can."""
    if running is not None:
        return f"{running.stage.doing}: Esc stops it"
    return STAGES[name].lacks(scene)


def lacks_rig(scene: bpy.types.Scene) -> str:
    """Return why no rig can stand in a scene, empty when it can."""
    if scene.camera is None:
        return "The scene has no camera"
    if not any(item.type == "MESH" and not item.hide_render for item in scene.objects):
        return "The scene has no mesh to capture"
    return ""


def lacks_capture(scene: bpy.types.Scene) -> str:
    """Return why a scene's capture cannot be opened, empty when it can."""
    folder = properties.of(scene).capture_folder
    if not folder:
        return "No capture is chosen yet"
    return "" if results.finished(absolute(folder)) else "No finished capture is there"


def absolute(folder: str) -> Path:
    """Return a folder of the artist's as an absolute path."""
    return Path(bpy.path.abspath(folder))


def shown(folder: Path) -> str:
    """Return a result's folder as the scene keeps it: relative to a saved file, so that both can move together."""
    return bpy.path.relpath(str(folder)) if bpy.data.filepath else str(folder)


def results_folder() -> Path:
    """Return where results go: beside the saved file, else where the preferences say."""
    if bpy.data.filepath:
        return Path(bpy.data.filepath).with_suffix(".lightsphere")
    return Path(preferences.results()) if preferences.results() else worker.user_folder("results")


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
    """Return the share of the work that is done and the words for it."""
    share = task.done / task.total if task.total else 0.0
    count = f" {task.done:g} of {task.total:g} {task.unit}" if task.total else ""
    return share, f"{task.stage}{count}"
