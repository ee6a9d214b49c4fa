"""The capture folder made of described photographs."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import images
from ..camera import Camera
from ..capture import FILE, Capture
from ..errors import LightsphereError
from ..lights import Lights
from ..progress import Progress, Work
from .decode import Decoded, decoded, size
from .measured import measured
from .photographs import FLOAT_BITS, Photographs
from .response import BY_EXPOSURES, Response
from .settings import ImportSettings
from .survey import Survey, light_warnings

DIAMETER = 1.0  # [m] of the object, where nothing tells its size
FULL_FRAME = 36.0  # [mm] of the longer side that focal lengths are stated for
SAME_FOCAL = 0.02  # relative difference of focal lengths that rounding makes
HALF_BITS = 10  # half floats keep 11 significant bits


def develop(photographs: Photographs, source: Path, folder: Path, settings: ImportSettings) -> Work[Capture]:
    """Write a capture from photographs, one light at a time.

    Pictures are linear with the full scale of each light's (shortest) exposure as 1; where exposure times are known,
    each light's intensity is multiplied by its time over the median time, which makes them comparable. Numbers of
    more than 10 bits are kept as float, others as half. A camera that is not known is orthographic, or a pinhole where
    its focal length is stated, and the object's larger extent is 1 m. What was found stands in the notes as ``found``.

    Parameters
    ----------
    photographs : Photographs
    source : Path
        Where they came from, for the notes.
    folder : Path
        Of the capture. One that holds the same import, whole, is left as it is.

    Raises
    ------
    LightsphereError
        For photographs that cannot be read or used, naming the file, and a folder that holds something else.
    """
    identity, records = yield from _identity(photographs, settings)
    if (there := _already(folder, identity)) is not None:
        return there
    folder.mkdir(parents=True, exist_ok=True)
    count = len(photographs.shots)
    files = tuple(f"light_{i:0{max(4, len(str(count - 1)))}d}.exr" for i in range(count))
    survey = Survey()
    pictures = yield from _write_pictures(photographs, settings, [folder / name for name in files], survey)
    mask, assumed = _mask(photographs, survey)
    limit = survey.saturation(min(picture.saturation for picture in pictures))
    survey.check(mask, source)
    focal = settings.focal or (0.0 if photographs.camera else _stated_focal(pictures))
    camera = photographs.camera or framing(mask, focal)
    if camera.resolution != survey.shape[::-1]:
        raise LightsphereError(
            f"the camera is one of {camera.resolution[0]}x{camera.resolution[1]} pixels, the photographs are "
            f"{survey.shape[1]}x{survey.shape[0]}; correct the camera"
        )
    lights = _weighted(photographs.lights, pictures)
    warnings = [*light_warnings(lights), *survey.warnings(mask)]
    layers = _write_layers(folder, mask, photographs.normal)
    found = {
        "format": photographs.format,
        "lights": count,
        "light_kind": lights.kind,
        "size": list(camera.resolution),
        "bit_depth": min(picture.bits for picture in pictures),
        "response": ", ".join(dict.fromkeys(picture.response.name for picture in pictures)),
        "exposures": max(len(shots) for shots in photographs.shots),
        "object_pixels": int(mask.sum()),
        **({} if photographs.camera else {"focal_mm": focal}),
        "saturated_pct": survey.saturated_pct(mask),
        "assumed": [
            *photographs.assumed,
            *assumed,
            *_assumed_response(settings, pictures),
            *([] if settings.focal or not focal else [f"a lens of {focal:.3g} mm on a full frame, as the files say"]),
        ],
        "warnings": warnings,
    } | photographs.notes.get("calibration", {})
    notes: dict[str, Any] = {
        "source": source.name,
        "identity": identity,
        "found": found,
        "bit_depth": found["bit_depth"],
        "exposures": [list(picture.times) for picture in pictures],
        "photographs": records,
        "sha256": {name: images.checksum(folder / name) for name in layers},
        **{name: value for name, value in photographs.notes.items() if name != "calibration"},
    }
    notes |= {"saturation": limit} if np.isfinite(limit) else {}
    notes |= {"diameter": DIAMETER} if photographs.camera is None else {}
    made = Capture(folder, camera, lights, files, tuple(images.checksum(folder / name) for name in files), notes)
    made.save()
    return made


def _write_pictures(
    photographs: Photographs, settings: ImportSettings, paths: list[Path], survey: Survey
) -> Work[list[Decoded]]:
    """Write one picture per light, show each to the survey, and return what is known of them, without their pixels."""
    response: str | Response = settings.response
    if response == BY_EXPOSURES:
        response = measured(photographs.shots)
    ambient = decoded((photographs.ambient,), response) if photographs.ambient else None
    written = []
    for i, (path, shots) in enumerate(zip(paths, photographs.shots, strict=True)):
        picture = decoded(shots, response)
        linear = picture.linear if ambient is None else _without(ambient, picture)
        if i and linear.shape[:2] != survey.shape:
            raise LightsphereError(
                f"{shots[0].name} is {size(linear)} pixels, {photographs.shots[0][0].name} "
                f"{survey.shape[1]}x{survey.shape[0]}; all photographs need the same size"
            )
        survey.add(linear, picture.saturation)
        images.write_rgb(path, linear.astype(_pixel_type(picture)))
        written.append(dataclasses.replace(picture, linear=linear[:0, :0]))
        yield Progress("import", i + 1, len(paths), "lights")
    return written


def framing(mask: NDArray[np.bool_], focal: float) -> Camera:
    """Return the camera of a set without one, the mask's larger extent 1 m about the world's origin.

    Parameters
    ----------
    mask : (H, W) bool
    focal : float
        Focal length as if the picture's longer side were 36 mm [mm]; 0: orthographic, camera space is the world.
    """
    height, width = mask.shape
    row, column = np.nonzero(mask)
    extent = float(max(np.ptp(row), np.ptp(column)) + 1) / DIAMETER
    to_world = np.eye(4)
    if not focal:
        return Camera("orthographic", to_world, (width, height), (extent, extent), (width / 2, height / 2))
    pixels = focal / FULL_FRAME * max(width, height)
    to_world[2, 3] = pixels / extent
    return Camera("pinhole", to_world, (width, height), (pixels, pixels), (width / 2, height / 2))


def _identity(photographs: Photographs, settings: ImportSettings) -> Work[tuple[str, list[dict[str, str]]]]:
    """Return what makes this import this one, and the photographs' checksums."""
    shots = [shot for exposures in photographs.shots for shot in exposures]
    others = [shot for shot in (photographs.mask, photographs.ambient) if shot is not None]
    records = []
    for i, shot in enumerate([*shots, *others]):
        if shot.path is not None and not shot.path.is_file():
            raise LightsphereError(f"{shot.path} is missing; put the photograph there")
        digest = images.checksum(shot.path) if shot.path else hashlib.sha256(shot.read().pixels.tobytes()).hexdigest()
        records.append({"file": shot.name, "sha256": digest})
        yield Progress("check", i + 1, len(shots) + len(others), "files")
    value = [records, settings.response, photographs.lights.as_json(), *([settings.focal] if settings.focal else [])]
    return hashlib.sha256(json.dumps(value).encode()).hexdigest(), records


