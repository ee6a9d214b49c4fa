"""`lightsphere relight`: pictures under new lights, from the capture itself."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from ..core import images, light_file
from ..core.capture import Capture
from ..core.errors import LightsphereError
from ..core.progress import finish
from ..core.relight import RelightSettings, compact, emitters, environment, messages
from ..core.relight import ptm as maps
from ..core.relight.emitters import Emitter
from ..core.relight.film import moving_light
from ..core.relight.render import check_outside, prepare, relit
from ..core.relight.stack import Expected, Stack
from ..core.shape import Shape
from ..core.tradeoff import Variant
from ..core.tradeoff.excerpt import AROUND
from ..core.tradeoff.forecast import foretold
from ..core.tradeoff.goal import Goal, Promise
from ..core.tradeoff.relight import held_out, held_out_errors, variants
from ..core.tradeoff.thinning import thinned_to
from .reflectance import capture_of
from .stage import Budget, DryRun, Figures, JsonFile, Target, run_with_bar, settings_options

COMPACT, PTM = "relightable.npz", "relit.ptm"
FRAMES = 72
PER_SECOND = 24
SPARSE = 15.0  # degrees between lights from which on what lies between them is guessed


@settings_options(RelightSettings)
def relight(
    folder: Annotated[
        Path,
        typer.Argument(
            help="folder of a shape, which names its capture; a file of --compact; a capture for its true depth"
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of the pictures")],
    settings: RelightSettings,
    point: Annotated[
        list[str] | None,
        typer.Option(
            help='a near light, "X Y Z" or "X Y Z I" [m, W/sr]; give it again for more', metavar='"X Y Z [I]"'
        ),
    ] = None,
    distant: Annotated[
        list[str] | None,
        typer.Option(help='a distant light, "X Y Z" or "X Y Z E": direction to it, irradiance', metavar='"X Y Z [E]"'),
    ] = None,
    environment_map: Annotated[
        Path | None, typer.Option("--environment", help="an equirectangular map, .exr or .hdr")
    ] = None,
    lights: Annotated[Path | None, typer.Option(help="a list of lights; one picture under each")] = None,
    scene: Annotated[Path | None, typer.Option(help="a .blend, every light of which shines as it does there")] = None,
    film: Annotated[
        bool, typer.Option("--film", help="a film of a light that comes from infinity, turns by 90 degrees and leaves")
    ] = False,
    ptm: Annotated[
        bool, typer.Option("--ptm", help="relit.ptm, which RTI viewers show, of pictures under 64 distant lights")
    ] = False,
    rate: Annotated[
        float | None,
        typer.Option(
            "--compact",
            min=1.0,
            metavar="RATE",
            help="capture and shape in one file, relightable.npz, in 1/RATE of their bytes, to relight from; e.g. 20",
        ),
    ] = None,
    true_depth: Annotated[
        bool, typer.Option("--true-depth", help="the folder is a capture: take the true depth, to compare with")
    ] = False,
    budget: Budget = None,
    target: Target = None,
    dry_run: DryRun = False,
    json: JsonFile = None,
) -> None:
    """Make pictures of a captured object under new lights, shadows and interreflection included, without tracing a ray.

    All lights of the options shine together in relit.exr and relit.png; --lights and --film make a picture each.
    --budget and --target choose how many of the capture's pictures are used and how they are interpolated; the error is
    that of pictures under twelve lights of the capture, which are left out of the rest for it.
    """
    goal = Goal(budget, target)
    with Figures("relight", json) as figures:
        capture, shape = opened(folder, true_depth)
        centre = middle(capture, shape)
        together = asked_for(centre, point or [], distant or [], environment_map, scene)
        listed = of_list(lights, centre) if lights is not None else []
        moving = moving_light(shape.camera, shape.points()[np.isfinite(shape.depth)], FRAMES) if film else []
        if not (together or listed or moving or ptm or rate):
            raise LightsphereError(
                "no light is given; use --point, --distant, --environment, --lights, --scene, --film or --ptm, "
                "or write a file by --compact"
            )
        check_outside(shape, [*together, *listed, *moving])
        used, unseen = capture, np.zeros(0, np.int64)
        if goal or dry_run:
            count = len(together) + len(listed) + len(moving)
            promise = promised(shape, capture, settings, count, goal)
            if dry_run:
                figures.foreseen(promise)
                return
            figures.promise = promise
            settings = dataclasses.replace(settings, **promise.expected.settings)
            used, unseen = held_out(capture)
        if rate:
            written = run_with_bar(compact.write(output / COMPACT, capture, shape, rate, settings.memory))
            figures.values["compact"] = written
        prepared = run_with_bar(prepare(thinned_to(used, settings.pictures), shape, settings))
        spacing = (prepared.stack if isinstance(prepared, Expected) else prepared).spacing()
        figures.values["light_spacing_deg"] = spacing
        output.mkdir(parents=True, exist_ok=True)
        if together:
            write(output, ["relit"], [run_with_bar(relit(prepared, together))])
        for prefix, emitters_in_turn in (("relit_", listed), ("film_", moving)):
            pictures = [run_with_bar(relit(prepared, [one])) for one in emitters_in_turn]
            write(output, [f"{prefix}{number:04d}" for number in range(len(pictures))], pictures)
        if film:
            from ..blender import film as blender

            blender.encode(output, "film_", len(moving), output / "film.mp4", PER_SECOND)
        count = bool(together) + len(listed) + len(moving)
        figures.values.update(pictures=count, emitters=len(together) + len(listed) + len(moving))
        figures.summary = f"{count} pictures in {output}" + (f", film.mp4 of {FRAMES} of them" if film else "")
        if not count:
            figures.summary = f"in {output}"
        if ptm:
            rms = figures.values["ptm_rms"] = write_ptm(output / PTM, prepared, shape)
            figures.summary += f"; {PTM}, whose polynomials are {rms:.1f} of 255 off"
        if rate:
            figures.summary += (
                f"; {COMPACT} has {written['bytes'] / 1e6:.2g} MB, 1/{written['rate']:.3g} of half precision, "
                f"its pictures are {100 * written['coded_rel_rmse']:.2g} % off"
            )
        if goal:
            figures.obtained(held_out_errors(prepared, capture, unseen))
    if spacing > SPARSE:
        print(
            f"lightsphere: {folder}: the capture's lights stand {spacing:.0f} degrees apart, so that highlights "
            "between them are guessed; photograph under more lights, or render the shape's material in Blender",
            file=sys.stderr,
        )


@settings_options(RelightSettings)
def relight_worker(
    folder: Annotated[Path, typer.Argument(help="folder of a shape, which names its capture")],
    output: Annotated[Path, typer.Argument(help="the picture, an EXR, written anew for every line")],
    settings: RelightSettings,
) -> None:
    """Make a picture for every line of emitters on standard input; answer each when it is written."""
    try:
        capture, shape = opened(folder, False)
        prepared = finish(prepare(thinned_to(capture, settings.pictures), shape, settings))
    except LightsphereError as error:
        print("error", error, flush=True)
        return
    print("ready", flush=True)
    for line in sys.stdin:
        try:
            shining = messages.of_line(line)
            check_outside(shape, shining)
            images.write_rgb(output, finish(relit(prepared, shining)))
            print("picture", output, flush=True)
        except LightsphereError as error:
            print("error", error, flush=True)


def promised(shape: Shape, capture: Capture, settings: RelightSettings, made: int, goal: Goal) -> Promise:
    """Choose the settings for a goal and so many pictures, with a bar."""

    def choices(part: Capture) -> list[Variant]:
        return variants(shape.within(part.mask()), part, settings, made)

    return run_with_bar(foretold(choices, capture, np.isfinite(shape.depth), goal, AROUND))


def opened(folder: Path, true_depth: bool) -> tuple[Capture, Shape]:
    """Open a shape and its capture, what holds both, or a capture with its true depth for a shape."""
    if folder.is_file():
        if true_depth:
            raise LightsphereError(f"{folder} keeps no true depth; give the folder of the capture")
        return compact.read(folder)
    if not true_depth:
        shape = Shape.open(folder)
        return capture_of(folder, shape), shape
    capture = Capture.open(folder)
    truth = capture.truth()
    if truth is None or not np.isfinite(truth.depth).any():
        raise LightsphereError(f"{folder} is a capture without true depth; give the folder of a shape made from it")
    return capture, Shape(capture.camera, truth.depth, truth.normal, np.isfinite(truth.depth).astype(np.float32))


def middle(capture: Capture, shape: Shape) -> NDArray[np.float64]:
    """Return what lights are about: the middle of the capture's, of distant ones that of the object."""
    around = capture.lights.position if capture.lights.kind == "near" else shape.points()[np.isfinite(shape.depth)]
    return np.asarray(around.mean(axis=0))


