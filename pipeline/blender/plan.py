"""Which effects of light transport a scene calls for: each is switched on for a few lights and small pictures."""

from __future__ import annotations

import dataclasses
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..core.capture import Capture
from ..core.capture_settings import PlanSettings
from ..core.lights import Lights
from ..core.progress import Progress, Work
from ..core.tradeoff import evenly
from . import cycles, exr, lamps, truth
from .camera import camera_of

SHADOWS = "cast shadows"
# Each is measured on top of those before it.
BOUNCED = ("diffuse interreflection", "glossy interreflection", "caustics", "transmission")
SWITCHES = ("diffuse", "glossy", "caustics", "transmission")
BOUNCES = (1, 2, 3, 4, 6, 8)
MOST_BOUNCES = 12
TRIALS = 2 + len(BOUNCED) + 1 + len(BOUNCES)  # at most
NEGLIGIBLE = 0.1  # light of longer paths that may be left out, % of the threshold's base


@dataclass(frozen=True)
class Effect:
    """What one effect adds to the pictures of the object.

    Parameters
    ----------
    effect : str
    contribution_pct : float or None
        Light that it adds, or takes away, over the direct light [%]; None where it was not measured.
    cost : float or None
        Seconds of the pictures with this effect and those before it over seconds of direct light alone.
    simulated : bool
    reason : str
    """

    effect: str
    contribution_pct: float | None
    cost: float | None
    simulated: bool
    reason: str


@dataclass(frozen=True)
class Plan:
    """The effects of a scene and the light paths that Cycles is to follow."""

    effects: tuple[Effect, ...]
    transport: cycles.Transport

    def as_notes(self) -> dict[str, Any]:
        """Return what a capture writes down; costs are left out, they change from run to run."""
        effects = [{k: v for k, v in dataclasses.asdict(e).items() if k != "cost"} for e in self.effects]
        return {"effects": effects, "transport": dataclasses.asdict(self.transport)}


def decide(scene: bpy.types.Scene, capture: Capture, effects: str, samples: int, settings: PlanSettings) -> Work[Plan]:
    """Decide how a described capture is rendered.

    Parameters
    ----------
    effects : str
        ``"direct"`` (nothing bounces, nothing is measured), ``"full"`` (everything) or ``"auto"`` (what contributes
        at least the threshold).
    samples : int
        A pixel, where light bounces.
    """
    if effects == "direct":
        kept = Effect(SHADOWS, None, None, True, "part of direct light")
        left = [Effect(name, None, None, False, "left out by --effects direct") for name in BOUNCED]
        return Plan((kept, *left), cycles.DIRECT)
    probe = Probe(scene, capture.lights, settings)
    measured = yield from probe.effects(effects)
    wanted = dict(zip(SWITCHES, (effect.simulated for effect in measured[1:]), strict=True))
    if not any(wanted.values()):
        yield Progress("plan", TRIALS, TRIALS, "trials")
        return Plan(tuple(measured), cycles.DIRECT)
    transport = cycles.Transport(MOST_BOUNCES, **wanted, samples=samples)
    bounces = yield from probe.bounces(transport)
    yield Progress("plan", TRIALS, TRIALS, "trials")
    return Plan(tuple(measured), dataclasses.replace(transport, bounces=bounces))


class Probe:
    """Small pictures of the object under a few lights of a rig."""

    def __init__(self, scene: bpy.types.Scene, lights: Lights, settings: PlanSettings) -> None:
        self._scene = scene
        self._lights = lights
        self._settings = settings
        self._index = evenly(len(lights), settings.probes)
        self._done = 0
        self._mask = truth.object_mask(scene, camera_of(scene, settings.probe_resolution))

    def effects(self, choice: str) -> Work[list[Effect]]:
        """Measure what each effect adds; see :func:`decide` for the choice."""
        direct, base_seconds = yield from self._light(cycles.DIRECT)
        unshadowed, _ = yield from self._light(cycles.DIRECT, shadows=False)
        found = [Effect(SHADOWS, _percent(unshadowed - direct, unshadowed), 1.0, True, "part of direct light")]
        before = direct
        for count, name in enumerate(BOUNCED, start=1):
            on = {switch: i < count for i, switch in enumerate(SWITCHES)}
            transport = cycles.Transport(MOST_BOUNCES, **on, samples=self._settings.probe_samples)
            light, seconds = yield from self._light(transport)
            share = _percent(light - before, direct)
            found.append(self._judged(name, share, seconds / base_seconds, choice))
            before = light
        return found

    def bounces(self, transport: cycles.Transport) -> Work[int]:
        """Return the fewest bounces that leave out a negligible share of the light."""
        transport = dataclasses.replace(transport, samples=self._settings.probe_samples)
        whole, _ = yield from self._light(transport)
        for bounces in BOUNCES:
            light, _ = yield from self._light(dataclasses.replace(transport, bounces=bounces))
            if _percent(whole - light, whole) < NEGLIGIBLE:
                return bounces
        return MOST_BOUNCES

    def _judged(self, name: str, share: float, cost: float, choice: str) -> Effect:
        threshold = self._settings.threshold
        if choice == "full":
            return Effect(name, share, cost, True, "asked for by --effects full")
        simulated = abs(share) >= threshold
        words = "at least" if simulated else "less than"
        return Effect(name, share, cost, simulated, f"{words} the threshold of {threshold:g} %")

    def _light(self, transport: cycles.Transport, shadows: bool = True) -> Work[tuple[float, float]]:
        """Return the sum of the object's pixels under all probe lights, and the seconds that took."""
        scene, camera = self._scene, camera_of(self._scene, self._settings.probe_resolution)
        total, seconds = 0.0, 0.0
        with (
            tempfile.TemporaryDirectory() as folder,
            cycles.measuring(scene, camera, transport),
            cycles.openexr(scene),
            cycles.own_lights_hidden(scene),
            cycles.meshes_cached(scene),
            lamps.lamp(scene, self._lights.kind) as lamp,
        ):
            lamp.data.use_shadow = shadows
            path = Path(folder) / "probe.exr"
            for index in self._index:
                lamps.shine(lamp, self._lights, int(index))
                start = time.perf_counter()
                cycles.render(scene, path)
                seconds += time.perf_counter() - start
                total += sum(float(c[self._mask].sum(dtype=np.float64)) for c in exr.read(path).values())
        self._done += 1
        yield Progress("plan", self._done, TRIALS, "trials")
        return total, seconds


def _percent(part: float, whole: float) -> float:
    return round(100 * part / whole, 4) if whole > 0 else 0.0
