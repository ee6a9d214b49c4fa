"""The report of a demo: what went in, what came out, how far it is off, and what that cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.capture import Capture, Truth
from ..core.compare.pictures import picture_error
from ..core.compare.shapes import depth_error_pct
from ..core.shape import Shape
from ..core.shape.mesh import Mesh
from ..core.tradeoff import Trial, dominated
from . import figures, html, style

AZIMUTHS = (0.0, -45.0, 40.0)
SAMPLES = 6
ERROR_DECADES = (1e-4, 1.0)

MEANING = {
    "recovered_pct": ("Object pixels that got a depth", "%"),
    "depth_median_pct": ("Depth error of the usual pixel, of the object's size", "%"),
    "depth_p95_pct": ("Depth error that 95 of 100 pixels stay below", "%"),
    "normal_mae_deg": ("Mean angle between recovered and true surface direction", "°"),
    "normal_median_deg": ("The same angle at the usual pixel", "°"),
    "confidence_high_p95_pct": ("Depth error, 95 of 100, where confidence is highest (best third)", "%"),
    "confidence_low_p95_pct": ("Depth error, 95 of 100, where confidence is lowest (worst third)", "%"),
    "material_rel_rms": ("Material: error of reflected light on lights the fit never saw", ""),
    "material_rel_rms_median": ("The same at the usual pixel", ""),
    "relight_rel_rmse": ("Asset in Cycles under new lamps against the true object, same view", ""),
    "new_view_rel_rmse": ("Asset in Cycles from a new view against the true object", ""),
}

BIAS = "worth it for a picture, but a bias for the depth"
STAGES = {
    "plan": "Find out which effects matter",
    "capture": "Render the pictures",
    "shape": "Solve the shape, at three settings",
    "material": "Fit the material, write the asset",
    "views": "Render the new views",
}
CHOICES = {
    "direct": "Light that bounces from surface to surface was measured on a few small pictures, and left out of the "
    "capture: the method compares lamps that stand behind each other, and bounced light, which does not come from the "
    "lamp, would bias it. Direct light with its shadows needs one sample a pixel and has no noise. To see what the "
    "rest costs and does, run the demo with --effects auto.",
    "auto": "Each effect was measured on a few small pictures, and simulated where leaving it out may change the light "
    "of a group of surfaces by more than a third of the error asked for.",
    "full": "Every effect was simulated, as asked for; what each adds was measured on a few small pictures.",
}


@dataclass(frozen=True)
class Results:
    """Everything that the report shows.

    Parameters
    ----------
    scene : str
        What was captured, in words.
    capture : Capture
    truth : Truth
    shape : Shape
    mesh : Mesh
    asset_view, true_view : (H, W, 3) float32
        The asset and the true object from the same new view under the same light, linear.
    errors : dict of str to float
        Named as in MEANING.
    trials : sequence of Trial
        Of the shape stage.
    seconds : dict of str to float
        By stage.
    effects : sequence of dict
        What the plan of the capture's effects found, see the stage ``plan``.
    choice : str
        ``"direct"``, ``"auto"`` or ``"full"``: how the effects of the capture were chosen.
    """

    scene: str
    capture: Capture
    truth: Truth
    shape: Shape
    mesh: Mesh
    asset_view: NDArray[np.float32]
    true_view: NDArray[np.float32]
    errors: dict[str, float]
    trials: Sequence[Trial]
    seconds: dict[str, float]
    effects: Sequence[dict[str, Any]]
    choice: str


def report(results: Results) -> str:
    """Return the report as one HTML document with every picture inside."""
    parts = [
        _head(results),
        _input(results),
        _shape(results),
        _mesh(results),
        _asset(results),
        _errors(results),
        _cost(results),
        _effects(results),
        _time(results),
        _foot(results),
    ]
    return html.page(f"Lightsphere: {results.scene}", parts)


def _head(r: Results) -> str:
    errors = r.errors
    size = r.truth.diameter
    return (
        html.text("Lightsphere report", "kicker")
        + f"<h1>{r.scene[:1].upper() + r.scene[1:]}, recovered from {len(r.capture)} pictures</h1>"
        + html.text(
            "One camera that stands still, one small lamp at a time. From the way every pixel brightens and darkens "
            "as the lamp moves over two spheres of positions, its distance follows, whatever the material. The result "
            "is a mesh with a material that Blender can turn, move and light anew.",
            "lead",
        )
        + html.facts(
            [
                (length(errors["depth_median_pct"] / 100 * size), f"usual depth error, on an object of {length(size)}"),
                (f"{errors['normal_mae_deg']:.2g}°", "mean error of the surface's direction"),
                (f"{100 * errors['relight_rel_rmse']:.2g} %", "error of its pictures under new lamps"),
                (f"{sum(r.seconds.values()):.0f} s", "for everything on this page"),
            ]
        )
    )


def percent(value: float) -> str:
    """Say a figure in per cent; a dash where there is none."""
    return f"{value:.2g} %" if np.isfinite(value) else "–"


def length(metres: float) -> str:
    """Say a length in the unit that suits it.

    Examples
    --------
    >>> length(2.4), length(0.0035), length(4e-6)
    ('2.4 m', '3.5 mm', '0.004 mm')
    """
    return f"{metres:.2g} m" if metres >= 0.1 else f"{1000 * metres:.2g} mm"


def _input(r: Results) -> str:
    strips = []
    for surface, words in (("inner", "nearer to"), ("outer", "farther from")):
        lights = telling_lights(r.capture, surface, SAMPLES)
        pictures = [r.capture.image(int(light)) for light in lights]
        exposure = style.exposure_for(np.stack(pictures), 97)
        shown = [html.figure(style.picture_png(style.display(p, exposure)), "", "", "pixels") for p in pictures]
        count = len(r.capture.lights.on(surface))
        strips.append(html.text(f"Lamps on the {surface} sphere, {words} the object: {SAMPLES} of {count}.", "soft"))
        strips.append(html.row(shown, "row strip"))
    width, height = r.capture.camera.resolution
    return html.section(
        "What went in",
        html.text(
            f"{len(r.capture)} pictures of {width} x {height} pixels, each under one lamp. The program knows where the "
            "camera and the lamps stand, and nothing of the object."
        ),
        *strips,
    )


def telling_lights(capture: Capture, surface: str, count: int) -> NDArray[np.int64]:
    """Choose lights of a surface in front of the object, evenly from left to right: those behind it show little."""
    own = capture.lights.on(surface)
    local = (capture.lights.position[own] - capture.lights.position.mean(axis=0)) @ capture.camera.to_world[:3, :3]
    radius = np.linalg.norm(local, axis=1).max()
    wanted = np.stack([np.linspace(-0.62, 0.62, count), np.full(count, 0.42), np.full(count, 0.6)], axis=-1)
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    nearest = np.linalg.norm(local[None] / radius - wanted[:, None], axis=-1).argmin(axis=1)
    return np.asarray(own[nearest])


def _shape(r: Results) -> str:
    mask = r.capture.mask()
    part = around(mask)
    depth = np.where(mask, r.shape.depth, np.nan)[part]
    low, high = np.nanpercentile(depth, [0.5, 99.5])
    error = np.where(mask, depth_error_pct(r.shape, r.truth), np.nan)[part]
    rank = np.where(mask, ranks(r.shape.confidence, mask), np.nan)[part]
    normal = np.where(mask[..., None], r.shape.normal, np.nan)[part]
    shown = [
        html.figure(
            style.picture_png(style.mapped(depth, low, high, style.DEPTH)),
            "Depth.",
            "Distance from the camera; yellow is near.",
            "pixels",
            figures.scale_bar(low, high, style.DEPTH, "metres"),
        ),
        html.figure(
            style.picture_png(style.mapped(error, *ERROR_DECADES, style.ERROR, logarithmic=True)),
            "Depth error.",
            "Against the truth; each step of the scale is ten times the one before.",
            "pixels",
            figures.scale_bar(*ERROR_DECADES, style.ERROR, "% of the object's size", logarithmic=True),
        ),
        html.figure(
            style.picture_png(style.mapped(rank, 0.0, 1.0, style.CONFIDENCE)),
            "Confidence.",
            "How the program itself ranks its pixels, not knowing the truth.",
            "pixels",
            figures.word_scale(style.CONFIDENCE, "least sure", "surest"),
        ),
        html.figure(
            style.picture_png(figures.normal_colours(normal)),
            "Surface direction.",
            "Pink faces right, green up, blue the viewer.",
            "pixels",
            figures.direction_key(),
        ),
    ]
    return html.section(
        "What came out: the shape",
        html.text(
            "Every pixel of the object has a distance and a direction of its own. The program was not told of what "
            "material anything is, and the true shape was used only afterwards, to measure the errors."
        ),
        html.row(shown),
    )


def around(mask: NDArray[np.bool_], margin: int = 3) -> tuple[slice, slice]:
    """Return the part of a picture that holds the mask."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    first, last = (np.array([rows[i], columns[i]]) for i in (0, -1))
    return tuple(slice(max(a - margin, 0), b + margin + 1) for a, b in zip(first, last, strict=True))  # type: ignore


