"""The stages of a demo: each keeps its results in the output folder, so that a second run continues."""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..core import images
from ..core.capture import Capture
from ..core.capture_settings import CaptureSettings, PlanSettings
from ..core.compare.lights import new_lights
from ..core.compare.pictures import relative_rmse
from ..core.errors import LightsphereError
from ..core.progress import Progress, Work, retold, shares
from ..core.reflectance import Reflectance, ReflectanceSettings
from ..core.shape import Shape
from ..core.shape.mesh import relief
from ..core.shape.ply import write_ply
from ..core.shape.settings import ShapeSettings
from ..core.tradeoff import Trial, measure
from ..core.tradeoff.shape import double_sphere
from .stage import as_json

RECORD = "demo.json"
NEW_VIEW_DEGREES = 22.0
MOST_VIEW_PIXELS = 480
VIEW_PASSES, VIEW_SAMPLES = 8, 5
NEW_LAMPS = 16
FRACTIONS = (0.1, 0.25, 1.0)  # of the capture's lights; the last is the demo's own shape


@dataclass(frozen=True)
class Stage:
    """A part of the demo.

    Parameters
    ----------
    name : str
        As it is recorded and shown.
    seconds : float
        Expected on two processor cores; the bar's length is the sum.
    phases : dict of str to float
        The work's own stages in order, and what share of the time each takes.
    products : tuple of str
        Files in the output folder without which the stage is not done.
    work : callable
    """

    name: str
    seconds: float
    phases: dict[str, float]
    products: tuple[str, ...]
    work: Callable[[], Work[None]]


