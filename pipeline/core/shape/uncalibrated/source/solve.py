"""The alternation: surface, normals, albedo, lights and materials in turn until the sum hardly falls."""

from __future__ import annotations

from ....progress import Progress, Work, retold
from ..descent import Problem
from .lights import strengthen, turn
from .materials import albedo, fit, project, split
from .normals import search
from .start import begun, first_lights
from .state import State

ROUNDS = 60  # at most
SETTLED = 2e-3  # share of the sum by which a round has to lower it
ANGLES = (0.3, 0.15, 0.07, 0.035, 0.015)  # by which normals turn [rad]


def solve(problem: Problem) -> Work[list[State]]:
    """Alternate from the source's first lights and from those of a dome over the outline; return the ends, best first.

    Raises
    ------
    LightsphereError
        When the pictures leave nothing to start from.
    """
    starts = [begun(problem, lights) for lights in first_lights(problem)]
    for number, state in enumerate(starts):
        yield from _counted(alternate(state, problem.bases), number * ROUNDS, len(starts) * ROUNDS)
    return sorted(starts, key=lambda state: state.course[-1][1])


def alternate(state: State, bases: int) -> Work[None]:
    """Lower the sum until a round does so by less than two thousandths."""
    albedo(state)
    state.noted("start")
    for done in range(ROUNDS):
        before, count = state.course[-1][1], len(state.widths)
        lay(state)
        for angle in ANGLES:
            turn_normals(state, angle)
            turn(state)
        state.noted("normals")
        albedo(state)
        state.noted("albedo")
        turn(state)
        strengthen(state)
        state.noted("lights")
        if count < bases:
            split(state)
        fit(state)
        turn(state)
        project(state)
        state.levelled()
        state.noted("materials")
        yield Progress("lights", done + 1, ROUNDS, "rounds")
        if state.course[-1][1] > (1.0 - SETTLED) * before and len(state.widths) == count:
            break


def _counted(work: Work[None], before: int, total: int) -> Work[None]:
    yield from retold(work, lambda step: Progress("lights", before + step.done, total, "rounds"))


def lay(state: State) -> None:
    """Lay the surface through the normals."""
    state.unknown = state.surface.fitted(state.unknown, state.normals)
    state.noted("surface")


def turn_normals(state: State, angle: float) -> None:
    """Search for better normals an angle [rad] away."""
    state.normals, state.albedo = state.normals.copy(), state.albedo.copy()
    search(*state.given(), angle, state.normals, state.albedo)
