"""Radiance in closed form: the closures of the material stage, Fresnel's equations, shadow rays."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.core import direct_light as direct
from pipeline.core.direct_light import Lobes, Rays, Surface
from pipeline.core.lights import Lights
from pipeline.core.material.closures import Lobe

POINTS = 400


def directions(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    cosine, angle = rng.uniform(0.02, 1, POINTS), rng.uniform(0, 2 * np.pi, POINTS)
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(angle), sine * np.sin(angle), cosine], axis=-1)


def lobes(distribution: int, roughness: float = 0.5, fresnel: int = direct.NO_FRESNEL, f0: float = 1.0) -> Lobes:
    up = np.broadcast_to([0.0, 0.0, 1.0], (1, POINTS, 3)).copy()
    full = np.ones((1, POINTS))
    return Lobes(
        np.full((1, POINTS), distribution, np.int8),
        np.full((1, POINTS), fresnel, np.int8),
        np.ones((1, POINTS, 3)),
        up,
        full * roughness**2,
        np.full((1, POINTS, 3), f0),
        full * 1.5,
    )


def surface(of: Lobes, to_camera: np.ndarray) -> Surface:
    up = np.broadcast_to([0.0, 0.0, 1.0], (POINTS, 3)).copy()
    return Surface(np.zeros((POINTS, 3)), to_camera, up, up, np.zeros((POINTS, 3)), np.zeros(POINTS), of)


def lit(rays: Rays) -> np.ndarray:
    return np.zeros(len(rays.start), bool)


@pytest.mark.parametrize("roughness", [0.1, 0.35, 1.0])
@pytest.mark.parametrize(("kind", "distribution"), [("ggx", direct.GGX), ("beckmann", direct.BECKMANN), ("diffuse", 0)])
def test_lobes_are_those_of_the_material_stage(kind: str, distribution: int, roughness: float) -> None:
    wi, wo = directions(1), directions(2)
    expected = Lobe(kind, 0.0 if kind == "diffuse" else roughness).evaluate(wi, wo)
    found = direct.white(lobes(distribution, roughness), wi, wo)[0]
    np.testing.assert_allclose(found, np.repeat(expected[:, None], 3, axis=1), rtol=1e-9, atol=1e-300)
    if kind != "diffuse":
        other = direct.white(lobes(distribution, 1.01 * roughness), wi, wo)[0, :, 0]
        assert np.median(abs(other / np.maximum(expected, 1e-300) - 1)) > 1e-3


def test_lobes_are_reciprocal() -> None:
    wi, wo = directions(3), directions(4)
    for distribution in (direct.GGX, direct.BECKMANN):
        for fresnel in (direct.NO_FRESNEL, direct.SCHLICK, direct.DIELECTRIC):
            one = lobes(distribution, 0.4, fresnel, 0.04)
            there, back = direct.white(one, wi, wo)[0, :, 0] / wi[:, 2], direct.white(one, wo, wi)[0, :, 0] / wo[:, 2]
            np.testing.assert_allclose(there, back, rtol=1e-9)


def test_fresnel_runs_from_f0_to_one() -> None:
    """At normal incidence f0, at grazing incidence 1, and of a dielectric what Fresnel has at Brewster's angle."""
    f0 = 0.04  # of an index of 1.5
    plain, schlick, dielectric = (lobes(direct.GGX, 0.5, kind, f0) for kind in range(3))
    angle = np.linspace(0, np.radians(89.9), POINTS)
    wi = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    wo = wi * [-1, 1, 1]  # theta_h = 0, theta_d = the angle
    whole = direct.white(plain, wi, wo)[0, :, 0]
    of_schlick, exact = (direct.white(one, wi, wo)[0, :, 0] / whole for one in (schlick, dielectric))
    assert of_schlick[0] == pytest.approx(f0) and exact[0] == pytest.approx(f0)
    assert of_schlick[-1] > 0.99 and exact[-1] > 0.98
    at = np.searchsorted(angle, np.arctan(1.5))  # no reflection parallel to the plane; half of ((n^2-1)/(n^2+1))^2
    assert exact[at] == pytest.approx(((1.5**2 - 1) / (1.5**2 + 1)) ** 2 / 2, rel=0.01)
    assert abs(of_schlick[at] - exact[at]) > 0.005


