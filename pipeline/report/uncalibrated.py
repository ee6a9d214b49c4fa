"""The page of unknown lights: photographs beside what was recovered of them, the lights, and what they leave open."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..core.capture import Capture
from ..core.compare.pictures import picture_error, relative_rmse
from ..core.reflectance.bivariate import Bivariate
from ..core.reflectance.picture import picture
from ..core.shape import Shape
from ..core.shape.mesh import relief
from . import figures, html, style

SHOWN = 3  # photographs beside what is rendered of them, the best, the middle and the worst
WIRES = 160  # of the wire-frames, at most
AZIMUTHS = (-35.0, 0.0, 35.0)  # from which the surface is drawn [degrees]


@dataclass(frozen=True)
class Results:
    """What the page shows: a name, a capture with the lights that were found, shape and reflectance, and the cost."""

    name: str
    capture: Capture
    shape: Shape
    reflectance: Bivariate
    seconds: float


def report(r: Results) -> str:
    """Return the page."""
    near = r.capture.lights.kind == "near"
    lights = zip(r.capture.lights.position, r.capture.lights.intensity, strict=True)
    pictures = [picture(r.shape, r.reflectance, place, intensity, near) for place, intensity in lights]
    mask = r.capture.mask() & (r.shape.confidence > 0)
    errors = [relative_rmse(pictures[k], r.capture.image(k), mask) for k in range(len(pictures))]
    parts = [_head(r, errors), _doubts(r), _photographs(r, pictures, errors), _lights(r, errors), _surface(r)]
    parts += [_materials(r), _course(r)]
    return html.page(f"Unknown lights of {r.name}", [part for part in parts if part])


def _head(r: Results, errors: list[float]) -> str:
    words = "Where the lamps stood, the surface, and what it is made of, from photographs under lights nobody measured."
    stated = np.array([one["deviation_deg"] for one in r.shape.notes["lights"]])
    return (
        html.text("Lightsphere shape", "kicker")
        + f"<h1>{html.escape(r.name)}</h1>"
        + html.text(words, "lead")
        + html.facts(
            [
                (f"{len(errors)}", "photographs"),
                (f"{stated.mean():.1f}°", "uncertainty of a light's direction"),
                (f"{100 * float(np.median(errors)):.2g} %", "rendered against a photograph"),
                (f"{r.seconds:.0f} s", "of work"),
            ]
        )
    )


def _doubts(r: Results) -> str:
    doubts = r.shape.notes["doubts"]
    return (
        html.section("What the photographs leave open", *(html.text(f"{words}.") for words in doubts)) if doubts else ""
    )


def _photographs(r: Results, pictures: list[NDArray[np.float32]], errors: list[float]) -> str:
    ranked = np.argsort(errors)
    rows = []
    for light in dict.fromkeys(int(ranked[round(share * (len(ranked) - 1))]) for share in np.linspace(0, 1, SHOWN)):
        photograph = r.capture.image(light)
        exposure = style.exposure_for(photograph)
        error = np.where(r.shape.confidence > 0, picture_error(pictures[light], photograph), np.nan)
        high = float(np.nanpercentile(error, 99.0))
        scale = figures.scale_bar(0.0, high, style.ERROR, "difference over the photograph's RMS")
        shown = style.picture_png(style.mapped(error, 0.0, high, style.ERROR))
        rows.append(
            html.row(
                [
                    html.figure(
                        style.picture_png(style.display(photograph, exposure)), f"Photograph {light + 1}.", "", "pixels"
                    ),
                    html.figure(
                        style.picture_png(style.display(pictures[light], exposure)), "Recovered.", "", "pixels"
                    ),
                    html.figure(shown, "Difference.", f"{100 * errors[light]:.2g} % altogether.", "pixels dark", scale),
                ]
            )
        )
    words = (
        "The best, the middle and the worst photograph. Cast shadows are not rendered here; Blender does, of the asset."
    )
    return html.section("The photographs", *rows, html.text(words, "soft"))


def _lights(r: Results, errors: list[float]) -> str:
    notes = r.shape.notes["lights"]
    direction = np.array([one["direction"] for one in notes]) @ r.shape.camera.to_world[:3, :3]
    figure = Figure(figsize=(4.4, 4.4))
    axes = figure.add_subplot()
    for angle in (30, 60, 90):
        ring = np.linspace(0, 2 * np.pi, 181)
        axes.plot(angle * np.cos(ring), angle * np.sin(ring), color=style.LINE, linewidth=0.8)
        axes.annotate(f"{angle}°", (0, angle), color=style.SOFT, fontsize=8, ha="center", va="bottom")
    away = np.degrees(np.arccos(np.clip(direction[:, 2], -1, 1)))
    across = direction[:, :2] / np.maximum(np.linalg.norm(direction[:, :2], axis=1, keepdims=True), 1e-9)
    place = across * away[:, None]
    turn = np.linspace(0, 2 * np.pi, 61)
    for number, (one, at) in enumerate(zip(notes, place, strict=True)):
        circle = at[:, None] + one["deviation_deg"] * np.array([np.cos(turn), np.sin(turn)])
        axes.fill(*circle, color=style.ACCENT, alpha=0.25, linewidth=0)
        axes.plot(*at, "o", color=style.ACCENT, markersize=5 * np.sqrt(one["strength"]))
        axes.annotate(f"{number + 1}", at, textcoords="offset points", xytext=(5, 4), fontsize=8, color=style.INK)
    axes.set_aspect("equal")
    axes.set_axis_off()
    columns = {
        "photograph": [f"{number + 1}" for number in range(len(notes))],
        "from the view": [f"{angle:.1f}°" for angle in away],
        "uncertainty": [f"{one['deviation_deg']:.1f}°" for one in notes],
    }
    if "distance" in notes[0]:
        said = [f"{one['distance']:.3g} m ± {one['distance_deviation_pct']:.1f} %" for one in notes]
        columns["from the object"] = said
    columns["strength"] = [f"{one['strength']:.3f}" for one in notes]
    columns["rendered against it"] = [f"{100 * error:.2g} %" for error in errors]
    heads, rows = tuple(columns), [list(row) for row in zip(*columns.values(), strict=True)]
    words = "Directions as the camera sees them, the view in the middle; the disk about each is its uncertainty."
    return html.section(
        "The lights", html.figure(style.plot_png(figure), "", words), html.table(heads, rows, range(len(heads)))
    )


def _surface(r: Results) -> str:
    colours = style.picture_png(figures.normal_colours(r.shape.normal))
    sure = style.picture_png(
        style.mapped(np.where(r.shape.confidence > 0, r.shape.confidence, np.nan), 0.0, 1.0, style.CONFIDENCE)
    )
    maps = [
        html.figure(colours, "Normals.", "", "pixels", figures.direction_key()),
        html.figure(
            sure, "Confidence.", "", "pixels dark", figures.word_scale(style.CONFIDENCE, "least sure", "surest")
        ),
    ]
    coarse = _coarser(r.shape)
    wires = [html.figure(png, "", "") for png in figures.wireframe(relief(coarse), coarse.camera, AZIMUTHS)]
    return html.section("The surface", html.row(maps), html.row(wires))


def _coarser(shape: Shape) -> Shape:
    """Return a shape of at most :data:`WIRES` pixels a side."""
    step = -(-max(shape.depth.shape) // WIRES)
    kept = {name: getattr(shape, name)[::step, ::step] for name in ("depth", "normal", "confidence")}
    height, width = kept["depth"].shape
    (fx, fy), (x, y) = shape.camera.focal, shape.camera.centre
    camera = dataclasses.replace(
        shape.camera, resolution=(width, height), focal=(fx / step, fy / step), centre=(x / step, y / step)
    )
    return dataclasses.replace(shape, camera=camera, layers={}, **kept)


def _materials(r: Results) -> str:
    weights = r.reflectance.weights[..., 0]
    high = float(np.nanpercentile(weights, 99.5))
    shown = [
        html.figure(
            style.picture_png(style.mapped(weights[..., k], 0.0, high, style.CONFIDENCE)),
            f"Weight of basis {k + 1}.",
            "",
            "pixels dark",
        )
        for k in range(weights.shape[-1])
    ]
    words = "How much every pixel has of each basis BRDF; lightsphere material makes a Blender file of them."
    return html.section("The materials", html.row(shown), html.text(words, "soft"))


def _course(r: Results) -> str:
    course, falls = r.shape.notes["objective"], r.shape.notes.get("steps", {})
    figure = Figure(figsize=(5.4, 2.6))
    axes = figure.add_subplot()
    axes.plot(np.arange(len(course)), course, "o-", color=style.ACCENT, linewidth=1.2, markersize=4)
    axes.set_yscale("log")
    axes.grid(color=style.LINE, linewidth=0.6)
    axes.set_xlabel("steps" if falls else "steps, by five")
    axes.set_ylabel("objective")
    words = "Misfit of the pictures and of the other cues believed: " + (", ".join(r.shape.notes["cues"]) or "none")
    words += ". " if falls else ". From the middle on the normals have to be those of one surface, too."
    if falls:
        shares = (f"{step} {100 * fall / sum(falls.values()):.2g} %" for step, fall in falls.items())
        words += f"Surface, normals, albedo, lights and materials move in turn. Of the fall: {', '.join(shares)}."
    return html.section("How it was found", html.figure(style.plot_png(figure), "", ""), html.text(words, "soft"))
