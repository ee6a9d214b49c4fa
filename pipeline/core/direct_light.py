"""Direct light of surfaces whose closures are known in closed form: one picture per light, without a renderer.

L = sum over lobes of f(wi, wo) cos(theta_i) E, for one light at a time, with the closures of Cycles in the forms of
:mod:`.material.closures`: Lambert; and D G F / (4 cos_o) of Trowbridge and Reitz (GGX) or Beckmann, where
F(theta_d) = f0 + (1 - f0) s(theta_d) with Schlick's s = (1 - cos)^5, or with the s that takes the Fresnel equation of a
dielectric from its value at normal incidence to 1.

Not modelled: whatever else bounces, emits or lets light through. Which points a light reaches is for a ray tracer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel
from .lights import Lights

FAR = 1e30  # the length of a ray to a distant light
LAMBERT, GGX, BECKMANN = 0, 1, 2
NO_FRESNEL, SCHLICK, DIELECTRIC = 0, 1, 2


@dataclass(frozen=True)
class Lobes:
    """The closures of P surface points, up to N of each.

    Parameters
    ----------
    distribution, fresnel : (N, P) int8
        LAMBERT, GGX or BECKMANN; NO_FRESNEL, SCHLICK or DIELECTRIC.
    weight : (N, P, 3) float64
        Colour times the share of the closure; 0 where a point has fewer.
    normal : (N, P, 3) float64
        Unit, world space, on the camera's side.
    alpha : (N, P) float64
        Roughness squared of a microfacet lobe.
    f0 : (N, P, 3) float64
        Reflectance of a facet at normal incidence, where there is Fresnel.
    ior : (N, P) float64
        Relative index of refraction of a dielectric.
    """

    distribution: NDArray[np.int8]
    fresnel: NDArray[np.int8]
    weight: NDArray[np.float64]
    normal: NDArray[np.float64]
    alpha: NDArray[np.float64]
    f0: NDArray[np.float64]
    ior: NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """Points that a camera sees.

    Parameters
    ----------
    position : (P, 3) float64
        World [m].
    to_camera : (P, 3) float64
        Unit.
    normal, true_normal : (P, 3) float64
        Of the shading and of the triangle, unit, on the camera's side.
    lift : (P, 3) float64
        From the triangle to the round surface that its normals promise [m].
    cutoff : (P,) float64
        Shadow rays start lifted where the cosine between light and triangle is less; 0 for flat shading.
    lobes : Lobes
    """

    position: NDArray[np.float64]
    to_camera: NDArray[np.float64]
    normal: NDArray[np.float64]
    true_normal: NDArray[np.float64]
    lift: NDArray[np.float64]
    cutoff: NDArray[np.float64]
    lobes: Lobes


@dataclass(frozen=True)
class Rays:
    """Rays from N points towards a light.

    Parameters
    ----------
    start, direction : (N, 3) float32
        World [m]; unit.
    reach : (N,) float32
        How far the light is [m].
    """

    start: NDArray[np.float32]
    direction: NDArray[np.float32]
    reach: NDArray[np.float32]


def radiance(
    surface: Surface, lights: Lights, index: int, offset: float, hidden: Callable[[Rays], NDArray[np.bool_]]
) -> NDArray[np.float32]:
    """Return what points send to the camera under one light, (P, 3).

    Parameters
    ----------
    surface : Surface
    lights : Lights
    index : int
        Of the light.
    offset : float
        How far from their triangle shadow rays start [m].
    hidden : callable
        Tells which rays (N,) something stops.
    """
    distant = lights.kind == "distant"
    light, lobes = lights.position[index], surface.lobes
    facing, rays = np.empty(len(surface.position), np.int64), np.empty((len(surface.position), 7), np.float32)
    count = _rays(
        surface.position, surface.normal, surface.true_normal, surface.lift, surface.cutoff, lobes.normal, light,
        distant, offset, facing, rays,
    )  # fmt: skip
    rays = rays[:count]
    lit = facing[:count][~hidden(Rays(rays[:, :3], rays[:, 3:6], rays[:, 6]))]
    made = np.zeros((len(surface.position), 3), np.float32)
    _radiance(
        lobes.distribution, lobes.fresnel, lobes.weight, lobes.normal, lobes.alpha, lobes.f0, lobes.ior,
        surface.position, surface.to_camera, lit, light, distant, lights.intensity[index], made,
    )  # fmt: skip
    return made


def white(lobes: Lobes, wi: NDArray[np.float64], wo: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return f cos(theta_i) (N, P, 3) of lobes with a weight of one; wi and wo (P, 3) are unit."""
    made = np.empty((*lobes.alpha.shape, 3))
    _white(lobes.distribution, lobes.fresnel, lobes.normal, lobes.alpha, lobes.f0, lobes.ior, wi, wo, made)
    return made


