"""All unknowns together: normals, weights of the bases, lights and the bases' lobes, by Levenberg and Marquardt.

Alternating between lights and the rest hardly moves the lights, for normals follow wrong lights; a step over all of
them at once does (:mod:`.equations`). Minimised is the robust misfit of the pictures and, weighed by how well the
pictures are explained, what else is known: that strengths are alike, that normals at the outline stand across the
view, and that normals are those of one surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import integrability
from .equations import certainties, eliminate, foresee, foreseen_costs, turn_normals
from .outline import Outline
from .start import mean_strength_one

Array = NDArray[np.float64]

DAMPING = (1e-2, 1e-5)  # first, and least
CALMER, BOLDER = 6.0, 0.25  # the damping's change after a step that failed, or did not
PARTS = 4  # of the pixels that are summed by themselves
HELD = 6  # times that coefficients are held at zero anew in a step
RIM_ALONG, RIM_ACROSS = 0.1, 0.15  # deviations of a rim's normal from the outline's, and from the dome's slant
RIM_OUTLYING = 2.0  # such deviations beyond which the rim is no rim
CORRELATED = 10.0  # values whose misfits go together: other cues weigh by so much more
CURL_TRUST = 0.1  # of the normals' integrability: its misfits go together over the whole surface
OPEN = 1.0  # scatter of strengths that are not believed to be alike
RIDGE = 1e-9
CUES = frozenset(("rim", "surface", "strengths"))


@dataclass
class Joint:
    """The state of the minimisation.

    Parameters
    ----------
    values, lit, usual, noise, views : (P, L, 3), (P, L), (P,), float, (P, 3)
        What the pixels see, how much of it can be used, their usual value, the values' noise, and whence they see it.
    outline : Outline
        Of the P pixels.
    normals, weights, lights, coefficients : (P, 3), (P, K), (L, 3), (K, J, 3)
    scatter : float
        Standard deviation of the logarithm of the lights' strengths, as far as it is known.
    believes : frozenset of str
        Which cues beside the pictures count, of :data:`CUES`.
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
    believes: frozenset[str] = CUES

    def __post_init__(self) -> None:
        pixels, count = self.lit.shape
        bases, functions, colours = self.coefficients.shape
        self.damping = DAMPING[0]
        self.certainty, self.misfit = np.empty((2, pixels, count))
        self.cues = np.stack([self.outline.along, self.views], axis=1)
        self.targets = np.stack([np.zeros(pixels), (self.outline.dome * self.views).sum(axis=1)], axis=1)
        self.trust = np.zeros((pixels, 2))
        self.shared = 3 * count + bases * functions * colours
        self.surface = (np.zeros((0, 3 * count)), np.zeros(0))
        self.belief = 0.0

    def weigh(self) -> None:
        """Estimate anew how much every value counts, and every cue beside the values; fix the free scales."""
        mean = self.weights.mean(axis=0)
        mean[mean <= 0] = 1.0
        self.weights = self.weights / mean
        self.coefficients = self.coefficients * mean[:, None, None]
        level = np.linalg.norm(self.lights[0])
        self.lights = mean_strength_one(self.lights)
        self.weights = self.weights * (level / np.linalg.norm(self.lights[0]))
        certainties(
            self.values, self.usual, self.noise, self.lit, self.views, self.normals, self.weights, self.lights,
            self.coefficients, self.certainty, self.misfit,
        )  # fmt: skip
        self.trust[:] = 0.0
        self.surface = (self.surface[0][:0], self.surface[1][:0])
        free = 3 * (self.certainty > 0).sum() - self.normals.shape[0] * (2 + self.weights.shape[1])
        self.belief = CORRELATED * float(self._pixel_costs().sum()) / max(free, 1)
        deviations = np.array([RIM_ALONG, RIM_ACROSS])
        off = (self.targets - np.einsum("pmi,pi->pm", self.cues, self.normals)) / deviations
        trust = self.belief / deviations**2 / (1.0 + (off / RIM_OUTLYING) ** 2) ** 2
        self.trust[:] = np.where(self.outline.rim[:, None] & ("rim" in self.believes), trust, 0.0)

    def believe_surface(self, mask: NDArray[np.bool_], rays: Array, pinhole: bool) -> None:
        """Take up that the normals are those of one surface, linearised where they are; after :meth:`weigh`."""
        if "surface" not in self.believes:
            return
        matrix, target = integrability.cue(mask, rays, self.normals, self.lights, pinhole)
        weight = np.sqrt(CURL_TRUST * self.belief)
        self.surface = (weight * matrix, weight * target)

    def cost(self) -> float:
        """Return what is minimised, as it is weighed now."""
        off = self.surface[1] - self.surface[0] @ self.lights.ravel()
        return float(self._pixel_costs().sum() + self._strengths()[0] + (off**2).sum())

    def objective(self) -> float:
        """Return the robust cost that weighted costs stand for, comparable between starts; just after :meth:`weigh`."""
        off = (self.targets - np.einsum("pmi,pi->pm", self.cues, self.normals)) / [RIM_ALONG, RIM_ACROSS]
        rim = (off**2 / (1.0 + (off / RIM_OUTLYING) ** 2))[self.outline.rim]
        beside = self.surface[1] - self.surface[0] @ self.lights.ravel()
        return float(self.misfit.sum() + self.belief * rim.sum() + self._strengths()[0] + (beside**2).sum())

    def step(self) -> bool:
        """Go a step down, or become calmer; return whether it went."""
        before = (self.normals, self.weights, self.lights, self.coefficients, self.cost())
        system, right, factors, reduced, pixels_right = self._eliminated()
        shared = self._solved(system, right)
        lights = 3 * len(self.lights)
        own = pixels_right - np.einsum("pig,g->pi", reduced, shared)
        own = np.linalg.solve(np.tril(factors).swapaxes(1, 2), own[..., None])[..., 0]
        self.normals = self.normals.copy()
        turn_normals(own, self.views, self.normals)
        self.weights = np.maximum(self.weights + own[:, 2:], 0.0)
        self.lights = self.lights + shared[:lights].reshape(-1, 3)
        self.coefficients = np.maximum(self.coefficients + shared[lights:].reshape(self.coefficients.shape), 0.0)
        if self.cost() < before[4]:
            self.damping = max(self.damping * BOLDER, DAMPING[1])
            return True
        self.normals, self.weights, self.lights, self.coefficients = before[:4]
        self.damping *= CALMER
        return False

    def gloss(self) -> float:
        """Return the share of the light of the pictures that the lobes explain and the Lambertian part does not.

        Lobes that no value reaches have no share, however large their coefficients.
        """
        everything, matt = np.empty((2, *self.values.shape))
        lambertian = self.coefficients * (np.arange(self.coefficients.shape[1]) == 0)[:, None]
        for coefficients, light in ((self.coefficients, everything), (lambertian, matt)):
            foresee(self.views, self.normals, self.weights, self.lights, coefficients, light)
        sure = self.certainty[..., None]
        return 1.0 - float((sure * matt).sum() / max((sure * everything).sum(), 1e-300))

    def light_covariance(self) -> Array:
        """Return the covariance (3 L, 3 L) of the lights that the misfit and the curvature of the cost give."""
        damping, self.damping = self.damping, DAMPING[1]
        system = self._eliminated()[0]
        self.damping = damping
        free = np.diag(system) > RIDGE * np.diag(system).max()
        free[3 * len(self.lights) :] &= self.coefficients.ravel() > 0
        count = 3 * len(self.lights)
        inverse = np.linalg.pinv(system[np.ix_(free, free)], hermitian=True)
        return np.asarray(self.belief * inverse[:count, :count])

    def _eliminated(self) -> tuple[Array, Array, Array, Array, Array]:
        pixels, own, total = len(self.normals), 2 + self.weights.shape[1], self.shared
        factors, reduced = np.empty((pixels, own, own)), np.empty((pixels, own, total))
        right = np.empty((pixels, own))
        system, gradient = np.zeros((PARTS, total, total)), np.zeros((PARTS, total))
        eliminate(
            self.values, self.certainty, self.views, self.cues, self.targets, self.trust, self.normals, self.weights,
            self.lights, self.coefficients, self.damping, factors, reduced, right, system, gradient,
        )  # fmt: skip
        matrix, vector = system.sum(axis=0), gradient.sum(axis=0)
        lights = 3 * len(self.lights)
        matrix[lights:, :lights] = matrix[:lights, lights:].T
        _, strength_matrix, strength_right = self._strengths()
        matrix[:lights, :lights] += strength_matrix + self.surface[0].T @ self.surface[0]
        vector[:lights] += strength_right + self.surface[0].T @ (
            self.surface[1] - self.surface[0] @ self.lights.ravel()
        )
        diagonal = np.diag(matrix).copy()
        matrix[np.diag_indices(total)] += self.damping * diagonal + RIDGE * diagonal.max()
        flat = reduced.reshape(-1, total)
        return matrix - flat.T @ flat, vector - flat.T @ right.ravel(), factors, reduced, right

    def _solved(self, system: Array, right: Array) -> Array:
        """Return the step of the shared unknowns; coefficients at zero that want below it are held."""
        lights = 3 * len(self.lights)
        now = self.coefficients.ravel()
        held = np.zeros(len(right), bool)
        held[lights:] = (now <= 0) & (right[lights:] <= 0)
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

    def _strengths(self) -> tuple[float, Array, Array]:
        """Return cost, matrix and right side of the strengths' being alike."""
        strength = np.linalg.norm(self.lights, axis=1)
        weight = self.belief / (self.scatter if "strengths" in self.believes else OPEN) ** 2
        slope = np.zeros((len(strength), 3 * len(strength)))
        for k, light in enumerate(self.lights / strength[:, None] ** 2):
            slope[k, 3 * k : 3 * k + 3] = light
        off = np.log(strength)
        return float(weight * (off**2).sum()), weight * slope.T @ slope, -weight * slope.T @ off

    def _pixel_costs(self) -> Array:
        costs = np.empty(len(self.normals))
        foreseen_costs(
            self.values, self.certainty, self.views, self.cues, self.targets, self.trust, self.normals, self.weights,
            self.lights, self.coefficients, costs,
        )  # fmt: skip
        return costs
