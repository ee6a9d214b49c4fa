"""Decide which light paths pictures of a scene need."""

from __future__ import annotations

import dataclasses

import bpy

from ...core.capture_settings import PlanSettings
from ...core.lights import Lights
from ...core.progress import Work
from .. import cycles
from . import effects as names
from .contents import ruled_out
from .effects import DEPTH_OF_FIELD, INSIDE, MOTION_BLUR, SWITCHES, Effect, Plan, measured
from .probe import Difference, Probe, Trial

BOUNCES = (1, 2, 3, 4, 6, 8)
MOST_BOUNCES = 12
NEGLIGIBLE = 0.001  # what the bounces that --effects full leaves out may add
SENSOR = {
    names.NOISE: "pictures have no sensor's noise",
    names.SATURATION: "pictures are floats without a limit",
}


def decide(scene: bpy.types.Scene, lights: Lights | None, settings: PlanSettings) -> Work[Plan]:
    """Decide which light paths pictures of a scene need.

    Parameters
    ----------
    scene : Scene
    lights : Lights or None
        Of a rig; None for the scene's own light, where the camera's lens and motion count, too.
    settings : PlanSettings
        ``effects`` is ``"direct"`` (nothing bounces, nothing is measured), ``"full"`` (everything that the scene can
        show) or ``"auto"`` (what may change a group by more than a third of the error asked for).

    Raises
    ------
    LightsphereError
        When an override is not an effect, or the scene has no camera.
    """
    overrides = settings.overrides
    absent = _absent(scene, lights)
    possible = [name for name in SWITCHES if name not in absent]
    inside = [name for name in INSIDE if name not in absent]
    if settings.effects == "direct" or not (possible or inside):
        return _direct(absent, 1 if lights is not None else settings.samples, "left out by --effects direct")
    return (yield from _Decision(scene, lights, settings, overrides, absent).plan())


def own_light(scene: bpy.types.Scene) -> bool:
    """Return whether a scene has light of its own: lamps, or surfaces that shine."""
    lamps = any(item.type == "LIGHT" and not item.hide_render for item in scene.objects)
    return lamps or names.EMISSION not in ruled_out(scene)


def unmeasured(scene: bpy.types.Scene, lights: Lights, bounces: int, samples: int) -> Plan:
    """Return a plan of all that a scene can show under a rig up to a number of bounces, decided without a render."""
    absent = _absent(scene, lights)
    possible = [name for name in SWITCHES if name not in absent]
    if not bounces or not (possible or [name for name in INSIDE if name not in absent]):
        return _direct(absent, 1, "left out: no bounces")
    rows = [_kept(names.SHADOWS, absent), _kept(names.FALL_OFF, absent)]
    rows += [Effect(n, n not in absent, absent.get(n, "the scene can show it")) for n in (*SWITCHES, *INSIDE)]
    rows += [Effect(f"bounces beyond {bounces}", False, "left out"), *_of_sensor()]
    switches = {switch: name in possible for name, switch in SWITCHES.items()}
    return Plan(tuple(rows), cycles.Transport(bounces, **switches, samples=samples))


def _absent(scene: bpy.types.Scene, lights: Lights | None) -> dict[str, str]:
    """Return the effects that pictures of a scene under a rig, or its own light, cannot show, with the reasons."""
    absent = ruled_out(scene)
    if lights is not None:
        absent |= dict.fromkeys((DEPTH_OF_FIELD, MOTION_BLUR), "a capture's camera is a pinhole and stands still")
        absent |= {names.FALL_OFF: "lights are distant"} if lights.kind == "distant" else {}
    return absent


def _direct(absent: dict[str, str], samples: int, reason: str) -> Plan:
    """Return the plan of direct light alone, nothing measured."""
    rows = [_kept(names.SHADOWS, absent), _kept(names.FALL_OFF, absent)]
    rows += [Effect(n, False, absent.get(n, reason)) for n in (*SWITCHES, *INSIDE)]
    return Plan((*rows, *_of_sensor()), dataclasses.replace(cycles.DIRECT, samples=samples))


