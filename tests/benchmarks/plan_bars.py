"""Is what the plan leaves out less than what was asked for, and does it save time? On scenes, lights and seeds anew.

Run as ``.venv-3.13/bin/python tests/benchmarks/plan_bars.py [SCENE or FILE.blend ...]`` with the Python that
``bootstrap.py`` set up. Without names all built-in scenes are tried. For every scene pictures by the plan and with
everything are compared by group of surfaces, under lights that the probe did not see. Bars: within the error asked for
in every group of every scene; at least 40 % of the time saved, as the median, where little is needed, and at most 5 %
lost anywhere, the plan's own time included: for 400 pictures of 100x100 pixels, or one of a scene in its own light.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import bpy
import numpy as np

from pipeline.blender import capture, cycles, plan
from pipeline.blender import scene as scenes
from pipeline.blender.plan.contents import ruled_out
from pipeline.blender.plan.effects import DEPTH_OF_FIELD, MOTION_BLUR, SWITCHES
from pipeline.blender.plan.probe import Difference, Probe, Trial
from pipeline.core.capture_settings import PlanSettings
from pipeline.core.lights import Lights
from pipeline.core.progress import finish

PICTURES = 400
JUDGED = PlanSettings(probe_resolution=64, probe_samples=256, probes=6)
TIMED = 100  # pixels


def main() -> None:
    """Print a row for every scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=list(scenes.library()))
    print(f"{'':18}{'left out is':>16}{'in':>16}{'asked':>8}{'plan':>8}{'planned':>10}{'everything':>12}{'saved':>8}")
    for name in parser.parse_args().scenes:
        print(_row(name), flush=True)


def _row(name: str) -> str:
    loaded = scenes.load(name)
    own = plan.own_light(loaded)
    lights = None if own else capture.describe(loaded, name, Path(), PlanSettings()).lights
    before = time.perf_counter()
    found = finish(plan.decide(loaded, lights, PlanSettings()))
    planning = time.perf_counter() - before
    absent = ruled_out(loaded) | (dict.fromkeys((DEPTH_OF_FIELD, MOTION_BLUR), "") if lights is not None else {})
    switches = {switch: effect not in absent for effect, switch in SWITCHES.items()}
    everything = cycles.Transport(plan.MOST_BOUNCES, **switches, samples=PlanSettings.samples)
    lost = _lost(loaded, None if lights is None else _others(lights), found.transport, everything)
    planned, full = (_seconds(loaded, lights, transport) for transport in (found.transport, everything))
    # A scene's own picture is as large as its render settings say.
    size = loaded.render.resolution_x * loaded.render.resolution_y / TIMED**2
    saved = 1 - (planned + planning / (PICTURES if lights is not None else size)) / full
    return (
        f"{Path(name).stem:18}{100 * lost.share:8.2f} ± {100 * lost.deviation:.2f} %{lost.group:>16}"
        f"{PlanSettings.error:6.1f} %{planning:6.1f} s{1e3 * planned:7.0f} ms{1e3 * full:9.0f} ms{100 * saved:6.0f} %"
    )


def _others(lights: Lights) -> Lights:
    """Return lights by chance."""
    return lights.select(np.random.default_rng(11).choice(len(lights), JUDGED.probes, replace=False))


def _lost(
    scene: bpy.types.Scene, lights: Lights | None, planned: cycles.Transport, everything: cycles.Transport
) -> Difference:
    probe = Probe(scene, lights, JUDGED, expected=2)
    whole, part = (_trial(probe, transport, JUDGED.probe_samples) for transport in (everything, planned))
    return probe.loss(whole, part)


def _trial(probe: Probe, transport: cycles.Transport, samples: int) -> Trial:
    return finish(probe.trial(dataclasses.replace(transport, samples=samples)))


def _seconds(scene: bpy.types.Scene, lights: Lights | None, transport: cycles.Transport) -> float:
    """Return what a picture takes with the samples that the plan gives it."""
    probe = Probe(scene, lights, PlanSettings(probe_resolution=TIMED, probes=4), expected=2)
    return min(finish(probe.trial(transport)).seconds for _ in range(2))


if __name__ == "__main__":
    main()
