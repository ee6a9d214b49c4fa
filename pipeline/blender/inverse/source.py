"""The source's own search, to compare with: ratios, least squares on one picture, and fixed thresholds.

Boivin and Gagalowicz 2001: a reflectance is corrected by the ratio of the photograph to a render until it settles
(equation 4); what is left over decides by thresholds which model is tried next. The source's renders have no noise to
speak of; here they are denoised. Read into it: which of its four thresholds ends which level.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...core.errors import LightsphereError
from ...core.inverse import BECKMANN, FREE, InverseSettings, Model, moved, thresholds
from ...core.inverse.photograph import Photograph
from ...core.inverse.texture import reflectance_map, sharpened
from ...core.progress import Work
from .found import Found
from .levels import Tried
from .room import Room
from .solve import Search

Array = NDArray[np.float64]
RATIO_ROUNDS, SETTLED = 8, 0.01  # of correction by ratios; change of any reflectance at which they end
SAMPLES = 16  # a pixel of a denoised picture
ROUNDS = 4  # of looking for levels


class Source(Search):
    """The source's search in a room for what a photograph shows; no error bars, for it has no account of noise.

    Raises
    ------
    LightsphereError
        For lamps of unknown power, and thresholds that are none.
    """

    distributions = (BECKMANN,)  # the nearest to Ward's lobe
    scanned = ()  # the photograph's direction alone
    untried = ("plastic",)

    def __init__(self, room: Room, photograph: Photograph, settings: InverseSettings) -> None:
        super().__init__(room, photograph, settings)
        if settings.unknown_lamps:
            raise LightsphereError(
                "the source's method takes all lamps as known; leave --method source out to find them"
            )
        self.limits = thresholds(settings.thresholds)
        self.texels: dict[int, Array] = {}  # (P, 3) of groups with a texture

    def run(self) -> Work[Found]:
        """Search until no level changes or the budget is reached.

        Yields
        ------
        Progress in seconds of the budget.
        """
        yield from self._correct("diffuse")
        for _ in range(ROUNDS):
            changed = yield from self._escalate()
            if not changed or self._spent() > 1:
                break
            yield from self._correct("refine")
        return self._found()

    def _shown(self) -> Array:
        evidence = self.evidence
        return self.room.render(evidence.samples(SAMPLES), evidence.next_seed(), denoised=True)

    def _correct(self, stage: str) -> Work[None]:
        """Correct what each group reflects by the ratio of photograph to render; lobes stay as they were fitted."""
        for _ in range(RATIO_ROUNDS):
            shown, farthest = self._shown(), 0.0
            for number, model in enumerate(self.room.models):
                if not self.masks[number].any() or number in self.room.known:
                    continue
                if model.level == "texture":
                    self._paint_by_ratio(number, shown)
                elif len(FREE[model.level]) == 1:
                    ratio = np.log(self.evidence.ratio(shown, number))
                    self.room.show(number, moved(model, FREE[model.level][0], ratio))
                    farthest = max(farthest, float(np.abs(ratio).max()))
            self._note_picture(stage, shown)
            yield self._step(stage)
            if farthest < SETTLED or self._spent() > 1:
                break

    def _escalate(self) -> Work[bool]:
        """Look for the level of every group whose error is above the first threshold; return whether one changed."""
        shown, evidence = self._shown(), self.evidence
        squares = evidence.weight * (evidence.photograph - shown) ** 2
        before = [model.level for model in self.room.models]
        for number, mask in enumerate(self.masks):
            settled = not mask.any() or number in self.room.known or before[number] == "texture"
            if settled or np.sqrt(squares[mask].mean()) <= self.limits[0] or self._spent() > 1:
                continue
            paints = bool(self.room.layers[number]) and self.settings.levels == "all"
            choose = partial(self._chosen, paints=paints)
            model = yield from self._examined(number, choose, denoised=True)
            if model.level == "texture":  # begins with what was shown, one reflectance for all
                self.texels[number] = np.tile(self.room.models[number].diffuse, (int(mask.sum()), 1))
            self._choose_better(number, model)
            if model.level == "texture":
                self._paint_by_ratio(number, shown)
        self._note_picture("levels", self._shown())
        return before != [model.level for model in self.room.models]

    def _chosen(self, tried: list[Tried], paints: bool) -> Tried:
        """Return the first level whose error is below its threshold, else a texture where that can be, or the best."""
        simple, mirror_most, lobes, texture = self.limits
        errors = {one.model.level: one.as_json()["error"] for one in tried}
        for one in tried:
            error = errors[one.model.level]
            if one.model.level in ("diffuse", "perfect-mirror", "mirror"):
                good = error < simple
            else:
                good = error < lobes and not (one.model.level == "diffuse-specular" and errors["mirror"] > mirror_most)
            if good:
                return one
        best = min(tried, key=lambda one: errors[one.model.level])
        if paints and errors[best.model.level] > texture:
            return Tried(Model("texture", np.ones(3), np.zeros(3)), best.fit)
        return best

    def _paint_by_ratio(self, number: int, shown: Array) -> None:
        """Correct every texel by the ratio of photograph to render."""
        mask = self.masks[number]
        self.texels[number] = sharpened(self.texels[number], self.evidence.photograph[mask], shown[mask])
        self.room.paint(number, reflectance_map(self.texels[number], self.evidence.uv[mask]))

    def _note_picture(self, stage: str, shown: Array) -> None:
        missing = self.evidence.photograph - shown
        self._note(stage, np.stack([missing, missing]))
        self.pictures[stage] = shown
