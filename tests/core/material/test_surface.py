"""A reflectance as closures: every texel keeps its own BRDF, whatever stands beside it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.material.surface import Surface, surface
from pipeline.core.progress import finish
from pipeline.core.reflectance.bivariate import Bivariate
from pipeline.core.rig import hemisphere
from pipeline.core.shape.photometric.start import lobes

ALBEDO, GLOSS = np.array([0.5, 0.3, 0.1]), np.array([0.2, 0.2, 0.25])


def recovered(weights: NDArray[np.float64]) -> Bivariate:
    """One basis, matt with a lobe, of which texels (N,) have so much."""
    table = (lobes(0.35) * np.stack([ALBEDO, GLOSS])).sum(axis=2, keepdims=True)
    maps = weights.astype(np.float32).reshape(1, -1, 1, 1)
    return Bivariate(table, np.ones(table.shape[:3]), maps, np.zeros(maps.shape[:2], np.float32))


def reflected(made: Surface) -> NDArray[np.float64]:
    """f cos(theta_i) of every texel under lights around, from above, (N, L, 3)."""
    wi = hemisphere(60)
    bases = made.mixture.evaluate(wi, np.broadcast_to([0.0, 0.0, 1.0], wi.shape))
    return np.einsum("nk,lkc->nlc", made.weights[0, :, :, 0], bases)


@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e3])
def test_one_wrong_texel_changes_no_other(unit: float) -> None:
    """The weights' unit is the basis's own: both are known up to a factor."""
    weights = np.random.default_rng(1).uniform(0.5, 1, 200)
    planted = recovered(weights)
    planted.table[:] /= unit
    planted.weights[:] *= unit
    alone = reflected(finish(surface(planted, 2)))
    truth = recovered(weights).basis(0)
    wi = hemisphere(60)
    f_cos = truth.evaluate(wi, np.broadcast_to([0.0, 0.0, 1.0], wi.shape)) * wi[:, 2:]
    np.testing.assert_allclose(alone, weights[:, None, None] * f_cos, rtol=0.1, atol=0.02 * f_cos.max())
    planted.weights[0, 0] *= 4000
    beside = finish(surface(planted, 2))
    np.testing.assert_allclose(reflected(beside)[1:], alone[1:], rtol=0.02)
    assert 0.5 < beside.weights[0, 1:].max() < 2  # full is the usual weight, not the wrong one


def test_a_basis_of_few_texels_is_not_lost() -> None:
    weights = np.full(1000, 1e-3)
    weights[:5] = 1.0
    made = finish(surface(recovered(weights), 2))
    np.testing.assert_allclose(made.weights[0, :5], 1.0)
