"""An asset rendered by Cycles beside what was captured, and beside the true scene as nobody captured it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core import images
from ..core.camera import Camera
from ..core.capture import Capture
from ..core.compare import CompareSettings
from ..core.compare.lights import captured_lights, new_lights
from ..core.compare.pictures import Comparison
from ..core.errors import LightsphereError
from ..core.lights import Lights
from ..core.progress import Progress, Work, retold
from . import asset, bases, cycles, geometry, scene, truth, views
from .camera import add_camera

Pictures = NDArray[np.float32]
SEEDS = (1, 2, 3, 4)  # of two halves of the true scene and two of the asset


@dataclass(frozen=True)
class Setting:
    """From where, under which lights and how the asset is seen.

    Parameters
    ----------
    name, words : str
    camera : Camera
    lights : Lights
    transport : cycles.Transport
    """

    name: str
    words: str
    camera: Camera
    lights: Lights
    transport: cycles.Transport


@dataclass(frozen=True)
class Halves:
    """Pictures (L, H, W, 3) under single lights, and what they differ by from another draw of their noise."""

    pictures: Pictures
    noise: Pictures


def compare(path: Path, capture: Capture, true: str | None, settings: CompareSettings) -> Work[list[Comparison]]:
    """Render an asset and compare it; what is open in this Blender is replaced.

    Parameters
    ----------
    path : Path
        The asset's .blend.
    capture : Capture
        Under known lights. Its pictures are what the asset should look like under some of its own lights.
    true : str or None
        The captured scene, see :func:`true_scene`: it is rendered under new lights, and the asset in place of its
        object. Without it the asset is rendered by itself, under the capture's lights alone.
    settings : CompareSettings

    Yields
    ------
    Progress per picture.

    Returns
    -------
    list of Comparison
        ``captured``, and with the true scene ``new_lights``, ``global_illumination`` and ``new_view``.

    Raises
    ------
    LightsphereError
        For unknown lights, a file that is no asset, or a true scene whose object the new view does not see.
    """
    if capture.lights.kind == "unknown":
        raise LightsphereError(f"{capture.folder} was captured under unknown lights; an asset cannot be lit like that")
    chosen = captured_lights(capture.lights, capture.camera, settings.lights)
    captured, new = _captured(capture, chosen), _new(capture, settings) if true is not None else []
    ahead = sum(len(one.lights) for one in new)
    total = len(chosen) + 2 * ahead
    masks = [capture.mask()] * (1 + len(new))
    references = []
    if true is not None:
        loaded = scene.load(true)
        references = yield from _rendered(loaded, new, SEEDS[:2], 0, total)
        add_camera(loaded, new[-1].camera)
        masks[-1] = truth.object_mask(loaded, new[-1].camera)
    furnished = _with_asset(path, true)
    shown = yield from _rendered(furnished, [captured, *new], SEEDS[2:], ahead, total)
    # the captured pictures have as many samples as the asset's
    references.insert(0, Halves(np.stack([capture.image(light) for light in chosen]), shown[0].noise))
    parts = [_bases(furnished, captured.camera)] * (1 + len(new))
    if new:
        parts[-1] = _bases(furnished, new[-1].camera)
    sides = zip([captured, *new], shown, references, masks, parts, strict=True)
    return [_compared(*side) for side in sides]


def true_scene(capture: Capture, wanted: Path | None) -> str | None:
    """Return the scene that was captured as :func:`.scene.load` takes it, or None where it is not at hand.

    Parameters
    ----------
    capture : Capture
        Names its scene; a .blend is looked for in its folder and beside that.
    wanted : Path, optional
        Where the .blend is.

    Raises
    ------
    LightsphereError
        When the .blend is another one than was captured.
    """
    name, checksum = capture.notes.get("scene", ""), capture.notes.get("scene_sha256")
    if wanted is not None:
        if not wanted.is_file() or images.checksum(wanted) != checksum:
            raise LightsphereError(f"{wanted} is not the file that {capture.folder} was captured from; give that one")
        return str(wanted)
    if name in scene.library():
        return str(name)
    for folder in (capture.folder, capture.folder.parent):
        if checksum and (folder / name).is_file() and images.checksum(folder / name) == checksum:
            return str(folder / name)
    return None


def _captured(capture: Capture, chosen: NDArray[np.int64]) -> Setting:
    """Return the capture's own camera and light paths under some of its lights."""
    transport = cycles.Transport(**capture.notes.get("transport", {}))
    lights = capture.lights.select(chosen)
    return Setting("captured", "lights of the capture", capture.camera, lights, transport)


