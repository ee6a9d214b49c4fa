"""All unknowns together: normals, weights of the bases, lights and the bases' lobes, by Levenberg and Marquardt.

Alternating between lights and the rest hardly moves the lights, for normals follow wrong lights; a step over all of
them at once does (:mod:`.equations`). Minimised is the robust misfit of the pictures and, weighed by how well the
pictures are explained, what else is known: that strengths are alike, that normals at the outline stand across the
view, and that normals are those of one surface.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...condition import condition
from . import integrability
from .albedo import Relief, least_entropy
from .equations import certainties, eliminate, foresee, foreseen_costs, turn_normals
from .known import Known
from .lamps import held_apart
from .outline import Outline
from .start import mean_strength_one

Array = NDArray[np.float64]

DAMPING = (1e-2, 1e-5)  # first, and least
CALMER, BOLDER = 6.0, 0.25  # the damping's change after a step that failed, or did not
PARTS = 4  # of the pixels that are summed by themselves
HELD = 6  # times that coefficients are held at zero anew in a step
RIM_ALONG, RIM_ACROSS = 0.1, 0.15  # deviations of a rim's normal from the outline's, and from the dome's slant
PROXY = 0.2  # deviation of a rough mesh's normals along each axis
OUTLYING = 2.0  # such deviations beyond which the rim is no rim, and the mesh is wrong
LIGHT = 0.01  # deviation of a known light's direction [rad]
CORRELATED = 10.0  # values whose misfits go together: other cues weigh by so much more
LEAST_BELIEF = 1e-3  # of other cues: as if no picture were explained better than to some two per mille
ALIKE = 100.0  # the same, for how far lights can be off: a wrong lobe is wrong over all of a highlight
CURL_TRUST = 0.1  # of the normals' integrability: its misfits go together over the whole surface
ALBEDO_TRUST = 0.3  # of the albedos' being few, for the same reason
HIGHLIGHT = 0.3  # share of the Lambertian part that lobes add where there is a highlight to speak of
OPEN = 1.0  # scatter of strengths that are not believed to be alike
RIDGE = 1e-9


@dataclass
class Joint:
    """The state of the minimisation.

    Parameters
    ----------
    values, lit, usual, noise, views : (P, L, 3), (P, L), (P,), float, (P, 3)
        What the pixels see, how much of it can be used, their usual value, the values' noise, and whence they see it.
    outline : Outline
        Of the P pixels.
    normals, weights, lights, coefficients : (P, 3), (P, K), (L, N), (K, J, 3)
        Lights are as in :mod:`.lamps`.
    scatter : float
        Standard deviation of the logarithm of the lights' strengths, or of near ones' powers, as far as it is known.
    known : Known
        Its cues are those that count beside the pictures.
    proxy : (P, 3) float64
        Normals of a rough mesh, NaN where not known.
    """

    values: Array
    lit: Array
    usual: Array
    noise: float
    views: Array
    outline: Outline
    normals: Array
    weights: Array
    lights: Array
    coefficients: Array
    scatter: float
    known: Known
    proxy: Array

    def __post_init__(self) -> None:
        pixels, count = self.lit.shape
        self.damping = DAMPING[0]
        self.centre, self.offsets = np.zeros(3), np.zeros((pixels, 3))
        self.certainty, self.misfit = np.empty((2, pixels, count))
        self._cues()
        self.beside = (np.zeros((0, 3 * count)), np.zeros(0))
        self.never = np.zeros(self.coefficients.shape, bool)
        self.never[:, 1:] = "highlights" not in self.known.cues
        self.coefficients = np.where(self.never, 0.0, self.coefficients)
        self.belief = 0.0

    @property
    def near(self) -> bool:
        """Whether the lights' distances are unknowns, too."""
        return bool(self.lights.shape[1] > 3)

    @property
    def reach(self) -> float:
        """Distance of the object's farthest point from its centre."""
        return float(np.sqrt((self.offsets**2).sum(axis=1).max()))

    @property
    def vectors(self) -> Array:
        """The light (L, 3) of each lamp at the object's centre."""
        return self.lights[:, :3]

    @property
    def lambertian(self) -> Array:
        """The coefficients (K, J, 3) without lobes."""
        return np.asarray(self.coefficients * (np.arange(self.coefficients.shape[1]) == 0)[:, None])

    @property
    def hollow(self) -> bool:
        """Whether normals, all in all, lean inwards, where those of a dome over the mask lean outwards."""
        dome = self.outline.dome
        outwards = dome - (dome * self.views).sum(axis=1, keepdims=True) * self.views
        return bool((self.normals * outwards).sum() < 0.0)

    def twin(self) -> Joint:
        """Return the state that a matt surface seen from afar shows as well: convex for concave."""
        facing = (self.normals * self.views).sum(axis=1, keepdims=True)
        lights = self.lights.copy()
        lights[:, :2] *= -1.0
        return dataclasses.replace(self, normals=2.0 * facing * self.views - self.normals, lights=lights)

    def place(self, points: Array) -> None:
        """Take up where the surface (P, 3) is; near lights' distances count from its mean."""
        self.centre = points.mean(axis=0)
        self.offsets = points - self.centre
        self.lights = held_apart(self.lights, self.offsets)

    def _cues(self) -> None:
        """Arrange what is known of normals: cue . n = target, in units of its deviation, where it counts."""
        pixels = len(self.normals)
        rim = self.outline.rim & ("outline" in self.known.cues)
        slant = (self.outline.dome * self.views).sum(axis=1)
        cues, targets = [self.outline.along, self.views], [np.zeros(pixels), slant]
        counted, deviations = [rim, rim], [RIM_ALONG, RIM_ACROSS]
        if self.known.normals is not None:
            cues += [np.broadcast_to(axis, (pixels, 3)) for axis in np.eye(3)]
            targets += list(np.nan_to_num(self.proxy).T)
            counted += 3 * [np.isfinite(self.proxy).all(axis=1)]
            deviations += 3 * [PROXY]
        self.cues = np.ascontiguousarray(np.stack(cues, axis=1))
        self.targets, self.counted = np.stack(targets, axis=1), np.stack(counted, axis=1)
        self.deviations = np.array(deviations)
        self.trust = np.zeros(self.targets.shape)

    def _off(self) -> Array:
        """Return how far normals are from the cues, in deviations (P, M)."""
        return np.asarray((self.targets - np.einsum("pmi,pi->pm", self.cues, self.normals)) / self.deviations)

    def weigh(self) -> None:
        """Estimate anew how much every value counts, and every cue beside the values; fix the free scales."""
        mean = self.weights.mean(axis=0)
        mean[mean <= 0] = 1.0
        self.weights = self.weights / mean
        self.coefficients = self.coefficients * mean[:, None, None]
        level = np.linalg.norm(self.vectors[0])
        self.lights = np.hstack([mean_strength_one(self.vectors), self.lights[:, 3:]])
        self.weights = self.weights * (level / np.linalg.norm(self.vectors[0]))
        certainties(
            self.values, self.usual, self.noise, self.lit, self.views, self.offsets, self.normals, self.weights,
            self.lights, self.coefficients, self.certainty, self.misfit,
        )  # fmt: skip
        self.trust[:] = 0.0
        free = 3 * (self.certainty > 0).sum() - self.normals.shape[0] * (2 + self.weights.shape[1])
        self.belief = max(CORRELATED * float(self._pixel_costs().sum()) / max(free, 1), LEAST_BELIEF)
        trust = self.belief / self.deviations**2 / (1.0 + (self._off() / OUTLYING) ** 2) ** 2
        self.trust[:] = np.where(self.counted, trust, 0.0)
        self.beside = self._known_lights()

    def believe(self, mask: NDArray[np.bool_], rays: Array, pinhole: bool) -> None:
        """Take up that normals are those of one surface, and albedos those of few paints; after :meth:`weigh`."""
        if "surface" in self.known.cues:
            self._add_beside(CURL_TRUST, *integrability.cue(mask, rays, self.normals, self.vectors, pinhole))
        if relief := self.relief():
            self._add_beside(ALBEDO_TRUST, *relief.cue(self.vectors))

    def relief(self) -> Relief | None:
        """Return the change of the relief that leaves albedos the least entropy, where that is believed and told."""
        if "albedo" not in self.known.cues:
            return None
        return least_entropy(self.weights @ self.coefficients[:, 0], self.usual, self.normals, self.views)

    def _add_beside(self, trust: float, matrix: Array, target: Array) -> None:
        weight = np.sqrt(trust * self.belief)
        self.beside = (np.vstack([self.beside[0], weight * matrix]), np.append(self.beside[1], weight * target))

    def cost(self) -> float:
        """Return what is minimised, as it is weighed now."""
        off = self.beside[1] - self.beside[0] @ self.vectors.ravel()
        return float(self._pixel_costs().sum() + self._strengths()[0] + (off**2).sum())

    def objective(self) -> float:
        """Return the robust cost that weighted costs stand for, comparable between starts; just after :meth:`weigh`."""
        off = self._off()[self.counted] ** 2
        beside = self.beside[1] - self.beside[0] @ self.vectors.ravel()
        cues = self.belief * (off / (1.0 + off / OUTLYING**2)).sum()
        return float(self.misfit.sum() + cues + self._strengths()[0] + (beside**2).sum())

    def step(self) -> bool:
        """Go a step down, or become calmer; return whether it went."""
        before = (self.normals, self.weights, self.lights, self.coefficients, self.cost())
        system, right, factors, reduced, pixels_right = self._equations()
        flat, lights = reduced.reshape(-1, len(right)), self.lights.size  # pixels follow what is shared
        shared = self._solved(system - flat.T @ flat, right - flat.T @ pixels_right.ravel())
        own = pixels_right - np.einsum("pig,g->pi", reduced, shared)
        own = np.linalg.solve(np.tril(factors).swapaxes(1, 2), own[..., None])[..., 0]
        self.normals = self.normals.copy()
        turn_normals(own, self.views, self.normals)
        self.weights = np.maximum(self.weights + own[:, 2:], 0.0)
        self.lights = held_apart(self.lights + shared[:lights].reshape(self.lights.shape), self.offsets)
        self.coefficients = np.maximum(self.coefficients + shared[lights:].reshape(self.coefficients.shape), 0.0)
        if self.cost() < before[4]:
            self.damping = max(self.damping * BOLDER, DAMPING[1])
            return True
        self.normals, self.weights, self.lights, self.coefficients = before[:4]
        self.damping *= CALMER
        return False

    def shiny(self) -> float:
        """Return the share of the pixels that show, of some light, clearly more than the Lambertian part explains.

        Lobes that no value reaches have no share, however large their coefficients.
        """
        everything, matt = self.foreseen(self.coefficients).mean(axis=2), self.foreseen(self.lambertian).mean(axis=2)
        return float(((everything > (1.0 + HIGHLIGHT) * matt) & (self.certainty > 0)).any(axis=1).mean())

    def mean_misfit(self) -> float:
        """Return the mean of Cauchy's cost of the lit values; log 2 where they are off by the width of what counts."""
        return float(self.misfit.sum() / max(self.lit.sum(), 1.0))

    def foreseen(self, coefficients: Array) -> Array:
        """Return what the pixels show (P, L, 3) of bases of some coefficients (K, J, 3); no cast shadows."""
        shown = np.empty(self.values.shape)
        foresee(self.views, self.offsets, self.normals, self.weights, self.lights, coefficients, shown)
        return shown

    def light_covariance(self) -> tuple[Array, float]:
        """Return the covariance (L, N, L, N) of the lights that the misfit and the curvature of the cost give.

        Beside it the condition number of that curvature, over all unknowns that pixels share.
        """
        damping, self.damping = self.damping, DAMPING[1]
        system, _, _, reduced, _ = self._equations()
        flat = reduced.reshape(-1, len(system))
        system = system - flat.T @ flat
        self.damping = damping
        free = np.diag(system) > RIDGE * np.diag(system).max()
        count = self.lights.size
        free[count:] &= self.coefficients.ravel() > 0
        curvature = system[np.ix_(free, free)]
        inverse = np.linalg.pinv(curvature, hermitian=True)[:count, :count].reshape(2 * self.lights.shape)
        return np.asarray(ALIKE / CORRELATED * self.belief * inverse), float(condition(curvature))

    def _equations(self) -> tuple[Array, Array, Array, Array, Array]:
        """Return the shared unknowns' damped system (G, G) and right side, and what :func:`eliminate` fills in."""
        pixels, own, total = len(self.normals), 2 + self.weights.shape[1], self.lights.size + self.coefficients.size
        factors, reduced = np.empty((pixels, own, own)), np.empty((pixels, own, total))
        right = np.empty((pixels, own))
        system, gradient = np.zeros((PARTS, total, total)), np.zeros((PARTS, total))
        eliminate(
            self.values, self.certainty, self.views, self.offsets, self.cues, self.targets, self.trust, self.normals,
            self.weights, self.lights, self.coefficients, self.damping, factors, reduced, right, system, gradient,
        )  # fmt: skip
        matrix, vector = system.sum(axis=0), gradient.sum(axis=0)
        lights = self.lights.size
        matrix[lights:, :lights] = matrix[:lights, lights:].T
        _, strength_matrix, strength_right = self._strengths()
        matrix[:lights, :lights] += strength_matrix
        vector[:lights] += strength_right
        vectors = np.arange(lights).reshape(self.lights.shape)[:, :3].ravel()
        matrix[np.ix_(vectors, vectors)] += self.beside[0].T @ self.beside[0]
        vector[vectors] += self.beside[0].T @ (self.beside[1] - self.beside[0] @ self.vectors.ravel())
        diagonal = np.diag(matrix).copy()
        matrix[np.diag_indices(total)] += self.damping * diagonal + RIDGE * diagonal.max()
        return matrix, vector, factors, reduced, right

    def _solved(self, system: Array, right: Array) -> Array:
        """Return the step of the shared unknowns; coefficients do not step below zero."""
        lights = self.lights.size
        now = self.coefficients.ravel()
        held = np.zeros(len(right), bool)
        held[lights:] = ((now <= 0) & (right[lights:] <= 0)) | self.never.ravel()
        step = np.zeros(len(right))
        for _ in range(HELD):
            free = ~held
            step[:] = 0.0
            step[free] = np.linalg.solve(system[np.ix_(free, free)], right[free])
            below = (now <= RIDGE) & (now + step[lights:] < 0) & ~held[lights:]
            if not below.any():
                break
            held[lights:] |= below
        return step

    def _known_lights(self) -> tuple[Array, Array]:
        """Return equations ``matrix @ s = target``: known lights' parts across their directions are nothing."""
        directions = self.known.directions
        matrix = np.zeros((3 * len(directions), self.vectors.size))
        for row, (number, direction) in enumerate(zip(self.known.lights, directions, strict=True)):
            across = np.eye(3) - np.outer(direction, direction)
            matrix[3 * row : 3 * row + 3, 3 * number : 3 * number + 3] = across
        return np.sqrt(self.belief) / LIGHT * matrix, np.zeros(len(matrix))

    def _strengths(self) -> tuple[float, Array, Array]:
        """Return cost, matrix and right side of the strengths', or of near lights' powers, being alike."""
        strength = np.linalg.norm(self.vectors, axis=1)
        weight = self.belief / (self.scatter if "strengths" in self.known.cues else OPEN) ** 2
        off, slope = np.log(strength), np.zeros((len(strength), *self.lights.shape))
        for k, light in enumerate(self.vectors / strength[:, None] ** 2):
            slope[k, k, :3] = light
        if self.near:  # the light at the centre is a lamp's power times q squared
            q = self.lights[:, 3]
            off = off - 2.0 * (np.log(q) - np.log(q).mean())
            slope[..., 3] = 2.0 * (1.0 / len(q) - np.eye(len(q))) / q
        slope = slope.reshape(len(off), -1)
        return float(weight * (off**2).sum()), weight * slope.T @ slope, -weight * slope.T @ off

    def _pixel_costs(self) -> Array:
        costs = np.empty(len(self.normals))
        foreseen_costs(
            self.values, self.certainty, self.views, self.offsets, self.cues, self.targets, self.trust, self.normals,
            self.weights, self.lights, self.coefficients, costs,
        )  # fmt: skip
        return costs
