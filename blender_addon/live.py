"""Relight live: while it is on, moving a light of the scene refreshes the relit picture."""

from __future__ import annotations

import queue
import threading
from pathlib import Path

import bpy

from ..pipeline.blender import emitters
from ..pipeline.core.errors import LightsphereError
from ..pipeline.core.relight import messages
from ..pipeline.core.workers import Died, Worker
from . import results, stages, windows, worker

INTERVAL = 0.05  # [s] between two looks at the lights
IMAGE = "Lightsphere Relit"

session: Session | None = None


class Session:
    """A worker that keeps a capture ready, and a thread that asks it for one picture after another.

    Attributes
    ----------
    told : str
        What is wrong with the lights or the capture, or that it is starting; empty where the picture is up to date.
    """

    def __init__(self, scene: bpy.types.Scene) -> None:
        self.scene_name = scene.name
        self.told = "Reading the capture"
        self.path = Path(bpy.app.tempdir) / "lightsphere_relit.exr"
        shape = str(stages.given(scene, "shape_folder"))
        words = ["relight-worker", shape, str(self.path), *stages.STAGES["relight"].options(scene)]
        self._worker = Worker(*worker.command_line(words))
        self._asked: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._last, self._is_waiting = "", False
        self._thread = threading.Thread(target=self._ask, daemon=True)
        self._thread.start()

    def look(self, scene: bpy.types.Scene) -> bool:
        """Take in an answer, and ask for a picture where the lights have changed; return whether anything is new."""
        new = False
        while not self._answers.empty():
            self.told, self._is_waiting, new = self._answers.get(), False, True
            if not self.told:
                renew(self.path)
        if self._is_waiting or not self._thread.is_alive():
            return new
        try:
            line = messages.as_line(emitters.of_scene(scene, measure=False))
        except LightsphereError as error:
            new = new or self.told != str(error)
            self.told = str(error)
            return new
        if line != self._last:
            self._last, self._is_waiting = line, True
            self._asked.put(line)
        return new

    def close(self) -> None:
        """End the worker and the thread."""
        self._worker.kill()
        self._asked.put(None)
        self._thread.join()
        self._worker.close()

    def _ask(self) -> None:
        while (line := self._asked.get()) is not None:
            try:
                self._worker.ask(line, "picture")
                self._answers.put("")
            except LightsphereError as error:
                self._answers.put(str(error))
            except Died as death:
                self._answers.put(death.words.splitlines()[-1] if death.words else "The worker ended")
                return


def start(scene: bpy.types.Scene) -> None:
    """Keep the scene's relit picture up to date from now on."""
    global session
    session = Session(scene)
    if not bpy.app.timers.is_registered(tick):  # it was ended a moment ago
        bpy.app.timers.register(tick, first_interval=INTERVAL)


def stop() -> None:
    """Leave the picture as it is."""
    global session
    if session is not None:
        session.close()
        session = None


def tick() -> float | None:
    """Look at the lights and at the worker; called by Blender's timer."""
    if session is None:
        return None
    scene = bpy.data.scenes.get(session.scene_name)
    if scene is None:
        stop()
        return None
    if session.look(scene):
        for kind in ("VIEW_3D", "IMAGE_EDITOR"):
            for _, area in windows.areas(kind):
                area.tag_redraw()
    return INTERVAL


def renew(path: Path) -> None:
    """Show the picture as it is on disk now."""
    image = bpy.data.images.get(IMAGE)
    if image is None:
        results.show_image(results.picture(path, IMAGE))
    else:
        image.reload()


@bpy.app.handlers.persistent
def _leave(*_: object) -> None:
    stop()


def register() -> None:
    """End a session when another file is opened."""
    bpy.app.handlers.load_pre.append(_leave)


def unregister() -> None:
    """End a session and take the handler back."""
    stop()
    bpy.app.handlers.load_pre.remove(_leave)
