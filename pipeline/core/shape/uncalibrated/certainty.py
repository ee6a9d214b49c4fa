"""How sure the lights are, and what the photographs leave open, in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .joint import Joint
from .lamps import directions
from .solve import Solution

Array = NDArray[np.float64]

FLAT = 0.12  # least over largest spread of the lights below which they are nearly in a plane or a cone
MATT = 0.02  # share of the pixels that ever show a highlight, below which there is none to speak of
UNEXPLAINED = float(np.log(2.0))  # mean cost of the values beyond which the pictures are not explained
GUESSED, OPEN = 5.0, 30.0  # deviation [degrees] where guesses decide the relief: of a matt body; under FLAT lights
ANYWHERE = 60.0  # the same, where the pictures are not explained
SAID_EQUAL = 0.1  # scatter of strengths that fixes the relief
FEW_ALBEDOS = 2.0  # of a hue; fewer fix the relief
FALLOFF = 0.3  # deviation of near lights' distances below which their falloff tells how high the relief is
NEARER = 0.5  # share of the objective that near lights leave of distant ones' below which lamps are taken to be near
UNSURE = 3.0  # deviation of the lights [degrees] that is worth a warning


def deviations(solution: Solution, covariance: Array) -> tuple[Array, Array]:
    """Return the standard deviation of every light by the curvature and by what is nearly as good.

    Parameters
    ----------
    solution : Solution
    covariance : (L, N, L, N) float64
        Of its lights.

    Returns
    -------
    direction : (L,) float64
        [degrees].
    distance : (L,) float64
        As a share of it; infinite of distant lights.
    """
    best = solution.joint
    strength, direction = np.linalg.norm(best.vectors, axis=1), directions(best.lights)
    squares, distance = np.empty((2, len(strength)))
    for k, d in enumerate(direction):
        across = np.eye(3) - np.outer(d, d)
        squares[k] = np.trace(across @ covariance[k, :3, k, :3] @ across) / strength[k] ** 2
        distance[k] = covariance[k, 3, k, 3] / best.lights[k, 3] ** 2 if best.near else np.inf
    for lights in solution.doubtful:
        squares += np.linalg.norm(np.cross(direction, directions(lights)), axis=1) ** 2
        if best.near:
            distance += np.log(lights[:, 3] / best.lights[:, 3]) ** 2
    falloff = float(np.median(np.sqrt(distance))) < FALLOFF
    told = falloff or best.scatter <= SAID_EQUAL or len(best.known.lights)
    if not told and _nearly_flat(direction):
        squares += np.radians(OPEN) ** 2
    elif not told and best.shiny() < MATT and not _few_albedos(best):
        squares += np.radians(GUESSED) ** 2
    if best.mean_misfit() > UNEXPLAINED:
        squares += np.radians(ANYWHERE) ** 2
    return np.degrees(np.minimum(np.sqrt(squares), np.pi / 2)), np.sqrt(distance)


def _few_albedos(joint: Joint) -> bool:
    """Return whether pixels of one hue have about one albedo, which no wrong relief leaves them."""
    relief = joint.relief()
    return relief is not None and relief.albedos < FEW_ALBEDOS


def _nearly_flat(direction: Array) -> bool:
    """Return whether lights lie nearly in one plane or one small cone."""
    spread = np.linalg.svd(direction, compute_uv=False)
    return bool(spread[2] < FLAT * spread[0])


def doubts(solution: Solution, deviation: Array, distance: Array) -> tuple[str, ...]:
    """Return in words what the photographs leave open, by the deviations of :func:`deviations`."""
    joint, words, falloff = solution.joint, [], float(np.median(distance)) < FALLOFF
    flat = _nearly_flat(directions(joint.lights))
    if flat:
        words.append(
            "the lights lie nearly in one plane or one small cone; hold the lamp in more places around the camera"
        )
    if joint.mean_misfit() > UNEXPLAINED:
        words.append(
            "what was found does not explain the photographs: they are too dark, noisy or mirror-like, "
            "or not all of one object that stood still; look at the report"
        )
    if joint.shiny() < MATT and not falloff:
        words.append("there are no highlights; the relief's height rests on outline, strengths and albedos alone")
    if not joint.outline.rim.any() and not falloff:
        words.append(
            "the object's outline is not in the picture; the relief's height rests on strengths, highlights and albedos"
        )
    if solution.nearer < NEARER and not flat:
        words.append("the lamps seem to stand near the object; take them for near ones, --lamps near")
    if joint.near and not falloff:
        words.append(
            "the lamps' distances are hardly known: they are far, or photographs are few; take them for distant"
        )
    if deviation.mean() > UNSURE:
        words.append(f"the lights are known to {deviation.mean():.1f} degrees only")
    return tuple(words)
