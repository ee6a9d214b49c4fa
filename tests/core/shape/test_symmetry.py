"""The azimuth of a normal from the symmetry of its pictures about the plane through view and normal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.core.rig import hemisphere, sphere
from pipeline.core.shape.symmetry import azimuth, frames
from tests import oracles, tolerances

VIEW = np.array([0.0, 0.0, 1.0])
LIGHTS = hemisphere(150)
Array = NDArray[Any]


def normals(count: int = 300) -> Array:
    """Normals 10 to 70 degrees from the view, evenly spread."""
    spread = sphere(8 * count)
    return spread[(spread[:, 2] > np.cos(np.radians(70))) & (spread[:, 2] < np.cos(np.radians(10)))][:count]


def glossy(normal: Array, lights: Array, view: Array) -> Array:
    """f cos(theta_i) of a Lambertian and a GGX lobe, (P, L)."""
    n, wi, wo = normal[:, None], lights[None], np.broadcast_to(view, normal.shape)[:, None]
    return oracles.lambert_cosine(n, wi, 0.3) + 0.2 * oracles.ggx_cosine(n, wi, wo, 0.6)


def errors(found: Array, normal: Array, view: Array) -> Array:
    """Angle between found and true azimuth, times the sine of the angle between view and normal [degrees]."""
    x, y, _ = np.einsum("pij,pi->jp", frames(np.broadcast_to(view, normal.shape)), normal)
    turn = np.degrees(np.abs(np.angle(np.exp(1j * (found - np.arctan2(y, x))))))
    return turn * np.hypot(x, y)


def solved(values: Array, lights: Array = LIGHTS, view: Array = VIEW) -> tuple[Array, Array]:
    return azimuth(values.astype(np.float32), lights, np.broadcast_to(view, (len(values), 3)))


@pytest.fixture(scope="module")
def drawn() -> tuple[Array, Array]:
    return normals(), glossy(normals(), LIGHTS, VIEW)


def test_azimuth_is_found_and_trusted(drawn: tuple[Array, Array]) -> None:
    found, trust = solved(drawn[1])
    error = errors(found, drawn[0], VIEW)
    assert np.median(error) < tolerances.AZIMUTH
    assert np.quantile(error, 0.95) < 5 * tolerances.AZIMUTH
    assert np.median(trust) > 0.5


def test_wrong_lights_are_noticed(drawn: tuple[Array, Array]) -> None:
    tilt = frames(oracles.unit(np.array([0.5, 0.2, 1.0])))
    found, _ = solved(drawn[1], LIGHTS @ tilt.T)
    assert np.median(errors(found, drawn[0], VIEW)) > 50 * tolerances.AZIMUTH
    found, trust = solved(drawn[1], LIGHTS[np.random.default_rng(3).permutation(len(LIGHTS))])
    assert np.median(errors(found, drawn[0], VIEW)) > 50 * tolerances.AZIMUTH
    assert np.quantile(trust, 0.95) < 0.1


def test_view_of_every_pixel_counts() -> None:
    rng = np.random.default_rng(5)
    view = oracles.unit(VIEW + 0.2 * rng.uniform(-1, 1, (300, 3)))
    values = glossy(normals(), LIGHTS, view)
    assert np.median(errors(solved(values, view=view)[0], normals(), view)) < tolerances.AZIMUTH
    assert np.median(errors(solved(values)[0], normals(), VIEW)) > 5 * tolerances.AZIMUTH


def test_brushed_surface_is_not_symmetric(drawn: tuple[Array, Array]) -> None:
    normal, values = drawn
    half = oracles.unit(LIGHTS + VIEW)
    along = oracles.unit(np.cross(normal, [0.3, 1.0, 0.2]))
    brushed = values * np.exp(-((along @ half.T / 0.2) ** 2))
    found, trust = solved(brushed)
    assert np.median(errors(found, normal, VIEW)) > 20 * tolerances.AZIMUTH
    assert np.median(trust) < 0.5 * np.median(solved(values)[1])


def test_cast_shadows_do_not_turn_it(drawn: tuple[Array, Array]) -> None:
    """Half the bright side lies in shadow: the plane stays, and so does its brighter end."""
    normal, values = drawn
    side = oracles.unit(normal * [1, 1, 0])
    across = np.stack([-side[:, 1], side[:, 0], 0 * side[:, 0]], axis=1)
    shadow = (side @ LIGHTS.T > 0.2) & (across @ LIGHTS.T > 0.1)
    error = errors(solved(np.where(shadow, 0, values))[0], normal, VIEW)
    assert np.median(error) < 3 * tolerances.AZIMUTH
    assert (error < 5).mean() > 0.95


def test_lights_on_one_side_are_not_trusted(drawn: tuple[Array, Array]) -> None:
    normal, values = drawn
    right = LIGHTS[:, 0] > 0.4
    away = np.abs(normal[:, 0]) < 0.3 * np.abs(normal[:, 1])  # their plane mirrors the cone out of itself
    assert np.median(solved(values[:, right], LIGHTS[right])[1][~away]) < 0.2
    assert np.median(solved(values)[1][~away]) > 0.5


def test_few_lights_are_not_trusted() -> None:
    twelve = hemisphere(12)
    assert solved(glossy(normals(), twelve, VIEW), twelve)[1].max() < 0.5
    ring = oracles.unit(np.stack([np.cos(np.arange(8.0)), np.sin(np.arange(8.0)), 0 * np.arange(8.0)], axis=1))
    for lights in (twelve[:3], ring):
        found, trust = solved(glossy(normals(), lights, VIEW), lights)
        assert (found == 0).all() and (trust == 0).all()


def test_normal_that_faces_the_viewer_is_not_trusted() -> None:
    facing = oracles.unit(np.array([[0.01, 0.005, 1.0]]))
    tilted = oracles.unit(np.array([[1.0, 0.5, 1.0]]))
    trusts = [solved(glossy(normal, LIGHTS, VIEW))[1][0] for normal in (facing, tilted)]
    assert trusts[0] < 0.2 < 0.5 < trusts[1]


def test_scale_of_the_pictures_does_not_matter_and_darkness_is_said(drawn: tuple[Array, Array]) -> None:
    for factor in (1e-6, 1e6):
        assert np.abs(solved(factor * drawn[1])[0] - solved(drawn[1])[0]).max() < tolerances.SINGLE * 100
    assert solved(np.zeros((2, len(LIGHTS))))[1].tolist() == [0, 0]


def test_frames_turn_the_axis_to_the_view() -> None:
    view = normals()
    turned = frames(view)
    assert np.abs(turned[..., 2] - view).max() < 1e-15
    assert np.abs(turned @ turned.transpose(0, 2, 1) - np.eye(3)).max() < 1e-14
    assert np.abs(np.linalg.det(turned) - 1).max() < 1e-14
