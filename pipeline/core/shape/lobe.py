"""The apparent BRDF of one pixel as a function of the light's direction, fitted with the depth as an unknown.

For a fixed camera ray the pictures of all lights, near and far, sample one function of the direction u to the
light. Where the depth is right, the lights of both surfaces agree on it. The function is modelled as a diffuse term
and a microfacet lobe that is shared by both surfaces::

    M(u) = kd (n.u) + D(h) G(u) [k0 + k1 R(theta_d)]            (zero where n.u <= 0)
    D    = (n.h)^-4 [1 + tan^2(theta_h) kappa / (alpha^2 (1 - kappa))]^(-1/kappa)
    G    = (1 + Lambda(wo)) / (1 + Lambda(wo) + Lambda(u))
    R    = (F(theta_d) - F(0)) / (1 - F(0)),  F the dielectric Fresnel reflectance of index 1.5

Where the pictures hold bounced light, its first two spherical harmonics are added: max(0, a0 + a.u). Lights at
different distances in one direction make the same of it only as far as the surfaces that send it on are near.

D is Student's t-distribution of slopes (Ribardiere et al., "STD: Student's t-Distribution of Slopes for Microfacet
Based BSDFs", 2017), scaled to 1 at its peak: kappa = 1/2 is GGX, kappa -> 0 Beckmann, and
alpha^2 (1 - kappa) = kappa a power of n.h. Lambda is Smith's, blended between Beckmann's and GGX's. A picture value
divided by the light's intensity is compared with M / d^2 on cube roots, which lie between the statistics of
relative noise and of absolute noise; the loss is Cauchy's.

Not modelled: anisotropy, subsurface transport, interreflection; what the model misses is left to
:mod:`.pairwise`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import kernel

# Layout of a pixel's state.
DEPTH, NX, NY, NZ, LOG_ALPHA, KAPPA, DIFFUSE, SPECULAR, RISE, BOUNCED = range(10)
STATE = 13
# Unknowns: depth, two of the normal, log alpha, kappa, kd, k0, k1, four of the bounced light.
UNKNOWNS = 12
DIRECT_UNKNOWNS = 8


class Pixel(NamedTuple):
    """What one pixel knows.

    Parameters
    ----------
    ray : (6,) float64
        Origin [m] and unit direction.
    near, far : float
        Limits of the depth [m].
    lit : int
        How many of the N lights are seen; the others, in coarsely quantised pictures alone, were rounded to 0.
    lights : (N, 3) float64
        The lights [m], lit ones first.
    roots : (N,) float64
        Cube root of picture value over intensity, of each; of half a step, the most that it can be, where that was
        rounded to 0.
    weights : (N,) float64
        Factors of the residuals, 1 where the picture's noise floor does not matter; kept up to date by the fit.
    middle : float
        Median of the lit lights' roots.
    noise : float
        Standard deviation of the noise floor, in value over intensity.
    bounced : bool
        Whether the pictures hold light that other surfaces sent on.
    expected, precision : (12,) float64
        What is known of the unknowns beforehand and how well, 1 / variance; 0 for nothing.
    """

    ray: Any
    near: float
    far: float
    lit: int
    lights: Any
    roots: Any
    weights: Any
    middle: float
    noise: float
    bounced: bool
    expected: Any
    precision: Any


ALPHA_RANGE = (math.log(3e-3), math.log(1.5))
KAPPA_RANGE = (1e-7, 0.8)  # from Beckmann on: its depths err in proportion to the least kappa, .016 % at 1e-3
SOFT = 0.35  # slope of a rounded value's residual inside its step: keeps the equations regular
HALF_STEP = math.sqrt(3.0)  # over the standard deviation that rounding makes
_KNOTS = 512


def _fresnel_rise() -> NDArray[np.float64]:
    """Return R at evenly spaced cosines of theta_d from 0 to 1 for index 1.5."""
    c = np.linspace(0.0, 1.0, _KNOTS + 1)
    g = np.sqrt(1.5**2 - 1 + c**2)
    f = 0.5 * ((g - c) / (g + c)) ** 2 * (1 + ((c * (g + c) - 1) / (c * (g - c) + 1)) ** 2)
    return np.asarray((f - f[-1]) / (1 - f[-1]))


_RISE = _fresnel_rise()


@kernel
def _lambda_ggx(cosine, alpha2):  # type: ignore[no-untyped-def]
    """Return Smith's Lambda for GGX and its derivatives by the cosine and by log alpha."""
    tan2 = max(0.0, 1.0 / (cosine * cosine) - 1.0)
    root = math.sqrt(1.0 + alpha2 * tan2)
    return 0.5 * (root - 1.0), -0.5 * alpha2 / (root * cosine**3), 0.5 * alpha2 * tan2 / root