def _new(capture: Capture, settings: CompareSettings) -> list[Setting]:
    """Return what the capture did not have; the new view is the last."""
    camera = capture.camera
    lights = new_lights(capture.lights, camera, settings.lights)
    found = [Setting("new_lights", "new lights, direct", camera, lights, cycles.DIRECT)]
    if settings.bounces:
        bounced = cycles.Transport(settings.bounces, samples=settings.samples)
        some = lights.select(np.arange(0, len(lights), 2))
        found.append(Setting("global_illumination", "new lights, global illumination", camera, some, bounced))
    centre = np.nanmean(_points(capture), axis=0)
    turned = camera.orbited(centre, settings.turn)
    words = f"seen {settings.turn:g} degrees from the side, direct"
    return [*found, Setting("new_view", words, turned, lights, cycles.DIRECT)]


def _points(capture: Capture) -> NDArray[np.float64]:
    """Return the true surface's points (N, 3); what renders a scene writes them."""
    known = capture.truth()
    if known is None:
        raise LightsphereError(f"{capture.folder} has lost its truth.exr; run lightsphere capture again")
    return known.position[capture.mask()].astype(np.float64)


def _rendered(
    loaded: bpy.types.Scene, settings: Sequence[Setting], seeds: Sequence[int], before: int, total: int
) -> Work[list[Halves]]:
    """Render a scene as every setting says; so many pictures of all are done before.

    Where light bounces, each picture is the mean of two halves with seeds of their own, and half their difference is
    the noise of the mean. Direct light has none.
    """
    found = []
    for one in settings:
        used = seeds if one.transport.bounces else seeds[:1]
        part = dataclasses.replace(one.transport, samples=-(-one.transport.samples // len(used)))
        halves = []
        for number, seed in enumerate(used):
            done, share = before + number * len(one.lights) / len(used), 1 / len(used)
            tell = partial(_told, done, share, total)
            halves.append((yield from retold(views.under_lights(loaded, one.camera, one.lights, part, seed), tell)))
        before += len(one.lights)
        found.append(Halves(np.mean(halves, axis=0), (halves[0] - halves[-1]) / 2))
    return found


def _told(before: float, share: float, total: int, step: Progress) -> Progress:
    return dataclasses.replace(step, done=before + share * step.done, total=total)


def _with_asset(path: Path, true: str | None) -> bpy.types.Scene:
    """Open the true scene with the asset in the place of its object, or the asset by itself where there is none."""
    if true is None:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        loaded = bpy.context.scene
    else:
        loaded = scene.load(true)
        geometry.hide_object(loaded)
    for item in asset.append(loaded, path):
        asset.as_captured(item)
    return loaded


def _bases(furnished: bpy.types.Scene, camera: Camera) -> dict[str, NDArray[np.bool_]]:
    """Return where a camera shows most of each basis of the asset."""
    add_camera(furnished, camera)
    return bases.shown(furnished, camera)


def _compared(
    one: Setting,
    shown: Halves,
    reference: Halves,
    mask: NDArray[np.bool_],
    parts: dict[str, NDArray[np.bool_]],
) -> Comparison:
    """Return the pictures under those lights that reach the object, and the RMS of both noises over the reference's."""
    lit = (reference.pictures[:, mask] > 0).any(axis=(1, 2))
    if not lit.any():
        raise LightsphereError(
            f"{one.words}: none of {len(lit)} reaches what the camera sees; choose more with --lights"
        )
    sides = (shown.noise, reference.noise, reference.pictures)
    first, second, whole = (float(np.mean(np.square(side[lit][:, mask], dtype=np.float64))) for side in sides)
    noise = float(np.sqrt((first + second) / whole))
    return Comparison(one.name, one.words, shown.pictures[lit], reference.pictures[lit], mask, noise, parts)