def ranks(values: NDArray[Any], mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the rank of every pixel among those of the mask, from 0 to 1."""
    result = np.zeros(mask.shape)
    order = np.argsort(np.argsort(values[mask], kind="stable"), kind="stable")
    result[mask] = order / max(len(order) - 1, 1)
    return result


def _mesh(r: Results) -> str:
    words = ("As the camera saw it", "From the left", "From the right")
    shown = [
        html.figure(png, f"{title}.", "" if i else f"{len(r.mesh.faces):,} triangles, one corner per pixel.")
        for i, (png, title) in enumerate(zip(figures.wireframe(r.mesh, r.capture.camera, AZIMUTHS), words, strict=True))
    ]
    return html.section(
        "The mesh",
        html.text(
            "What one camera sees is a relief: the far side is open, and where one part stands in front of another the "
            "mesh is cut instead of stretched across the gap. Orange shows the inside of the surface."
        ),
        html.row(shown),
    )


def _asset(r: Results) -> str:
    exposure = style.exposure_for(r.true_view, 99.7)
    both = np.concatenate([r.asset_view, r.true_view], axis=1)
    error = picture_error(r.asset_view, r.true_view)
    high = _rounded_up(float(np.percentile(error, 99)))
    half = both.shape[1] // 2
    asset, true = (style.picture_png(style.display(part, exposure)) for part in (both[:, :half], both[:, half:]))
    return html.section(
        "The asset, seen anew",
        html.text(
            "Both pictures are rendered by Cycles from a side that the camera never saw, under the same two soft "
            "lamps, on the same ground. Only the object differs: recovered on the left, true on the right."
        ),
        html.row(
            [
                html.figure(asset, "Recovered.", "What the first camera did not see is open."),
                html.figure(true, "True.", "The object that was captured."),
                html.figure(
                    style.picture_png(style.mapped(error, 0.0, high, style.ERROR)),
                    "Difference.",
                    "Largest at the border of what was seen.",
                    "",
                    figures.scale_bar(0.0, high, style.ERROR, "of the picture's level"),
                ),
            ],
        ),
    )


def _rounded_up(value: float) -> float:
    """The next number of one digit."""
    unit = 10.0 ** np.floor(np.log10(max(value, 1e-12)))
    return float(np.ceil(value / unit) * unit)


def _errors(r: Results) -> str:
    rows = [
        [f"{words} `{name}`", f"{r.errors[name]:.3g}{unit and ' '}{unit}"]
        for name, (words, unit) in MEANING.items()
        if name in r.errors
    ]
    return html.section(
        "How far it is off",
        html.text("Depth errors are in per cent of the object's largest extent, over the pixels that show the object."),
        html.table(["What", "Error"], rows, numbers=[1]),
    )


def _cost(r: Results) -> str:
    name = "depth_median_pct"
    beaten = dominated(r.trials)
    rows = [
        [
            t.label,
            f"{t.seconds:.1f} s",
            f"{t.errors['recovered_pct']:.0f} %",
            percent(t.errors[name]),
            percent(t.errors["depth_p95_pct"]),
            better or "–",
        ]
        for t, better in zip(r.trials, beaten, strict=True)
    ]
    heads = ["Lamps", "Time", "Pixels", "Usual error", "95 of 100", "Beaten by"]
    return html.section(
        "What accuracy costs",
        html.text(
            "The shape solved again from some of the lamps (inner/outer), evenly spread; the capture shortens in "
            "proportion. With few lamps, pixels that are seldom lit stay without a depth. A row is beaten when another "
            "is no slower, no worse and no less complete."
        ),
        '<div class="two">'
        + html.figure(figures.tradeoff_plot(r.trials, "seconds to solve the shape"), "", "")
        + html.table(heads, rows, numbers=[1, 2, 3, 4])
        + "</div>",
    )


def _effects(r: Results) -> str:
    rows = []
    for effect in r.effects:
        share, saves = effect["contribution_pct"], effect["saves_pct"]
        if share is None:
            continue
        rows.append(
            [
                effect["effect"],
                f"{share:.1f} ± {effect['uncertainty_pct']:.1f} %",
                f"{max(saves, 0):.0f} %" if saves is not None else "–",
                "yes" if effect["simulated"] else "no",
                BIAS if effect["wanted"] and not effect["simulated"] else effect["reason"],
            ]
        )
    heads = ["Effect", "Without it pictures are off by", "Its share of the time", "Simulated", "Why"]
    missing = [f"{e['effect']} ({e['reason']})" for e in r.effects if e["contribution_pct"] is None]
    return html.section(
        "Which effects were simulated",
        html.text(CHOICES[r.choice]),
        html.table(heads, rows, numbers=[1, 2]),
        html.text(f"Not in these pictures: {', '.join(missing)}."),
    )


def _time(r: Results) -> str:
    entries = [(STAGES.get(stage, stage), seconds, f"{seconds:.1f} s") for stage, seconds in r.seconds.items()]
    return html.section("Where the time went", html.bars(entries))


def _foot(r: Results) -> str:
    notes = r.capture.notes
    spheres = ", ".join(
        f"{len(r.capture.lights.on(s))} {s} lamps at {notes['settings'][f'radius_{s}']:g} m" for s in ("inner", "outer")
    )
    width, height = r.capture.camera.resolution
    words = (
        f"{width} x {height} pixels; {spheres}; object {notes['diameter']:.3g} m; Blender {notes['blender']}. "
        "Method: double covering by two light spheres (Magda, Kriegman, Zickler, Belhumeur 2001). All figures are in "
        "metrics.json; the asset is asset.blend: open it and press F12."
    )
    return f"<footer>{words}</footer>"