class Demo:
    """The demo in one output folder.

    Raises
    ------
    LightsphereError
        When the folder holds a demo of other settings, or an asset that somebody changed.
    """

    def __init__(self, folder: Path, settings: Any) -> None:
        self.folder = folder
        self.settings = settings
        self.scene = settings.scene
        wanted = dataclasses.asdict(settings)
        self.record: dict[str, Any] = {"settings": wanted, "seconds": {}}
        if (folder / RECORD).is_file():
            self.record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
            if self.record["settings"] != wanted:
                raise LightsphereError(f"{folder} holds a demo with other settings; choose another folder or delete it")

    def stages(self) -> list[Stage]:
        """Return the stages in order with the time each is expected to take."""
        s = self.settings
        pixels, lights = (s.resolution / 128) ** 2, (s.inner + s.outer) / 400
        rendering = (3 + 5 * pixels) * (1 if s.effects == "direct" else 20) * lights
        return [
            Stage("plan", 5, {"plan": 1}, ("effects.json",), self._plan),
            Stage("capture", rendering, {"plan": 0.1, "render": 0.9}, ("capture/capture.json",), self._capture),
            Stage("shape", 15 * pixels * lights, {"warm up": 0.1, "try": 0.9}, ("shape/shape.json",), self._shape),
            Stage("material", 3, {"reflectance": 0.4}, ("asset.blend", "reflectance/reflectance.json"), self._material),
            Stage(
                "views",
                2 + 14 * (self._view_pixels() / MOST_VIEW_PIXELS) ** 2,
                {"relight": 0.2, "true": 0.4, "asset": 0.4},
                ("views/asset.exr",),
                self._views,
            ),
            Stage("report", 3, {"report": 1}, ("report.html", "metrics.json", "teaser.png"), self._report),
        ]

    def work(self) -> Work[None]:
        """Run what is not done yet.

        Yields
        ------
        Progress in per cent of the expected time of what is left.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        stages = self.stages()
        first = next((i for i, stage in enumerate(stages) if not self._finished(stage)), len(stages))
        for stage in stages[first:]:
            self.record["seconds"].pop(stage.name, None)
        total = sum(stage.seconds for stage in stages[first:])
        before = 0.0
        for stage in stages[first:]:
            start = time.perf_counter()
            yield Progress(stage.name, 100 * before / total, 100, "%")
            for share in shares(stage.work(), stage.phases):
                yield Progress(stage.name, 100 * (before + share * stage.seconds) / total, 100, "%")
            before += stage.seconds
            self.record["seconds"][stage.name] = time.perf_counter() - start
            images.write_text(self.folder / RECORD, json.dumps(self.record, indent=1))

    def metrics(self) -> dict[str, Any]:
        """Return what metrics.json holds."""
        value: dict[str, Any] = json.loads((self.folder / "metrics.json").read_text(encoding="utf-8"))
        return value

    def _finished(self, stage: Stage) -> bool:
        return stage.name in self.record["seconds"] and all((self.folder / name).is_file() for name in stage.products)

    def _plan(self) -> Work[None]:
        from ..blender import capture, plan, scene

        loaded = scene.load(self.scene)
        wanted = PlanSettings(**dataclasses.asdict(self._capture_settings()) | {"effects": "auto"})
        described = capture.describe(loaded, self.scene, self.folder / "capture", wanted)
        found = yield from plan.decide(loaded, described.lights, wanted)
        effects = [dataclasses.asdict(effect) for effect in found.effects]
        images.write_text(self.folder / "effects.json", json.dumps(effects, indent=1))

    def _capture(self) -> Work[None]:
        from ..blender import capture, scene

        folder = self.folder / "capture"
        yield from capture.capture(scene.load(self.scene), self.scene, folder, self._capture_settings())

    def _shape(self) -> Work[None]:
        capture = self._opened_capture()
        trials = yield from measure(double_sphere(capture, FRACTIONS, ShapeSettings()))
        rows = [dataclasses.asdict(trial) for trial, _ in trials]
        images.write_text(self.folder / "tradeoff.json", json.dumps(rows, indent=1))
        trial, shape = trials[-1]
        settings = dataclasses.asdict(ShapeSettings())
        notes = {"capture": "../capture", "settings": settings, "errors": trial.errors, "seconds": trial.seconds}
        shape = dataclasses.replace(shape, notes=shape.notes | notes)
        write_ply(self._made("shape") / "mesh.ply", relief(shape))
        shape.save(self.folder / "shape")

    def _material(self) -> Work[None]:
        from ..blender import asset
        from ..core.reflectance.fit import fit

        path = self.folder / "asset.blend"
        if path.is_file() and images.checksum(path) != self.record.get("asset_sha256"):
            raise LightsphereError(f"{path} was changed since the demo wrote it; move it to keep it, or delete it")
        shape = Shape.open(self.folder / "shape")
        found = yield from fit(shape, self._opened_capture(), ReflectanceSettings())
        found.save(self.folder / "reflectance")
        asset.write(path, shape, found, Path(self.scene).stem, overwrite=True)
        self.record["asset_sha256"] = images.checksum(path)

    def _views(self) -> Work[None]:
        from ..blender import scene, views

        capture, shape = self._opened_capture(), Shape.open(self.folder / "shape")
        mesh = relief(shape)
        reflectance = Reflectance.open(self.folder / "reflectance")
        centre = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
        camera = capture.camera.orbited(centre, NEW_VIEW_DEGREES).resized(self._view_pixels())
        lamps = new_lights(capture.lights, capture.camera, NEW_LAMPS)
        folder = self._made("views")
        relit = []
        for name in ("true", "asset"):
            loaded = scene.load(self.scene)
            if name == "asset":
                views.exchange(loaded, shape, reflectance)
            relit.append((yield from _renamed(views.under_lights(loaded, capture.camera, lamps), "relight")))
            views.light_studio(loaded, capture.camera, centre, capture.notes["diameter"])
            picture = yield from _renamed(views.picture(loaded, camera, VIEW_PASSES, VIEW_SAMPLES), name)
            images.write_rgb(folder / f"{name}.exr", picture)
        mask = np.broadcast_to(capture.mask(), relit[0].shape[:-1])
        errors = {"relight_rel_rmse": relative_rmse(relit[1], relit[0], mask)}
        images.write_text(folder / "errors.json", json.dumps(errors, indent=1))

    def _report(self) -> Work[None]:
        from ..report.demo import Results, report
        from ..report.teaser import teaser

        capture, shape = self._opened_capture(), Shape.open(self.folder / "shape")
        truth = capture.truth()
        if truth is None:
            raise LightsphereError(f"{capture.folder} has lost its truth.exr; delete the folder and run the demo again")
        pictures = {name: images.read_rgb(self.folder / "views" / f"{name}.exr") for name in ("asset", "true")}
        reflectance = Reflectance.open(self.folder / "reflectance")
        errors = {
            **shape.notes["errors"],
            **{name: reflectance.notes[name] for name in ("material_rel_rms", "material_rel_rms_median")},
            **self._read("views/errors.json"),
            "new_view_rel_rmse": relative_rmse(pictures["asset"], pictures["true"]),
        }
        trials = [Trial(**row) for row in self._read("tradeoff.json")]
        simulated = {effect["effect"] for effect in capture.notes["effects"] if effect["simulated"]}
        effects = [
            {**e, "wanted": e["simulated"], "simulated": e["effect"] in simulated} for e in self._read("effects.json")
        ]
        results = Results(
            _described(self.scene), capture, truth, shape, relief(shape), pictures["asset"], pictures["true"],
            errors, trials, self.record["seconds"], effects, self.settings.effects,
        )  # fmt: skip
        images.write_text(self.folder / "report.html", report(results))
        yield Progress("report", 0.7, 1)
        images.write_bytes(self.folder / "teaser.png", teaser(results))
        metrics = {
            "settings": self.record["settings"],
            **errors,
            "stage_seconds": self.record["seconds"],
            "tradeoff": self._read("tradeoff.json"),
            "effects": effects,
        }
        images.write_text(self.folder / "metrics.json", as_json(metrics))
        yield Progress("report", 1, 1)

    def _capture_settings(self) -> CaptureSettings:
        s = self.settings
        return CaptureSettings(inner=s.inner, outer=s.outer, resolution=s.resolution, effects=s.effects)

    def _view_pixels(self) -> int:
        return min(4 * int(self.settings.resolution), MOST_VIEW_PIXELS)

    def _opened_capture(self) -> Capture:
        return Capture.open(self.folder / "capture")

    def _read(self, name: str) -> Any:
        return json.loads((self.folder / name).read_text(encoding="utf-8"))

    def _made(self, name: str) -> Path:
        (self.folder / name).mkdir(exist_ok=True)
        return self.folder / name


def _described(name: str) -> str:
    """The scene in words."""
    from ..blender.scene import library

    scenes = library()
    return str(scenes[name].description) if name in scenes else Path(name).stem


def _renamed(work: Work[Any], name: str) -> Work[Any]:
    """Let a work's progress go by another name."""
    return retold(work, lambda step: dataclasses.replace(step, stage=name))