@kernel
def _towards(position: Any, p: Any, light: Any, distant: Any) -> Any:
    """Return the unit direction from a point to a light and the distance."""
    if distant:
        return light[0], light[1], light[2], np.inf
    x, y, z = light[0] - position[p, 0], light[1] - position[p, 1], light[2] - position[p, 2]
    distance = np.sqrt(x * x + y * y + z * z)
    return x / distance, y / distance, z / distance, distance


@kernel
def _rays(  # type: ignore[no-untyped-def]
    position, normal, true_normal, lift, cutoff, of_lobes, light, distant, offset, facing, rays
):
    """Write the shadow rays of the points that face a light: start, direction, length; return their number.

    Cycles lifts the start by the more the more light grazes (kernel/light/sample.h), by 1 - cos_g / cutoff where the
    shading normal's cosine is above the cutoff and by 2 - (cos_g + cos_s) / cutoff below it, from 0 to 1.
    """
    count = 0
    for p in range(len(position)):
        x, y, z, distance = _towards(position, p, light, distant)
        faces = False
        for n in range(len(of_lobes)):
            faces = faces or of_lobes[n, p, 0] * x + of_lobes[n, p, 1] * y + of_lobes[n, p, 2] * z > 0.0
        if not faces:
            continue
        cos_s = normal[p, 0] * x + normal[p, 1] * y + normal[p, 2] * z
        cos_g = true_normal[p, 0] * x + true_normal[p, 1] * y + true_normal[p, 2] * z
        amount = 0.0
        if cutoff[p] > 0.0:
            amount = 2.0 - (cos_g + cos_s) / cutoff[p] if cos_s < cutoff[p] else 1.0 - cos_g / cutoff[p]
            amount = min(max(amount, 0.0), 1.0)
        side = -offset if cos_g < 0.0 and amount == 0.0 else offset
        sx = position[p, 0] + side * true_normal[p, 0] + amount * lift[p, 0]
        sy = position[p, 1] + side * true_normal[p, 1] + amount * lift[p, 1]
        sz = position[p, 2] + side * true_normal[p, 2] + amount * lift[p, 2]
        if not distant:
            x, y, z = light[0] - sx, light[1] - sy, light[2] - sz
            distance = np.sqrt(x * x + y * y + z * z)
            x, y, z = x / distance, y / distance, z / distance
        facing[count] = p
        rays[count, 0], rays[count, 1], rays[count, 2] = sx, sy, sz
        rays[count, 3], rays[count, 4], rays[count, 5] = x, y, z
        rays[count, 6] = min(distance, FAR)
        count += 1
    return count


@kernel
def _radiance(  # type: ignore[no-untyped-def]
    distribution, fresnel, weight, normal, alpha, f0, ior, position, to_camera, lit, light, distant, intensity, made
):
    for p in lit:
        x, y, z, distance = _towards(position, p, light, distant)
        falloff = 1.0 if distant else 1.0 / (distance * distance)
        for n in range(len(weight)):
            if weight[n, p, 0] + weight[n, p, 1] + weight[n, p, 2] == 0.0:
                continue
            value, s = _lobe(distribution, fresnel, normal, alpha, ior, n, p, (x, y, z), to_camera)
            value *= falloff
            for c in range(3):
                f = 1.0 if fresnel[n, p] == NO_FRESNEL else f0[n, p, c] + (1.0 - f0[n, p, c]) * s
                made[p, c] += value * weight[n, p, c] * f * intensity[c]