@kernel
def _lambda_beckmann(cosine, alpha2):  # type: ignore[no-untyped-def]
    """Return Smith's Lambda for Beckmann by Walter's rational fit, and its derivatives as above."""
    tan2 = max(1e-12, 1.0 / (cosine * cosine) - 1.0)
    a = 1.0 / math.sqrt(alpha2 * tan2)
    if a >= 1.6:
        return 0.0, 0.0, 0.0
    below = a * (3.535 + 2.181 * a)
    above = 1.0 - 1.259 * a + 0.396 * a * a
    slope = ((-1.259 + 0.792 * a) * below - above * (3.535 + 4.362 * a)) / (below * below)
    # da/dcos = a / (cos^3 tan^2), da/dlog(alpha) = -a
    return above / below, slope * a / (cosine**3 * tan2), -slope * a


@kernel
def _lambda(cosine, alpha2, blend):  # type: ignore[no-untyped-def]
    g, g_cos, g_log = _lambda_ggx(cosine, alpha2)
    b, b_cos, b_log = _lambda_beckmann(cosine, alpha2)
    rest = 1.0 - blend
    return blend * g + rest * b, blend * g_cos + rest * b_cos, blend * g_log + rest * b_log, g - b


@kernel
def tangents(nx, ny, nz):  # type: ignore[no-untyped-def]
    """Return two unit vectors that make a right-handed frame with a unit normal (Duff et al. 2017)."""
    sign = 1.0 if nz >= 0.0 else -1.0
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return 1.0 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny


@kernel
def beyond_rounding(root, measured, noise):  # type: ignore[no-untyped-def]
    """Return the residual of a rounded value, small as long as the prediction rounds to it, and its slope.

    The middle of a step is no estimate of what was rounded to it: where most values lie below the first step, those
    that reach it do so just about.
    """
    half = math.copysign(HALF_STEP * noise, root - measured)
    edge = np.cbrt(max(0.0, measured**3 + half))
    if abs(root - measured) < abs(edge - measured):
        return SOFT * (root - measured), SOFT
    return root - edge + SOFT * (edge - measured), 1.0