def _stated_focal(pictures: list[Decoded]) -> float:
    """Return the focal length that the files state, 0 where none does; raise LightsphereError for several."""
    stated = [picture.focal for picture in pictures if picture.focal]
    if stated and max(stated) > (1 + SAME_FOCAL) * min(stated):
        raise LightsphereError(
            f"the photographs were taken with lenses of {min(stated):.3g} to {max(stated):.3g} mm; take all from one "
            "place with one, or state it by --focal if the files are wrong"
        )
    return float(np.median(stated)) if stated else 0.0


def _already(folder: Path, identity: str) -> Capture | None:
    """Return the same import when it is whole; raise LightsphereError when the folder holds another capture."""
    if not (folder / FILE).is_file():
        return None
    there = Capture.open(folder)
    if there.notes.get("identity") != identity:
        raise LightsphereError(
            f"{folder} holds another capture, or one imported otherwise; choose another folder or delete it"
        )
    return None if there.damaged() else there


def _without(ambient: Decoded, picture: Decoded) -> NDArray[np.float32]:
    """Return a picture less the ambient light, scaled to its exposure; saturated values stay so."""
    if ambient.linear.shape != picture.linear.shape:
        raise LightsphereError("the ambient picture differs in size from the photographs; retake it or remove it")
    scale = picture.seconds / ambient.seconds if picture.seconds and ambient.seconds else 1.0
    less = picture.linear - np.float32(scale) * ambient.linear
    return np.where(picture.linear >= picture.saturation, picture.linear, less)


def _pixel_type(picture: Decoded) -> type[np.float32] | type[np.float16]:
    return np.float16 if picture.bits <= HALF_BITS and len(picture.times) < 2 else np.float32


def _mask(photographs: Photographs, survey: Survey) -> tuple[NDArray[np.bool_], list[str]]:
    """Return the pixels of the object, and what was assumed for that."""
    if photographs.mask is None:
        return survey.lit(), ["every pixel that three lights reach is the object"]
    shot = photographs.mask
    bright = shot.read().pixels.max(axis=2)
    if bright.shape != survey.shape:
        raise LightsphereError(
            f"the mask {shot.name} is {size(bright)} pixels, the photographs {survey.shape[1]}x{survey.shape[0]}; "
            "make it the same size"
        )
    if not bright.max() > 0:
        raise LightsphereError(f"the mask {shot.name} is black; make it bright where the object is")
    return np.asarray(bright > 0.5 * bright.max()), []


def _weighted(lights: Lights, pictures: list[Decoded]) -> Lights:
    """Return lights whose intensities are multiplied by exposure time over the median time, where all are known."""
    seconds = [picture.seconds for picture in pictures]
    if None in seconds:
        return lights
    times = np.array(seconds, np.float64)
    return dataclasses.replace(lights, intensity=lights.intensity * (times / np.median(times))[:, None])


def _write_layers(folder: Path, mask: NDArray[np.bool_], normal: NDArray[np.float32] | None) -> list[str]:
    """Write the mask, and the truth where normals are known; return the files' names."""
    images.write_channels(folder / "mask.exr", {"mask.V": mask.astype(np.float32)})
    if normal is None:
        return ["mask.exr"]
    if normal.shape[:2] != mask.shape:
        raise LightsphereError(
            f"the true normals are {size(normal)}, the photographs {size(mask)} pixels; remove or replace them"
        )
    shown = np.where(mask[..., None], normal, np.nan).astype(np.float32)
    images.write_channels(folder / "truth.exr", {f"normal.{axis}": shown[..., i] for i, axis in enumerate("XYZ")})
    return ["mask.exr", "truth.exr"]


def _assumed_response(settings: ImportSettings, pictures: list[Decoded]) -> list[str]:
    """Return in words which response was taken without being stated."""
    if settings.response != "auto" or min(picture.bits for picture in pictures) >= FLOAT_BITS:
        return []
    names = dict.fromkeys(f"{picture.bits} bits are {picture.response.name}" for picture in pictures)
    return [" and ".join(names)]
