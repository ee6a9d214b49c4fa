"""Lights measured by spheres that were photographed under them, and weighed against a list of lights."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LightsphereError
from ..progress import Progress, Work
from . import files, outlines, spheres
from .decode import decoded
from .folder import EQUAL_STRENGTH
from .photographs import Photographs, Reader, Shot, distant
from .settings import ImportSettings
from .shots import groups

SEARCHED = 9  # pictures from which a sphere without a mask is found
MARGIN = 2  # pixels about a sphere that are read, too


@dataclass(frozen=True)
class Sphere:
    """Pictures of a sphere, cropped to it: (L, H, W, 3) linear, and what belongs to them."""

    pictures: NDArray[np.float32]
    circle: outlines.Circle
    clipped: float
    seconds: NDArray[np.float64]  # (L,), 1 where not known


Measured = tuple[Photographs, ImportSettings]
RESPONSES = ("srgb", "linear")  # what cameras and converters write


def calibrated(photographs: Photographs, settings: ImportSettings, reader: Reader) -> Work[Measured]:
    """Return the photographs with lights measured by a mirror sphere, a gray one, or both, and the settings decided.

    A mirror sphere gives directions, a gray one irradiances - and the directions, too, where nothing else does. Where
    the lights are also listed, the set of directions that predicts the pictures of the gray sphere better is taken,
    the mirror's where there is no gray sphere. The notes hold the figures under ``calibration``: ``light_mae_deg``
    and ``light_angles_deg`` between mirror and list; ``gray_error_pct`` of each set of directions, and
    ``gray_angle_deg`` from each to the directions that the gray sphere's own shading gives. Where the response is
    not stated, the gray sphere decides between sRGB and linear: it is the one of the two that makes it Lambertian.

    Raises
    ------
    LightsphereError
        When a sphere is not found, or its photographs are not as many as those of the object.
    """
    if photographs.lights.kind == "near":
        raise LightsphereError(
            "spheres measure distant lights, but near ones are listed; leave out --chrome and --gray"
        )
    candidates: dict[str, NDArray[np.float64]] = {}
    figures: dict[str, Any] = {}
    assumed = photographs.assumed
    if settings.gray and settings.response == "auto":
        settings, words = yield from _response(photographs, settings, reader)
        assumed += (words,)
    if settings.chrome:
        mirror = yield from _sphere(settings.chrome, photographs, settings, reader, np.median)
        candidates["mirror sphere"], doubtful = spheres.mirrored(mirror.pictures, mirror.circle)
        if doubtful.any():
            numbers = ", ".join(str(i + 1) for i in np.flatnonzero(doubtful))
            assumed += (f"the larger of several highlights in pictures {numbers} of the mirror sphere",)
    if photographs.lights.kind == "distant":
        candidates["list"] = photographs.lights.position
    if len(candidates) == 2:
        apart = spheres.angles(*candidates.values())
        figures |= {"light_mae_deg": float(apart.mean()), "light_angles_deg": apart.round(3).tolist()}
    stated = photographs.lights.intensity if photographs.lights.kind == "distant" else None
    chosen = next(iter(candidates), "gray sphere")
    if settings.gray:
        gray = yield from _sphere(settings.gray, photographs, settings, reader, np.max)
        own = spheres.shaded(gray.pictures, gray.circle, gray.clipped)
        candidates["gray sphere"] = own
        fits = {name: spheres.irradiance(gray.pictures, gray.circle, d, gray.clipped) for name, d in candidates.items()}
        figures["gray_error_pct"] = {name: error for name, (_, error) in fits.items()}
        figures["gray_angle_deg"] = {name: float(spheres.angles(d, own).mean()) for name, d in candidates.items()}
        chosen = min((name for name in fits if name != "gray sphere"), key=lambda name: fits[name][1], default=chosen)
        rate = fits[chosen][0] / gray.seconds[:, None]
        stated = np.pi * rate / rate.mean()
    figures["directions"] = chosen
    measured = dataclasses.replace(
        photographs,
        lights=distant(candidates[chosen], stated),
        assumed=assumed if stated is None else tuple(words for words in assumed if words != EQUAL_STRENGTH),
        notes=photographs.notes | {"calibration": figures},
    )
    return measured, settings


def _response(photographs: Photographs, settings: ImportSettings, reader: Reader) -> Work[tuple[ImportSettings, str]]:
    """Return the settings with the response under which a gray sphere is Lambertian, and words for that."""
    errors = {}
    for name in RESPONSES:
        tried = dataclasses.replace(settings, response=name)
        gray = yield from _sphere(settings.gray, photographs, tried, reader, np.max)
        own = spheres.shaded(gray.pictures, gray.circle, gray.clipped)
        errors[name] = spheres.irradiance(gray.pictures, gray.circle, own, gray.clipped)[1]
    best, other = sorted(errors, key=lambda name: errors[name])
    words = f"{best} by the gray sphere ({errors[best]:.1f} % from Lambertian; {other} {errors[other]:.1f} %)"
    return dataclasses.replace(settings, response=best), words


def _sphere(
    where: str, photographs: Photographs, settings: ImportSettings, reader: Reader, combine: Any
) -> Work[Sphere]:
    """Read the pictures of a sphere in the order of the object's, cropped to the sphere.

    A folder holds photographs of its own; a picture is the mask of a sphere beside the object. Without a mask the
    sphere is sought where the pictures combine: lit from all sides a gray sphere has a rim (maximum); in a mirror
    that is what stays (median), while highlights move.
    """
    path = Path(where)
    beside = path.is_file()
    shots = list(photographs.shots) if beside else _in_order(path, photographs, settings, reader)
    mask_path = path if beside else files.special(path, "mask")
    if mask_path is not None:
        bright = reader(mask_path).pixels.max(axis=2)
        outline, shape = _named(path, outlines.outline, bright > 0.5 * max(float(bright.max()), 1e-9)), bright.shape
    else:
        chosen = np.unique(np.linspace(0, len(shots) - 1, SEARCHED).round().astype(int))
        seen: list[NDArray[np.float32]] = []
        for i, light in enumerate(chosen):
            seen.append(decoded(shots[light], settings.response).linear.max(axis=2))
            _check_size(shots[light], seen[-1].shape, seen[0].shape)
            yield Progress(f"find {path.name}", i + 1, len(chosen), "pictures")
        outline, shape = _named(path, outlines.sought, combine(np.stack(seen), axis=0)), seen[0].shape
    pictures, times, clipped = [], [], np.inf
    for i, exposures in enumerate(shots):
        one = decoded(exposures, settings.response)
        _check_size(exposures, one.linear.shape[:2], shape)
        crop, circle = _cropped(one.linear, outline)
        pictures.append(crop)
        times.append(one.seconds or 1.0)
        clipped = min(clipped, one.saturation)
        yield Progress(f"read {path.name}", i + 1, len(shots), "pictures")
    return Sphere(np.stack(pictures), circle, clipped, np.array(times))


def _check_size(exposures: tuple[Shot, ...], shape: tuple[int, ...], first: tuple[int, ...]) -> None:
    if shape != first:
        raise LightsphereError(
            f"{exposures[0].name} of the sphere is {shape[1]}x{shape[0]} pixels, the others or the mask "
            f"{first[1]}x{first[0]}; all need the same size"
        )


def _named(path: Path, find: Callable[[NDArray[Any]], outlines.Circle], picture: NDArray[Any]) -> outlines.Circle:
    """Return the circle found in a picture; what is wrong is said with the path."""
    try:
        return find(picture)
    except LightsphereError as error:
        raise LightsphereError(f"{path}: {error}") from error


def _cropped(picture: NDArray[np.float32], circle: outlines.Circle) -> tuple[NDArray[np.float32], outlines.Circle]:
    left, top = (max(int(place - circle.radius) - MARGIN, 0) for place in (circle.x, circle.y))
    right, bottom = (int(place + circle.radius) + 1 + MARGIN for place in (circle.x, circle.y))
    crop = picture[top:bottom, left:right].copy()
    return crop, dataclasses.replace(circle, x=circle.x - left, y=circle.y - top)


def _in_order(path: Path, photographs: Photographs, settings: ImportSettings, reader: Reader) -> list[tuple[Shot, ...]]:
    """Return a sphere's photographs, the first of them belonging to the object's first.

    Both series were taken in one order, that of the names; a list of lights may order the object's otherwise.
    """
    found = groups(path, "", settings.bracket, False, reader)
    if len(found) != len(photographs.shots):
        raise LightsphereError(
            f"{path} holds photographs under {len(found)} lights, the object's are {len(photographs.shots)}; "
            "photograph the sphere under each light of the object"
        )
    first = [exposures[0] for exposures in photographs.shots]
    order = sorted(range(len(first)), key=lambda i: files.natural(Path(first[i].name)))
    shots: list[tuple[Shot, ...]] = [()] * len(order)
    for place, (_, exposures) in zip(order, found, strict=True):
        shots[place] = exposures
    return shots
