"""`lightsphere inverse`: reflectances of a known scene from one picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..core import images
from ..core.compare.pictures import relative_rmse
from ..core.errors import LightsphereError
from ..core.inverse import InverseSettings
from ..core.inverse.photograph import prepared
from .device import Device, render_on
from .stage import Figures, JsonFile, run_with_bar, settings_options

BLEND, PAGE = "recovered.blend", "report.html"
FINAL_SAMPLES = 128


@settings_options(InverseSettings)
def inverse(
    scene: Annotated[str, typer.Argument(help="the .blend with geometry, camera and lights; or a built-in scene")],
    photograph: Annotated[Path, typer.Argument(help="the picture of the real thing: EXR, PNG, TIFF, JPEG, RAW")],
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of the results")],
    settings: InverseSettings,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace earlier results")] = False,
    device: Device = "cpu",
    json: JsonFile = None,
) -> None:
    """Recover what every group of surfaces reflects, with global illumination, from one picture of a known scene.

    The scene's own materials are not looked at: surfaces that share one are a group, and every group gets the simplest
    level that explains its pixels: diffuse, mirror, diffuse-specular, isotropic, anisotropic, or a texture. What only a
    mirror shows is found through it. Writes recovered.blend, the scene with the recovered materials as nodes, the
    picture that it renders, and a page with what was tried, the errors and what they cost. The scene's file stays as
    it is. Materials that do more than reflect (glass, lamps) are kept, and so is what the picture tells nothing of.
    """
    from ..blender import scene as scenes
    from ..blender.inverse import groups
    from ..blender.inverse.room import Room
    from ..blender.inverse.solve import Search
    from ..blender.pictures import read

    if (output / BLEND).exists() and not overwrite:
        raise LightsphereError(f"{output / BLEND} exists; choose another folder, or replace it with --overwrite")
    with Figures("inverse", json) as figures:
        figures.values["device"] = render_on(device)
        picture = read(photograph)
        loaded = scenes.load(scene)
        loaded.view_layers[0].update()
        size = (loaded.render.resolution_x, loaded.render.resolution_y)
        seen = prepared(picture.pixels, picture.bits, settings.response, size, settings.resolution)
        every = groups.find(loaded, settings.groups)
        room = Room(loaded, every, seen.pixels.shape[1], seen.pixels.shape[0])
        search = Search(room, seen, settings)
        found = run_with_bar(search.run(), one_bar=True)
        figures.values.update(_figures(room, found, every))
        shown = room.render(FINAL_SAMPLES, 0)
        figures.values["rerendered_rel_rmse"] = relative_rmse(shown, seen.pixels, seen.trusted)
        output.mkdir(parents=True, exist_ok=True)
        images.write_rgb(output / "rerendered.exr", shown.astype("float32"))
        room.restore([number for number, word in enumerate(found.seen) if word == "not at all"])
        scenes.save(output / BLEND)
        from ..report.inverse import Results, report

        results = Results(Path(scene).stem, seen.pixels, shown, seen.trusted, figures.values, found.history)
        images.write_text(output / PAGE, report(results))
        levels = [one["level"] for one in figures.values["groups"].values()]
        counted = ", ".join(f"{levels.count(level)} {level}" for level in dict.fromkeys(levels))
        figures.summary = (
            f"{counted}; rerendered_rel_rmse {figures.values['rerendered_rel_rmse']:.3g}; look at {output / PAGE}"
        )


def _figures(room: Any, found: Any, every: list[Any]) -> dict[str, Any]:
    """Return what was found about every group, and what it cost."""
    described: dict[str, Any] = {}
    for number, group in enumerate(room.groups):
        seen = found.seen[number]
        described[group.name] = {
            **found.models[number].as_json(),
            "material": room.materials[number].name,
            "deviation": found.deviations[number],
            "seen": seen,
            "pixels": found.pixels[number],
            "tried": found.tried[number],
        }
        if seen == "not at all":
            described[group.name] = {"level": "kept", "seen": seen, "why": "the picture tells nothing of it"}
    for group in every:
        if group.kept:
            described[group.name] = {"level": "kept", "why": f"it {group.kept}"}
    cost = {"renders": room.renders, "render_seconds": room.seconds, "samples": room.samples}
    return {"groups": described, "history": found.history, **cost}
