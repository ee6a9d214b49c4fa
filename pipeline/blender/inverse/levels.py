"""Which level a group has: pictures of it as a white diffuse and as glossy surfaces, combined."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.inverse import LEVELS, MOST, SHARP, Model
from ...core.inverse.estimate import Fit, better, combined
from ...core.progress import Progress, Work
from .room import Room

Array = NDArray[np.float64]
SLOPES = (0.03, 0.06, 0.1, 0.16, 0.25, 0.4)
ANGLES = np.arange(0.0, 180.0, 30.0)
RATIO = 4.0  # at which angles are scanned
WORTH = 0.02**2  # mean square relative error that a richer level must take off
ENOUGH = 20_000  # samples on a group's pixels by which a picture of it is judged
SAMPLES = (2, 64)
HALF = 0.5  # reflectance of the pictures that are combined


def examined(
    room: Room,
    number: int,
    mask: NDArray[np.bool_],
    photograph: Array,
    weight: Array,
    most: int,
    seed: int,
) -> Work[tuple[Model, list[dict[str, Any]]]]:
    """Return the simplest model that explains a group as well as any, and what was tried, diffuse first.

    The group's own pixels are linear in its reflectances as long as the light that reaches it stays as it is.

    Parameters
    ----------
    room : Room
    number : int
        Of the group.
    mask : (H, W) bool
        Its pixels.
    photograph, weight : (H, W, 3) float64
    most : int
        The richest of LEVELS that is tried.
    seed : int
    """
    samples = int(np.clip(ENOUGH / mask.sum(), *SAMPLES))

    def shown(model: Model) -> Array:
        with room.trying(number, model):
            return np.stack([room.pixels(mask, samples, 2 * seed + s + 100_000, True) for s in range(2)]) / HALF

    def fitted(*bases: Array) -> Fit:
        return combined(np.stack(bases, axis=1), photograph[mask], weight[mask])

    def glossy(alpha: float, ratio: float = 1.0, angle: float = 0.0) -> Model:
        return Model("anisotropic", np.zeros(3), np.full(3, HALF), alpha, ratio, angle)

    diffuse = shown(Model("diffuse", np.full(3, HALF), np.zeros(3)))
    found: list[tuple[str, Model, Fit]] = []

    def keep(level: str, lobe: Model, fit: Fit) -> None:
        rho_d, rho_s = fit.factors if len(fit.factors) == 2 else (np.zeros(3), fit.factors[0])
        found.append((level, dataclasses.replace(lobe, level=level, diffuse=rho_d, specular=rho_s), fit))

    plain = fitted(diffuse)
    found.append(("diffuse", Model("diffuse", plain.factors[0], np.zeros(3)), plain))
    yield Progress("levels", 1, 2)
    if most >= LEVELS.index("mirror"):
        sharp = shown(glossy(SHARP))
        keep("mirror", glossy(SHARP), fitted(sharp))
        if most >= LEVELS.index("diffuse-specular"):
            keep("diffuse-specular", glossy(SHARP), fitted(diffuse, sharp))
        yield Progress("levels", 1, 2)
    if most >= LEVELS.index("isotropic"):
        tried = []
        for alpha in SLOPES:
            tried.append((glossy(alpha), fitted(diffuse, shown(glossy(alpha)))))
            yield Progress("levels", 1, 2)
        lobe, fit = min(tried, key=lambda pair: pair[1].error)
        keep("isotropic", lobe, fit)
    if most >= LEVELS.index("anisotropic") and better(found[0][2], fit, WORTH):
        tried = [(lobe, fit)]
        trials = [(lobe.alpha, RATIO, float(angle)) for angle in ANGLES]
        for stage in range(3):
            for alpha, ratio, angle in trials:
                candidate = glossy(alpha, ratio, angle % 180)
                tried.append((candidate, fitted(diffuse, shown(candidate))))
                yield Progress("levels", 1, 2)
            best, fit = min(tried, key=lambda pair: pair[1].error)
            if best.ratio == 1:
                break
            near = 15.0 if stage == 0 else 7.5
            trials = [
                (best.alpha, best.ratio, best.angle - near),
                (best.alpha, best.ratio, best.angle + near),
                (best.alpha, best.ratio * 1.5, best.angle),
                (best.alpha, best.ratio / 1.5, best.angle),
                (best.alpha * 1.25, best.ratio, best.angle),
                (best.alpha / 1.25, best.ratio, best.angle),
            ]
        if best.ratio > 1:
            keep("anisotropic", best, fit)
    best_fit = min((fit for *_, fit in found), key=lambda fit: fit.error)
    chosen = next(entry for entry in found if not better(entry[2], best_fit, WORTH))
    tried_levels = [{"level": level, "error": _relative(fit)} for level, _, fit in found]
    return _bounded(chosen[1]), tried_levels


def _relative(fit: Fit) -> float:
    return float(np.sqrt(max(fit.error, 0.0)))


def _bounded(model: Model) -> Model:
    return dataclasses.replace(
        model, diffuse=np.minimum(model.diffuse, MOST), specular=np.minimum(model.specular, MOST)
    )