@kernel
def _white(distribution, fresnel, normal, alpha, f0, ior, wi, wo, made):  # type: ignore[no-untyped-def]
    for n in range(len(alpha)):
        for p in range(len(wi)):
            towards = (wi[p, 0], wi[p, 1], wi[p, 2])
            value, s = _lobe(distribution, fresnel, normal, alpha, ior, n, p, towards, wo)
            for c in range(3):
                made[n, p, c] = (
                    value if fresnel[n, p] == NO_FRESNEL else value * (f0[n, p, c] + (1.0 - f0[n, p, c]) * s)
                )


@kernel
def _lobe(  # type: ignore[no-untyped-def]
    distributions, fresnels, normals, alphas, iors, number, p, wi, to_camera
):
    """Return f cos(theta_i) of a point's lobe without Fresnel, and how far Fresnel is on its way from f0 to 1."""
    distribution, fresnel = distributions[number, p], fresnels[number, p]
    nx, ny, nz = normals[number, p, 0], normals[number, p, 1], normals[number, p, 2]
    cos_i = nx * wi[0] + ny * wi[1] + nz * wi[2]
    if not cos_i > 0.0:
        return 0.0, 0.0
    if distribution == LAMBERT:
        return cos_i / np.pi, 0.0
    ox, oy, oz = to_camera[p, 0], to_camera[p, 1], to_camera[p, 2]
    cos_o = nx * ox + ny * oy + nz * oz
    if not cos_o > 0.0:
        return 0.0, 0.0
    hx, hy, hz = wi[0] + ox, wi[1] + oy, wi[2] + oz
    length = np.sqrt(hx * hx + hy * hy + hz * hz)
    if length == 0.0:
        return 0.0, 0.0
    cos_h = min((nx * hx + ny * hy + nz * hz) / length, 1.0)
    cos_d = (ox * hx + oy * hy + oz * hz) / length
    # The sine from the cross product: 1 - cos^2 has no digits left in a narrow highlight.
    x, y, z = ny * hz - nz * hy, nz * hx - nx * hz, nx * hy - ny * hx
    sin2_h = (x * x + y * y + z * z) / (length * length)
    a2, c2 = alphas[number, p] * alphas[number, p], cos_h * cos_h
    if distribution == GGX:
        t = sin2_h + a2 * c2
        d = a2 / (np.pi * t * t)
        masking = 1.0 + _lambda_ggx(cos_i, a2) + _lambda_ggx(cos_o, a2)
    else:
        d = np.exp(-sin2_h / (c2 * a2)) / (np.pi * a2 * c2 * c2)
        masking = 1.0 + _lambda_beckmann(cos_i, a2) + _lambda_beckmann(cos_o, a2)
    value = d / (4.0 * cos_o * masking)
    if fresnel == SCHLICK:
        return value, (1.0 - cos_d) ** 5
    if fresnel == DIELECTRIC:
        ior = iors[number, p]
        least = ((ior - 1.0) / (ior + 1.0)) ** 2
        return value, min(max((_dielectric(cos_d, ior) - least) / (1.0 - least), 0.0), 1.0)
    return value, 0.0


@kernel
def _lambda_ggx(cosine: Any, a2: Any) -> Any:
    return (np.sqrt(1.0 + a2 * (1.0 / (cosine * cosine) - 1.0)) - 1.0) / 2.0


@kernel
def _lambda_beckmann(cosine: Any, a2: Any) -> Any:
    """Walter's rational fit."""
    tan2 = 1.0 / (cosine * cosine) - 1.0
    if not a2 * tan2 > 0.0:
        return 0.0
    a = 1.0 / np.sqrt(a2 * tan2)
    return (1.0 - 1.259 * a + 0.396 * a * a) / (3.535 * a + 2.181 * a * a) if a < 1.6 else 0.0


@kernel
def _dielectric(cosine: Any, ior: Any) -> Any:
    """Reflectance of a boundary for light without polarisation (Fresnel's equations)."""
    g2 = ior * ior - 1.0 + cosine * cosine
    if g2 <= 0.0:
        return 1.0
    g = np.sqrt(g2)
    a = (g - cosine) / (g + cosine)
    b = ((g + cosine) * cosine - 1.0) / ((g - cosine) * cosine + 1.0)
    return 0.5 * a * a * (1.0 + b * b)