def asked_for(
    centre: NDArray[np.float64],
    points: Sequence[str],
    directions: Sequence[str],
    map_file: Path | None,
    scene: Path | None,
) -> list[Emitter]:
    """Return the emitters of the options that shine together."""
    found = [emitters.point(place, [strength or usual(centre, place)] * 3) for place, strength in map(four, points)]
    found += [emitters.distant(towards, [strength or np.pi] * 3) for towards, strength in map(heading, directions)]
    if map_file is not None:
        found += environment.emitters_of(read_map(map_file))
    if scene is not None:
        from ..blender import emitters as blender
        from ..blender import scene as scenes

        found += blender.of_scene(scenes.load(str(scene)))
    return found


def of_list(path: Path, centre: NDArray[np.float64]) -> list[Emitter]:
    """Return the emitters of a list of lights about a centre."""
    listed = light_file.read(path, centre)
    make = emitters.distant if listed.kind == "distant" else emitters.point
    return [make(place, strength) for place, strength in zip(listed.position, listed.intensity, strict=True)]


def four(words: str) -> tuple[list[float], float | None]:
    """Read "X Y Z" or "X Y Z STRENGTH"."""
    try:
        numbers = [float(word) for word in words.replace(",", " ").split()]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 4) or not np.isfinite(numbers).all():
        raise LightsphereError(f'{words!r} is no light; write "X Y Z" or "X Y Z STRENGTH" in quotes')
    if len(numbers) == 4 and not numbers[3] > 0:
        raise LightsphereError(f"{words!r} has no positive strength; correct the fourth number")
    return numbers[:3], numbers[3] if len(numbers) == 4 else None


