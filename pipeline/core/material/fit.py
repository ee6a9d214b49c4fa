"""Basis BRDFs as mixtures of closures that all of them share.

Minimised over the lobes and the curves c >= 0 of every basis and colour is ::

    J = sum_k  sum w (f_k cos - f'_k cos)^2 / sum w (f_k cos)^2
             + DIM sum v (f_k cos - f'_k cos)^2 / sum v (f_k cos)^2,      v = w / (1 + f_k cos / mean of f_k cos)

over pairs of directions (:mod:`.quadrature`). The first term is the square of ``material_rel_rms``, which highlights
rule; the second, where relative errors count, keeps the dim rest true: with DIM = .3 the error of cube roots halves on
the worst tenth of 80 measured-like materials, and ``material_rel_rms`` stays where it was. For given lobes J is a
non-negative least squares problem of a few dozen unknowns (Lawson and Hanson 1974) on sums over the pairs; the lobes
are chosen one after the other out of a fine dictionary, then each once more with the others at hand.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..brdf import Brdf
from ..condition import condition, noted
from ..errors import LightsphereError
from ..progress import Progress, Work
from . import MOST_BASES, STOPS, Mixture, stop_shares
from .closures import LEAST_ROUGHNESS, Lobe
from .energy import bounded, reciprocity_error
from .quadrature import directions
from .sums import Sums

DIM = 0.3
WORTH = 0.003  # of material_rel_rms, in the mean over the bases, that one more lobe must take off
HARDLY = 0.002  # of the root of J, that a lobe takes off a basis which does without it
SPECIAL = 1.3  # by how much J must be lower with a lobe that is no ggx lobe: others cost more to render
PROMISING = 6  # lobes of the least J for the mean colour, of which the best for all colours is taken
SWAPS = 2  # passes in which every lobe is chosen once more
VIEWS = (*range(0, 90, 10), 90)  # bounds of the views for which the error is stated by themselves [degrees]
DICTIONARY = {
    "ggx": np.geomspace(LEAST_ROUGHNESS, 1.0, 30),
    "beckmann": np.geomspace(0.1, 0.8, 10),
    "fresnel": np.geomspace(0.1, 1.0, 12),
    "retro": np.geomspace(0.2, 1.0, 7),
    "sheen": np.geomspace(0.1, 1.0, 7),
}
STRETCHED = ("ggx", "beckmann")  # what Cycles turns with a tangent
ASPECTS = (np.arange(-5.0, 6.0), np.array([-0.5, -0.25, 0.25, 0.5]))  # octaves tried, then beside the best; lobes of
TRIED = (0.1, 0.17, 0.28, 0.45, 0.7)  # these roughnesses

Array = NDArray[np.float64]


def fit(brdfs: Sequence[Brdf], lobes: int, fresnel: bool = True) -> Work[Mixture]:
    """Fit basis BRDFs with a diffuse and at most so many other lobes.

    Parameters
    ----------
    brdfs : sequence of K Brdf
    lobes : int
        The most, the diffuse one not counted; the fit stops where one more is not WORTH it.
    fresnel : bool
        Whether lobes that only grey can scale may be used; not where weights carry the colour.

    Yields
    ------
    Progress per lobe.

    Returns
    -------
    Mixture
        No basis returns more light than it receives. Notes: per basis ``material_rel_rms``, ``cube_root_rel_rms``,
        ``reciprocity_error``, ``albedo`` and ``error_by_view``, ``material_rel_rms`` of the views between
        VIEWS; and ``error_by_lobes``, the mean ``material_rel_rms`` with 0, 1, .. ``lobes``
        lobes, before any is chosen again.

    Raises
    ------
    LightsphereError
        For no or too many bases, or one that is black or not finite.
    """
    if not 1 <= len(brdfs) <= MOST_BASES:
        raise LightsphereError(f"{len(brdfs)} basis BRDFs; a material takes 1 to {MOST_BASES}")
    problem = _Problem(brdfs, fresnel)
    yield Progress("fit", 1, lobes + 3, "lobes")
    chosen, errors = [0], [problem.error([0])]
    taken = 0
    for number in range(lobes):
        chosen.append(problem.best(chosen, len(chosen)))
        errors.append(problem.error(chosen))
        taken = number + 1 if errors[taken] - errors[-1] > WORTH else taken
        yield Progress("fit", number + 2, lobes + 3, "lobes")
    chosen = chosen[: 1 + taken]
    for place in [*range(1, len(chosen))] * SWAPS:
        chosen[place] = problem.best(chosen, place)
    yield Progress("fit", lobes + 2, lobes + 3, "lobes")
    order = sorted(chosen)
    mixture = bounded(Mixture(tuple(problem.lobes[i] for i in order), problem.curves(order)))
    mixture = _without_unused(mixture)
    notes = mixture.notes | problem.figures(mixture) | {"error_by_lobes": errors}
    notes["condition"] = {"curves of a basis": noted(problem.conditions(order))}
    return Mixture(mixture.lobes, mixture.curves, notes)


def dictionary(aspect: float, fresnel: bool) -> list[Lobe]:
    """Return the lobes to choose from, the diffuse one first; those that can be are stretched, too, by an aspect."""
    lobes = [Lobe("diffuse")]
    for kind, roughnesses in DICTIONARY.items():
        if kind == "fresnel" and not fresnel:
            continue
        aspects = {1.0, aspect} if kind in STRETCHED else {1.0}
        lobes += [Lobe(kind, float(r), a) for a in sorted(aspects) for r in roughnesses]
    return lobes


class _Problem:
    """The columns of every lobe and stop at the pairs, and what is asked of them."""

    def __init__(self, brdfs: Sequence[Brdf], fresnel: bool) -> None:
        isotropic = all(brdf.isotropic for brdf in brdfs)
        self.pairs = directions(isotropic)
        cosine = self.pairs.wi[:, 2, None]
        self.wanted = [brdf.evaluate(self.pairs.wi, self.pairs.wo) * cosine for brdf in brdfs]
        for number, values in enumerate(self.wanted):
            if not np.isfinite(values).all() or not (values > 0).any():
                raise LightsphereError(f"basis BRDF {number + 1} is black or not finite; look at its table")
        self._set(dictionary(1.0 if isotropic else self._aspect(), fresnel))

    def _aspect(self) -> float:
        """Return the aspect alpha_y / alpha_x at which a few lobes of different roughness explain the bases best."""
        costs: dict[float, float] = {}
        for octaves in ASPECTS:
            nearest = np.log2(min(costs, key=costs.__getitem__)) if costs else 0.0
            for aspect in map(float, 2.0 ** (nearest + octaves)):
                self._set([Lobe("diffuse"), *(Lobe("ggx", r, aspect) for r in TRIED)])
                everything = _unknowns(range(len(self.lobes)))
                costs[aspect] = sum(sums.mean_colour(everything) for sums in self.sums)
        return min(costs, key=costs.__getitem__)

    def _set(self, lobes: list[Lobe]) -> None:
        """Let lobes be those to choose from."""
        self.lobes = lobes
        share = stop_shares(self.pairs.wo[:, 2])
        columns = [lobe.evaluate(self.pairs.wi, self.pairs.wo)[:, None] * share for lobe in lobes]
        self.columns = np.concatenate(columns, axis=1)
        self.sums = [self._sums(values) for values in self.wanted]

    def best(self, chosen: list[int], place: int) -> int:
        """Return the lobe of the least J at a place of the list, the others as they are."""
        others = chosen[:place] + chosen[place + 1 :]
        free = [i for i in range(1, len(self.lobes)) if i not in others]
        for colours, kept in ((False, PROMISING), (True, 1)):
            costs = {i: self._cost([*others, i], colours) for i in free}
            free = sorted(free, key=costs.__getitem__)[:kept]
        return free[0]

    def _cost(self, chosen: list[int], colours: bool) -> float:
        """Return the least J with a list of lobes, the last of which must pay for being special."""
        if colours:
            least = sum(self._solved(number, chosen)[0] for number in range(len(self.sums)))
        else:
            least = sum(sums.mean_colour(_unknowns(chosen)) for sums in self.sums)
        return least * (1.0 if self.lobes[chosen[-1]].kind == "ggx" else SPECIAL)

    def _solved(self, number: int, chosen: list[int]) -> tuple[float, Array]:
        """Return the least J of one basis, and its curves (L, J, 3)."""
        grey = np.repeat([self.lobes[i].kind == "fresnel" for i in chosen], len(STOPS))
        least, found = self.sums[number].colours(_unknowns(chosen), grey)
        return least, found.reshape(len(chosen), len(STOPS), 3)

    def error(self, chosen: list[int]) -> float:
        """Return the mean of material_rel_rms over the bases."""
        errors = []
        for number, true in enumerate(self.wanted):
            found = self._solved(number, chosen)[1].reshape(-1, 3)
            errors.append(self.pairs.relative_rms(self.columns[:, _unknowns(chosen)] @ found, true))
        return float(np.mean(errors))

    def curves(self, chosen: list[int]) -> Array:
        """Return the best curves (K, L, J, 3), those of fresnel lobes grey and at most 1.

        A lobe that hardly serves a basis has no curve there: it costs nothing where it is not.
        """
        found = np.zeros((len(self.sums), len(chosen), len(STOPS), 3))
        for number in range(len(self.sums)):
            used = list(range(len(chosen)))
            best, curves = self._solved(number, chosen)
            while len(used) > 1:
                trials = [self._solved(number, [chosen[i] for i in used if i != left]) for left in used]
                least = int(np.argmin([cost for cost, _ in trials]))
                if np.sqrt(trials[least][0]) > np.sqrt(best) + HARDLY:
                    break
                curves = trials[least][1]
                used.pop(least)
            found[number, used] = curves
        return found

    def conditions(self, chosen: list[int]) -> Array:
        """Return the condition number of every basis' equations for its curves (K,)."""
        return np.array([float(condition(sums.equations(_unknowns(chosen)))) for sums in self.sums])

    def figures(self, mixture: Mixture) -> dict[str, list[Any]]:
        """Return the errors of every basis."""
        found = mixture.evaluate(self.pairs.wi, self.pairs.wo)
        pairs = [(found[:, k], true) for k, true in enumerate(self.wanted)]
        angles = np.degrees(np.arccos(np.minimum(self.pairs.wo[:, 2], 1.0)))
        views = [self.pairs.select((angles >= low) & (angles < high)) for low, high in itertools.pairwise(VIEWS)]
        return {
            "error_by_view": [[part.relative_rms(a[where], b[where]) for where, part in views] for a, b in pairs],
            "material_rel_rms": [self.pairs.relative_rms(a, b) for a, b in pairs],
            "cube_root_rel_rms": [self.pairs.relative_rms(np.cbrt(a), np.cbrt(b)) for a, b in pairs],
            "reciprocity_error": reciprocity_error(mixture, self.pairs).tolist(),
        }

    def _sums(self, values: Array) -> Sums:
        weight, grey = self.pairs.weight, values.mean(axis=1)
        dim = weight / (1 + grey * weight.sum() / (weight * grey).sum())
        total = weight / (weight[:, None] * values**2).sum() + DIM * dim / (dim[:, None] * values**2).sum()
        weighted = self.columns * total[:, None]
        values = np.concatenate([values, grey[:, None]], axis=1)
        return Sums(weighted.T @ self.columns, weighted.T @ values, (total[:, None] * values**2).sum(axis=0))


def _without_unused(mixture: Mixture) -> Mixture:
    """Leave out closures that no basis has; the diffuse one stays."""
    used = mixture.curves.any(axis=(0, 2, 3))
    used[0] = True
    lobes = tuple(lobe for lobe, wanted in zip(mixture.lobes, used, strict=True) if wanted)
    return Mixture(lobes, mixture.curves[:, used], mixture.notes)


def _unknowns(chosen: Sequence[int]) -> NDArray[np.int64]:
    return (np.asarray(chosen)[:, None] * len(STOPS) + np.arange(len(STOPS))).ravel()