def _of_sensor() -> list[Effect]:
    return [Effect(name, False, reason) for name, reason in SENSOR.items()]


def _kept(name: str, absent: dict[str, str]) -> Effect:
    return Effect(name, name not in absent, absent.get(name, "part of direct light"))


class _Decision:
    """Trials of a scene, and what follows from them."""

    def __init__(
        self,
        scene: bpy.types.Scene,
        lights: Lights | None,
        settings: PlanSettings,
        overrides: dict[str, bool],
        absent: dict[str, str],
    ) -> None:
        self._lights, self._settings, self._overrides, self._absent = lights, settings, overrides, absent
        self._possible = [name for name in SWITCHES if name not in absent]
        self._error = settings.error / 100
        # Trials of direct light and of everything, of each effect, and of three numbers of bounces, as a rule.
        self._probe = Probe(scene, lights, settings, expected=6 + len(self._possible))
        switches = {switch: name in self._possible for name, switch in SWITCHES.items()}
        self._everything = cycles.Transport(MOST_BOUNCES, **switches, samples=settings.probe_samples)
        width, height = scene.render.resolution_x, scene.render.resolution_y
        self._pixels = width * height if lights is None else settings.resolution**2

    def plan(self) -> Work[Plan]:
        """Return the plan."""
        direct = yield from self._probe.trial(dataclasses.replace(self._everything, bounces=0))
        whole = yield from self._probe.trial(self._everything)
        rows = yield from self._of_direct_light(direct)
        losses, parts = yield from self._losses(whole, direct)
        wanted = {name: self._is_wanted(name, losses) for name in self._possible}
        transport, joint = yield from self._joined(wanted, losses, whole)
        for name in self._possible:
            simulated = wanted[name] and (transport.bounces > 0 or name in (DEPTH_OF_FIELD, MOTION_BLUR))
            rows.append(self._row(name, simulated, name in joint, losses, whole, parts))
        planned, transport, shortened = yield from self._shortened(transport, whole)
        rows += shortened + [self._of_material(name) for name in INSIDE]
        rows += [Effect(name, False, self._absent[name]) for name in SWITCHES if name in self._absent]
        rows += _of_sensor()
        seconds = {"planned": max(self._seconds(planned, transport.samples), direct.seconds)}
        seconds["everything"] = max(self._seconds(whole, self._settings.samples), direct.seconds)
        saved = 1 - seconds["planned"] / seconds["everything"]
        yield self._probe.end()
        missing = measured("all that is left out", False, "", self._probe.loss(whole, planned), saved)
        return Plan(tuple(rows), transport, missing, seconds)

    def _of_direct_light(self, direct: Trial) -> Work[list[Effect]]:
        """Return the rows of the effects that cost nothing to speak of; measure what a rig's shadows take away."""
        shadows, fall_off = (_kept(name, self._absent) for name in (names.SHADOWS, names.FALL_OFF))
        if self._lights is None:
            return [shadows, fall_off]
        if shadows.simulated:
            unshadowed = yield from self._probe.trial(dataclasses.replace(self._everything, bounces=0), shadows=False)
            shadows = measured(shadows.effect, True, shadows.reason, self._probe.loss(unshadowed, direct))
        if fall_off.simulated:
            fall_off = measured(fall_off.effect, True, fall_off.reason, self._probe.fall_off())
        return [shadows, fall_off]

    def _losses(self, whole: Trial, direct: Trial) -> Work[tuple[dict[str, Difference], dict[str, Trial]]]:
        """Return what the pictures lose without each effect, and their trials; all together where that is little."""
        together = self._probe.loss(whole, direct)
        alone = len(self._possible) == 1
        of_camera = DEPTH_OF_FIELD in self._possible or MOTION_BLUR in self._possible
        if (alone or together.bound <= self._error / 3) and not of_camera:
            return dict.fromkeys(self._possible, together), dict.fromkeys(self._possible, direct)
        parts = {}
        for name in self._possible:
            transport = dataclasses.replace(self._everything, **{SWITCHES[name]: False})
            parts[name] = yield from self._probe.trial(transport)
        return {name: self._probe.loss(whole, part) for name, part in parts.items()}, parts

    def _is_wanted(self, name: str, losses: dict[str, Difference]) -> bool:
        matters = self._settings.effects == "full" or losses[name].bound > self._error / 3
        return self._overrides.get(SWITCHES[name], matters)

    def _transport(self, wanted: dict[str, bool]) -> cycles.Transport:
        chosen = {SWITCHES[name]: on for name, on in wanted.items()}
        transport = dataclasses.replace(self._everything, **chosen)
        return transport if self._bounces(transport) else dataclasses.replace(transport, bounces=0)

    def _bounces(self, transport: cycles.Transport) -> bool:
        within = any(name not in self._absent for name in (names.VOLUMES, names.SUBSURFACE))
        return transport.diffuse or transport.glossy or transport.transmission or within

    def _joined(
        self, wanted: dict[str, bool], losses: dict[str, Difference], whole: Trial
    ) -> Work[tuple[cycles.Transport, list[str]]]:
        """Take effects back in, the larger first, until all that is left out together is within the error."""
        free = [name for name in self._possible if not wanted[name] and SWITCHES[name] not in self._overrides]
        free.sort(key=lambda name: losses[name].bound)
        taken: list[str] = []
        while len(free) > 1:
            part = yield from self._probe.trial(self._transport(wanted))
            if self._probe.loss(whole, part).share <= self._error:
                break
            taken.append(free.pop())
            wanted[taken[-1]] = True
        return self._transport(wanted), taken

    def _shortened(
        self, transport: cycles.Transport, whole: Trial
    ) -> Work[tuple[Trial, cycles.Transport, list[Effect]]]:
        """Return the planned trial, the light paths with as few bounces as will do, and the row of those left out."""
        planned = whole if transport == self._everything else (yield from self._probe.trial(transport))
        limit = NEGLIGIBLE if self._settings.effects == "full" else self._error / 3
        samples = self._settings.samples
        for bounces in BOUNCES if transport.bounces else ():
            shorter = dataclasses.replace(transport, bounces=bounces)
            trial = yield from self._probe.trial(shorter)
            lost = self._probe.loss(planned, trial)
            if (lost.share if self._settings.effects == "full" else lost.bound) <= limit:
                row = measured(f"bounces beyond {bounces}", False, self._less(limit), lost, self._saves(whole, trial))
                return trial, dataclasses.replace(shorter, samples=samples), [row]
        if not transport.bounces and self._lights is not None:
            return planned, cycles.DIRECT, []
        return planned, dataclasses.replace(transport, samples=samples), []

    def _row(
        self,
        name: str,
        simulated: bool,
        is_joint: bool,
        losses: dict[str, Difference],
        whole: Trial,
        parts: dict[str, Trial],
    ) -> Effect:
        loss, third = losses[name], self._error / 3
        if SWITCHES[name] in self._overrides:
            reason = "asked for by --simulate" if simulated else "left out by --leave-out"
        elif self._settings.effects == "full":
            reason = "asked for by --effects full"
        elif is_joint:
            reason = f"with all that is left out, more than {self._settings.error:g} %"
        elif not simulated:
            reason = self._less(third)
        elif loss.share <= third:
            reason = f"the probe cannot tell it from {100 * third:.2g} %, a third of the error asked for"
        else:
            reason = f"more than {100 * third:.2g} %, a third of the error asked for"
        return measured(name, simulated, reason, loss, self._saves(whole, parts[name]))

    def _less(self, limit: float) -> str:
        words = "" if self._settings.effects == "full" else ", a third of the error asked for"
        return f"less than {100 * limit:.2g} %{words}"

    def _of_material(self, name: str) -> Effect:
        present = name not in self._absent
        return Effect(name, present, "in the scene's materials" if present else self._absent[name])

    def _saves(self, whole: Trial, part: Trial) -> float:
        return 1 - part.seconds / whole.seconds

    def _seconds(self, trial: Trial, samples: int) -> float:
        """Return what a picture of the job takes, if time grows with its samples."""
        return trial.seconds / trial.size * self._pixels * samples