def test_light_falls_off_by_the_square_and_adds_up() -> None:
    wo = directions(5)
    one = lobes(direct.LAMBERT)
    place = np.array([[0.3, 0.4, 1.2], [0.6, 0.8, 2.4]])
    near = Lights("near", place, np.array([[1.0, 2.0, 3.0]] * 2), np.zeros(2, np.int64))
    first, second = (direct.radiance(surface(one, wo), near, i, 0.0, lit) for i in range(2))
    np.testing.assert_allclose(first, 4 * second, rtol=1e-6)
    expected = 1.2 / 1.3 / np.pi / 1.3**2 * np.array([1, 2, 3])
    np.testing.assert_allclose(first, np.broadcast_to(expected, first.shape), rtol=1e-6)
    distant = Lights("distant", place / np.linalg.norm(place, axis=1, keepdims=True), near.intensity, near.surface)
    np.testing.assert_allclose(direct.radiance(surface(one, wo), distant, 0, 0.0, lit), first * 1.3**2, rtol=1e-6)
    both = dataclasses.replace(one, **{f.name: np.repeat(getattr(one, f.name), 2, 0) for f in dataclasses.fields(one)})
    np.testing.assert_allclose(direct.radiance(surface(both, wo), near, 0, 0.0, lit), 2 * first, rtol=1e-6)


def test_shadow_rays_start_beside_the_triangle_and_end_at_the_light() -> None:
    seen: list[Rays] = []

    def every_other(rays: Rays) -> np.ndarray:
        seen.append(rays)
        return np.arange(len(rays.start)) % 2 == 0

    of = surface(lobes(direct.LAMBERT), directions(6))
    lights = Lights("near", np.array([[0.0, 3.0, 4.0]]), np.ones((1, 3)), np.zeros(1, np.int64))
    found = direct.radiance(of, lights, 0, 0.25, every_other)
    (rays,) = seen
    np.testing.assert_allclose(rays.start, np.broadcast_to([0, 0, 0.25], rays.start.shape))
    np.testing.assert_allclose(
        rays.start + rays.reach[:, None] * rays.direction, np.broadcast_to([0, 3, 4], (POINTS, 3)), atol=1e-6
    )
    assert (found[::2] == 0).all() and (found[1::2] > 0).all()


def test_grazing_rays_start_lifted() -> None:
    """Above the cutoff nothing; far below it the whole lift; a light behind all normals is not asked for."""
    of = surface(lobes(direct.LAMBERT), directions(7))
    lift = np.broadcast_to([0.0, 0.0, 0.5], (POINTS, 3)).copy()
    of = dataclasses.replace(of, lift=lift, cutoff=np.full(POINTS, 0.1))
    seen: list[Rays] = []

    def noted(rays: Rays) -> np.ndarray:
        seen.append(rays)
        return lit(rays)

    for height, share in ((0.5, 0.0), (0.1, 0.0), (0.05, 1.0), (0.075, 0.5), (1e-6, 1.0)):
        towards = np.array([[np.sqrt(1 - height**2), 0, height]])
        direct.radiance(of, Lights("distant", towards, np.ones((1, 3)), np.zeros(1, np.int64)), 0, 0.0, noted)
        np.testing.assert_allclose(seen[-1].start[:, 2], 0.5 * share, atol=1e-6)
    below = Lights("distant", np.array([[0, 0, -1.0]]), np.ones((1, 3)), np.zeros(1, np.int64))
    assert direct.radiance(of, below, 0, 0.0, lambda r: np.ones(len(r.start), bool)).max() == 0
