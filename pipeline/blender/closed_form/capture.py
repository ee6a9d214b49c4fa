"""Decide whether a capture may do without Cycles, and make its pictures."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import bpy
import numpy as np

from ...core.capture import Capture
from ...core.errors import LightsphereError
from ...core.progress import Progress, Work
from .. import cycles, exr
from ..olat import pictures
from .closures import Inexact
from .pictures import ClosedForm, prepare

CYCLES, CLOSED_FORM = "cycles", "closed form"
FEWEST = 32  # pictures that are worth reading the scene for
CHECKED = 4  # lights under which Cycles renders, too
AGREES = 1e-3  # of the light: what may differ, a few pixels at the edges of shadows


@dataclass(frozen=True)
class Renderer:
    """What makes the pictures of a capture.

    Parameters
    ----------
    name : str
        CYCLES or CLOSED_FORM.
    reason : str
        Why Cycles; ``""`` for the other.
    checked : list of int
        Lights under which both were compared, drawn at random.
    differs_pct : float or None
        The light that differs there, of all light [%].
    """

    name: str
    reason: str = ""
    checked: list[int] = field(default_factory=list)
    differs_pct: float | None = None


def choose(scene: bpy.types.Scene, capture: Capture) -> Work[tuple[Renderer, ClosedForm | None]]:
    """Choose what makes a described capture's pictures: closed forms where they are exact, or Cycles (then None).

    A few pictures under random lights are made by both, and closed forms taken only if these agree.
    """
    settings = capture.notes["settings"]
    if settings["renderer"] == CYCLES:
        return Renderer(CYCLES, "asked for by --renderer"), None
    if capture.notes["transport"]["bounces"]:
        return Renderer(CYCLES, "light bounces"), None
    if len(capture) < FEWEST:
        return Renderer(CYCLES, f"fewer than {FEWEST} pictures"), None
    try:
        form = prepare(scene, capture.camera, settings["seed"])
    except Inexact as reason:
        return Renderer(CYCLES, str(reason)), None
    chosen = list(map(int, np.random.default_rng(settings["seed"]).choice(len(capture), CHECKED, replace=False)))
    lost = total = 0.0
    rendered = pictures(scene, capture.camera, cycles.DIRECT, capture.lights, chosen, settings["seed"])
    for done, (light, picture) in enumerate(zip(chosen, rendered, strict=True), start=1):
        lost += float(abs(picture - form.picture(capture.lights, light)).sum())
        total += float(picture.sum())
        yield Progress("check", done, CHECKED, "pictures")
    share = lost / total if total else 0.0
    if not share <= AGREES:
        reason = f"closed forms differ from Cycles by {100 * share:.2g} % of the light"
        return Renderer(CYCLES, reason, chosen, round(100 * share, 6)), None
    return Renderer(CLOSED_FORM, "", chosen, round(100 * share, 6)), form


def again(scene: bpy.types.Scene, capture: Capture) -> ClosedForm:
    """Read what a capture shows that was begun without Cycles; raise LightsphereError where it needs Cycles now."""
    try:
        return prepare(scene, capture.camera, capture.notes["settings"]["seed"])
    except Inexact as reason:
        raise LightsphereError(
            f"{capture.folder} holds pictures that were made without Cycles, which now has to render, for {reason}; "
            "choose another folder or delete it"
        ) from reason


def make(form: ClosedForm, capture: Capture, lights: Iterable[int], threads: int) -> Iterator[int]:
    """Make the pictures of some lights; yield each light, in order, when its picture is on disk."""
    waiting: deque[tuple[int, Future[None]]] = deque()
    with ThreadPoolExecutor(threads) as pool, exr.one_thread_each():
        for light in lights:
            waiting.append((light, pool.submit(_write, form, capture, light)))
            if len(waiting) >= threads:  # no more are written than can be noted
                yield _finished(waiting)
        while waiting:
            yield _finished(waiting)


def _finished(waiting: deque[tuple[int, Future[None]]]) -> int:
    light, work = waiting.popleft()
    work.result()
    return light


def _write(form: ClosedForm, capture: Capture, light: int) -> None:
    picture = form.picture(capture.lights, light)
    channels = {name: picture[..., i] for i, name in enumerate("RGB")}
    exr.write(capture.folder / capture.files[light], channels, capture.notes["settings"]["pixel_type"])