@kernel
def evaluate(state, glossy, pixel, sigma, residuals, jacobian):  # type: ignore[no-untyped-def]
    """Evaluate the residuals and, where wanted, their derivatives.

    Parameters
    ----------
    state : (13,) float64
        depth, normal, log alpha, kappa, kd, k0, k1, bounced light.
    glossy : bool
        Whether the lobe takes part.
    pixel : Pixel
    sigma : float
        Scale of Cauchy's loss, in the unit of ``roots``.
    residuals : (N,) float64
        Filled with predicted minus measured cube roots, weighted; see :func:`beyond_rounding` for rounded values.
    jacobian : (N, 12) or (0, 12) float64
        Filled with the derivatives by the 12 unknowns, unless it is empty.

    Returns
    -------
    cost : float
        Mean of log(1 + x^2), x = r / sigma, and of x^2 / (1 + x^2) for values rounded to 0: much less than predicted
        is shadow, of which the model knows nothing.
    """
    ray, positions, roots, weights = pixel.ray, pixel.lights, pixel.roots, pixel.weights
    count = len(roots)
    lit = pixel.lit
    derive = len(jacobian) > 0
    t, nx, ny, nz = state[DEPTH], state[NX], state[NY], state[NZ]
    alpha2 = math.exp(2.0 * state[LOG_ALPHA])
    kappa = state[KAPPA]
    kd, k0, k1 = state[DIFFUSE], state[SPECULAR], state[RISE]
    ox, oy, oz = -ray[3], -ray[4], -ray[5]
    px, py, pz = ray[0] + t * ray[3], ray[1] + t * ray[4], ray[2] + t * ray[5]
    ax, ay, az, bx, by, bz = tangents(nx, ny, nz)
    co = max(0.02, nx * ox + ny * oy + nz * oz)
    blend = min(1.0, 2.0 * kappa)
    blend_slope = 2.0 if kappa < 0.5 else 0.0
    view, view_cos, view_log, view_blend = _lambda(co, alpha2, blend)
    widen = kappa / (alpha2 * (1.0 - kappa))
    cost = 0.0
    for i in range(count):
        wx, wy, wz = positions[i, 0] - px, positions[i, 1] - py, positions[i, 2] - pz
        d2 = wx * wx + wy * wy + wz * wz
        inverse = 1.0 / math.sqrt(d2)
        ux, uy, uz = wx * inverse, wy * inverse, wz * inverse
        cl = nx * ux + ny * uy + nz * uz
        bounced = 0.0
        if pixel.bounced:
            bounced = max(0.0, state[9] + state[10] * ux + state[11] * uy + state[12] * uz)
        if cl <= 1e-3 and bounced <= 0.0:
            # Lit although the model says that it faces away.
            residuals[i] = -weights[i] * roots[i] if i < lit else 0.0
            cost += math.log(1.0 + (residuals[i] / sigma) ** 2)
            if derive:
                jacobian[i, :] = 0.0
            continue
        direct = 1.0 if cl > 1e-3 else 0.0
        cl = max(cl, 1e-3)
        uo = ux * ox + uy * oy + uz * oz
        # derivative of u by depth: (-v + u (u.v)) / d with v = -o
        tx, ty, tz = (ox - ux * uo) * inverse, (oy - uy * uo) * inverse, (oz - uz * uo) * inverse
        cl_t = nx * tx + ny * ty + nz * tz
        cl_a, cl_b = ax * ux + ay * uy + az * uz, bx * ux + by * uy + bz * uz
        value = direct * kd * cl + bounced
        lobe = 0.0
        rise = 0.0
        if glossy and direct > 0.0:
            norm = 1.0 / math.sqrt(max(1e-9, 2.0 + 2.0 * uo))
            hx, hy, hz = (ux + ox) * norm, (uy + oy) * norm, (uz + oz) * norm
            ch = max(0.02, nx * hx + ny * hy + nz * hz)
            cd = min(1.0, 0.5 / norm)
            tan2 = max(0.0, 1.0 / (ch * ch) - 1.0)
            q = widen * tan2
            grown = math.log1p(q)
            d = math.exp(-grown / kappa) / (ch * ch * ch * ch)
            light, light_cos, light_log, light_blend = _lambda(cl, alpha2, blend)
            whole = 1.0 + view + light
            g = (1.0 + view) / whole
            knot = cd * _KNOTS
            at = min(_KNOTS - 1, int(knot))
            rise = _RISE[at] + (knot - at) * (_RISE[at + 1] - _RISE[at])
            lobe = d * g
            tint = k0 + k1 * rise
            value += lobe * tint
        value = max(value, 1e-30)
        root = np.cbrt(value / d2)
        apart, slope = root - roots[i], weights[i]
        if i >= lit:
            apart = max(0.0, apart)
            slope = weights[i] if apart > 0.0 else 0.0
        elif count > lit:
            apart, soft = beyond_rounding(root, roots[i], pixel.noise)
            slope *= soft
        r = weights[i] * apart
        residuals[i] = r
        cost += math.log(1.0 + (r / sigma) ** 2) if i < lit else r * r / (r * r + sigma * sigma)
        if not derive:
            continue
        chain = slope * root / (3.0 * value)
        row = jacobian[i]
        by_depth, by_a, by_b = direct * kd * cl_t, direct * kd * cl_a, direct * kd * cl_b
        row[8:] = 0.0
        if bounced > 0.0:
            row[8], row[9], row[10], row[11] = chain, chain * ux, chain * uy, chain * uz
            by_depth += state[10] * tx + state[11] * ty + state[12] * tz
        row[3] = 0.0
        row[4] = 0.0
        if glossy and direct > 0.0:
            # h = (u + o) norm, norm' = -norm^3 (o.u')
            uo_t = ox * tx + oy * ty + oz * tz
            ch_t = (nx * tx + ny * ty + nz * tz) * norm - ch * norm * norm * uo_t
            ch_a, ch_b = ax * hx + ay * hy + az * hz, bx * hx + by * hy + bz * hz
            # log D by n.h: -4/ch - (1/kappa) widen (-2/ch^3) / (1 + q)
            logd_ch = -4.0 / ch + 2.0 * widen / (kappa * ch * ch * ch * (1.0 + q))
            logg_cl = -light_cos / whole
            logg_co = view_cos * (1.0 / (1.0 + view) - 1.0 / whole)
            rise_t = (_RISE[at + 1] - _RISE[at]) * _KNOTS * (0.5 * norm * uo_t)
            shine = lobe * tint
            by_depth += shine * (logd_ch * ch_t + logg_cl * cl_t) + lobe * k1 * rise_t
            co_a, co_b = ax * ox + ay * oy + az * oz, bx * ox + by * oy + bz * oz
            by_a += shine * (logd_ch * ch_a + logg_cl * cl_a + logg_co * co_a)
            by_b += shine * (logd_ch * ch_b + logg_cl * cl_b + logg_co * co_b)
            logg_alpha = view_log / (1.0 + view) - (view_log + light_log) / whole
            row[3] = chain * shine * (2.0 * q / (kappa * (1.0 + q)) + logg_alpha)
            logg_kappa = blend_slope * (view_blend / (1.0 + view) - (view_blend + light_blend) / whole)
            row[4] = (
                chain * shine * (grown / (kappa * kappa) - q / ((1.0 + q) * kappa * kappa * (1.0 - kappa)) + logg_kappa)
            )
        row[0] = chain * by_depth - slope * root * 2.0 / 3.0 * (ox * wx + oy * wy + oz * wz) / d2
        row[1] = chain * by_a
        row[2] = chain * by_b
        row[5] = chain * direct * cl
        row[6] = chain * lobe
        row[7] = chain * lobe * rise
    return cost / count