def heading(words: str) -> tuple[list[float], float | None]:
    """Read "X Y Z" or "X Y Z STRENGTH" of a distant light."""
    towards, strength = four(words)
    if not any(towards):
        raise LightsphereError(f'{words!r} is no direction; write which way the light is, as in "0 0 1" for above')
    return towards, strength


def usual(centre: NDArray[np.float64], place: Sequence[float]) -> float:
    """Return the intensity under which a white Lambertian surface at the centre reflects a radiance of 1."""
    return float(np.pi * ((np.array(place) - centre) ** 2).sum())


def read_map(path: Path) -> NDArray[np.float32]:
    """Read an environment map."""
    if path.suffix.lower() == ".exr":
        return images.read_rgb(path)
    from ..blender.pictures import read

    return read(path).pixels


def write_ptm(path: Path, prepared: Stack | Expected, shape: Shape) -> float:
    """Write a polynomial texture map as bright as its picture under a light before it; return how far it is off."""
    from ..report import style

    lights = maps.directions()
    in_world = lights @ shape.camera.to_world[:3, :3].T
    under = [emitters.distant(towards, [np.pi] * 3) for towards in in_world.tolist()]
    exposure = style.exposure_for(finish(relit(prepared, under[:1])))
    shown = (style.display(run_with_bar(relit(prepared, [one])), exposure) for one in under)
    polynomials = maps.fitted(lights, shown)
    maps.write(path, polynomials.coefficients)
    return polynomials.rms


def write(folder: Path, names: Sequence[str], pictures: Sequence[NDArray[np.float32]]) -> None:
    """Write pictures as EXR and as PNG, all of one exposure."""
    from ..report import style

    exposure = style.exposure_for(np.stack(pictures)) if pictures else 1.0
    for name, picture in zip(names, pictures, strict=True):
        images.write_rgb(folder / f"{name}.exr", picture)
        images.write_bytes(folder / f"{name}.png", style.picture_png(style.display(picture, exposure)))
