"""A BRDF as a table over half and difference angles, as the MERL measurements have it.

theta_h is the angle from the normal to the half vector, theta_d and phi_d are the polar angle and azimuth of the light
in the frame of the half vector, whose x axis lies in the plane of half vector and normal (Rusinkiewicz 1998).
Exchanging light and viewer adds pi to phi_d, so that a reciprocal table needs phi_d from 0 to pi alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from ..errors import LightsphereError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tabulated:
    """``f(theta_h, theta_d, phi_d)``, linear in sqrt(theta_h), theta_d and phi_d between nodes, constant beyond them.

    Parameters
    ----------
    table : (TH, TD, PD, 3) float64
        f at the nodes [1/sr]; finite and non-negative. PD = 1 where f does not depend on phi_d.
    theta_h, theta_d : (TH,), (TD,) float64
        Nodes, ascending, 0 to pi/2 [rad].
    phi_d : (PD,) float64
        Nodes, ascending, 0 to pi [rad]; f repeats after pi, so that 0 and pi are not both among them.

    Raises
    ------
    LightsphereError
        When shapes or nodes do not fit, or a value is no reflectance.

    At theta_h = 0 the plane of half vector and normal is any plane: a table that depends on phi_d there is isotropic
    only outside that one direction. Not modelled: anisotropy, fluorescence.
    """

    table: Array
    theta_h: Array
    theta_d: Array
    phi_d: Array
    isotropic = True

    def __post_init__(self) -> None:
        sizes = tuple(nodes.size for nodes in self._nodes())
        if self.table.shape != (*sizes, 3):
            raise LightsphereError(
                f"table has the shape {self.table.shape}, its nodes say {(*sizes, 3)}; give theta_h, theta_d, phi_d, 3"
            )
        for name, nodes in zip(("theta_h", "theta_d", "phi_d"), self._nodes(), strict=True):
            end = np.pi if name == "phi_d" else np.pi / 2
            if nodes.ndim != 1 or not nodes.size:
                raise LightsphereError(f"{name} has the shape {nodes.shape}; give a list of angles")
            if not (np.diff(nodes) > 0).all() or not (nodes >= 0).all() or not (nodes <= end + 1e-6).all():
                raise LightsphereError(f"{name} must ascend from 0 to {end:.4g}; give angles in radians")
        if self.phi_d[-1] - self.phi_d[0] > np.pi - 1e-6:
            raise LightsphereError("the first and the last phi_d are one angle, as f repeats after pi; leave one out")
        if not np.isfinite(self.table).all() or (self.table < 0).any():
            raise LightsphereError("the table has values that are no reflectance; mark unknown ones and fill them")

    def evaluate(self, wi: Array, wo: Array) -> Array:
        """Return f [1/sr], (N, 3), for unit directions wi and wo (N, 3) above the surface."""
        theta_h, theta_d, phi_d = half_and_difference(wi, wo)
        corners = [
            _between(np.sqrt(self.theta_h), np.sqrt(theta_h)),
            _between(self.theta_d, theta_d),
            _around(self.phi_d, phi_d),
        ]
        value = np.zeros((len(wi), 3))
        for i, share_h in corners[0]:
            for j, share_d in corners[1]:
                for k, share_p in corners[2]:
                    value += (share_h * share_d * share_p)[:, None] * self.table[i, j, k]
        return value

    def _nodes(self) -> tuple[Array, Array, Array]:
        return self.theta_h, self.theta_d, self.phi_d


def half_and_difference(wi: Array, wo: Array) -> tuple[Array, Array, Array]:
    """Return theta_h, theta_d and phi_d (N,) [rad] of unit directions (N, 3); phi_d from 0 to pi, modulo pi.

    Arcs of sines and cosines together keep their digits where highlights are: at theta_h near 0.
    """
    half, apart = wi + wo, wi - wo
    across = np.hypot(half[:, 0], half[:, 1])
    theta_h = np.arctan2(across, half[:, 2])
    theta_d = np.arctan2(np.linalg.norm(apart, axis=1), np.linalg.norm(half, axis=1))
    # the difference vector lies in the plane across h: its parts along that plane's axes give phi_d
    heading = np.where(across[:, None] > 0, half[:, :2] / np.maximum(across, 1e-300)[:, None], [1.0, 0.0])
    along = (heading * apart[:, :2]).sum(axis=1) * np.cos(theta_h) - apart[:, 2] * np.sin(theta_h)
    beside = heading[:, 0] * apart[:, 1] - heading[:, 1] * apart[:, 0]
    return theta_h, theta_d, np.mod(np.arctan2(beside, along), np.pi)


def directions(theta_h: Array, theta_d: Array, phi_d: Array) -> tuple[Array, Array]:
    """Return wi and wo (N, 3) of half and difference angles of one shape [rad], the half vector in the plane of x."""
    h, d, p = (angle.ravel() for angle in (theta_h, theta_d, phi_d))
    pair = []
    for sign in (1.0, -1.0):
        x, y, z = sign * np.sin(d) * np.cos(p), sign * np.sin(d) * np.sin(p), np.cos(d)
        pair.append(np.stack([x * np.cos(h) + z * np.sin(h), y, z * np.cos(h) - x * np.sin(h)], axis=-1))
    return pair[0], pair[1]


def filled(table: Array) -> tuple[Array, int]:
    """Give cells without a value (NaN, infinite or negative) the nearest cell's, and count them.

    Cells below the horizon are never measured, but those beside them are interpolated with them.

    Raises
    ------
    LightsphereError
        When no cell has a value.
    """
    unknown = ~(np.isfinite(table) & (table >= 0)).all(axis=-1)
    if unknown.all():
        raise LightsphereError("the table has no value at all; look at the file")
    nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return np.asarray(table[tuple(nearest)]), int(unknown.sum())


def _between(nodes: Array, place: Array) -> list[tuple[NDArray[np.int64], Array]]:
    """Return the two nodes about each place (N,) and their shares."""
    if len(nodes) == 1:
        return [(np.zeros(len(place), np.int64), np.ones(len(place)))]
    below = np.clip(np.searchsorted(nodes, place, side="right") - 1, 0, len(nodes) - 2)
    beyond = np.clip((place - nodes[below]) / (nodes[below + 1] - nodes[below]), 0.0, 1.0)
    return [(below, 1 - beyond), (below + 1, beyond)]


def _around(nodes: Array, place: Array) -> list[tuple[NDArray[np.int64], Array]]:
    """Return the same where the last node is followed by the first, pi later."""
    if len(nodes) == 1:
        return _between(nodes, place)
    circle = np.concatenate([nodes[-1:] - np.pi, nodes, nodes[:1] + np.pi])
    return [((index - 1) % len(nodes), share) for index, share in _between(circle, place)]
