"""What the alternation finds of lights and of every pixel."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ....compare.shapes import angles_deg
from ....errors import LightsphereError
from ....progress import Progress, Work
from ..certainty import UNSURE
from ..descent import Problem
from ..found import Found
from ..known import CUES
from ..scales import Scale, finer
from .lobe import tables
from .materials import project
from .normals import stiffnesses
from .solve import ANGLES, lay, solve, turn_normals
from .start import SMOOTHNESS
from .state import State
from .surface import triangulated

ROUNDS = 2  # over the pixels of every scale
LEAST_APART = 1.0  # of two ends' lights [degrees]: what has the same valley may be off by as much


def alternated(problem: Problem, scales: Sequence[Scale]) -> Work[Found]:
    """Return what the alternation finds.

    A light's deviation is how far the ends lie apart. The sum leaves the relief nearly as it began, so that curvature
    tells nothing.

    Raises
    ------
    LightsphereError
        For near lights, a choice of cues, or when the pictures leave nothing to start from.
    """
    if problem.near:
        raise LightsphereError("the source's objective takes lights for distant; leave it or --lamps near out")
    if problem.known.cues != set(CUES):
        raise LightsphereError("the source's objective has cues of its own; leave it or --cues out")
    ends = yield from solve(problem)
    best = ends[0]
    state = yield from _every_pixel(scales, best)
    stiffness = np.empty(len(state.normals))
    stiffnesses(*state.given(), state.normals, stiffness)
    matt = np.pi * state.albedo[:, None]
    weights = np.concatenate([matt, state.weights[..., None] * state.tints], axis=1)
    used = np.maximum((state.pictures.lit > 0).sum(axis=1), 1)
    cost = state.value_costs().sum(axis=1)
    spread = np.sqrt(2.0 * cost / np.maximum(used - 2, 1) / np.maximum(stiffness, 1e-12))
    apart = angles_deg(best.directions, ends[1].directions)
    direction = np.minimum(np.hypot(LEAST_APART, apart), 90.0)
    words = (
        f"the source's alternation leaves the relief as it began; lights are known to {direction.mean():.1f} degrees"
    )
    return Found(
        end=None,
        lights=best.directions * best.strengths[:, None],
        centre=np.zeros(3),
        offsets=np.zeros_like(state.normals),
        normals=state.normals,
        weights=weights,
        table=tables(state.widths),
        misfit=cost / used,
        normal_deviation=np.minimum(spread, np.pi / 2),
        deviations=(direction, np.full(len(direction), np.inf)),
        doubts=(words,) if direction.mean() > UNSURE else (),
        notes={
            "costs": [end.course[-1][1] for end in ends],
            "objective": [cost for _, cost in best.course],
            "steps": _falls(best),
            "cues": ["outline", "highlights"],
        },
    )


def _falls(state: State) -> dict[str, float]:
    """Return by how much each kind of step lowered the sum."""
    falls: dict[str, float] = {}
    for (_, before), (step, after) in pairwise(state.course):
        falls[step] = falls.get(step, 0.0) + before - after
    return falls


def _every_pixel(scales: Sequence[Scale], state: State) -> Work[State]:
    """Return the state of the finest scale's pixels, under the same lights."""
    total, done, coarse = sum(len(scale.pictures.values) for scale in scales), 0, scales[0]
    for scale in scales:
        columns = [state.normals, state.albedo, state.weights, state.unknown[:, None]]
        values = finer(coarse, scale, np.concatenate(columns, axis=1))
        normals, albedo, weights, unknown = np.split(values, [3, 6, 6 + len(state.widths)], axis=1)
        state = dataclasses.replace(
            state,
            pictures=scale.pictures,
            surface=triangulated(scale.pictures, SMOOTHNESS),
            highlights=finer(coarse, scale, state.highlights),
            normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
            albedo=np.ascontiguousarray(albedo),
            weights=np.ascontiguousarray(weights),
            unknown=unknown[:, 0],
            course=[],
        )
        for _ in range(ROUNDS):
            lay(state)
            for angle in ANGLES[1:]:
                turn_normals(state, angle)
            project(state)
        done, coarse = done + len(scale.pictures.values), scale
        yield Progress("normals", done, total, "pixels")
    return state
