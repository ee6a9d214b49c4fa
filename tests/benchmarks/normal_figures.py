"""How far recovered normals, bases and weight maps are from the truth, and how well they predict other pictures."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from pipeline.core.camera import Camera
from pipeline.core.capture import Capture
from pipeline.core.compare.shapes import normal_error_deg
from pipeline.core.reflectance.bivariate import Bivariate
from pipeline.core.shape import Shape

Array = NDArray[np.float64]
VISIBLE = 2e-3  # how far a point may lie behind the first surface that its ray meets, share of its depth


@dataclass(frozen=True)
class Views:
    """Where a camera's pixels (P) lie in the world, and what reaches them."""

    capture: Capture
    mask: NDArray[np.bool_]
    points: Array
    to_viewer: Array

    def light(self, index: int) -> tuple[Array, Array]:
        """Return unit directions to a light (P, 3) and the irradiance that faces it (P, 3)."""
        lights = self.capture.lights
        if lights.kind == "distant":
            reach = np.broadcast_to(lights.position[index], self.points.shape)
            return reach, np.broadcast_to(lights.intensity[index], self.points.shape)
        reach = lights.position[index] - self.points
        distance = np.linalg.norm(reach, axis=1, keepdims=True)
        return reach / distance, lights.intensity[index] / distance**2


def views(capture: Capture) -> Views:
    """Return the pixels of a capture's object at their true places; photographs are seen orthographically."""
    truth, mask = capture.truth(), capture.mask()
    assert truth is not None
    points = np.nan_to_num(truth.position[mask].astype(np.float64))
    return Views(capture, mask, points, -capture.camera.rays()[1][mask])


def angles(normals: NDArray[np.float32], capture: Capture) -> Array:
    """Return the angle to the true normal of every pixel of the object [degrees]; 90 where none was recovered."""
    truth = capture.truth()
    assert truth is not None
    counted = capture.mask() & np.isfinite(truth.normal).all(axis=-1)
    blank = np.zeros(counted.shape, np.float32)
    error = normal_error_deg(Shape(capture.camera, blank, normals, blank), truth)[counted]
    return np.where(np.isnan(error), 90.0, error)


def least_squares(capture: Capture) -> NDArray[np.float32]:
    """Return the normals (H, W, 3) of plain Lambertian least squares over all lights, at the true places."""
    seen = views(capture)
    gram, moment = np.zeros((len(seen.points), 3, 3)), np.zeros((len(seen.points), 3))
    for index in range(len(capture)):
        direction, irradiance = seen.light(index)
        grey = (capture.image(index)[seen.mask] / irradiance).mean(axis=1)
        gram += direction[:, :, None] * direction[:, None]
        moment += grey[:, None] * direction
    found = np.linalg.solve(gram, moment[..., None])[..., 0]
    found /= np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-30)
    normals = np.full((*seen.mask.shape, 3), np.nan, np.float32)
    normals[seen.mask] = capture.camera.normals_to_camera(found)
    return normals


def samples(capture: Capture) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Yield normal, wi, wo and true f cos (N, 3) of the lit pixels of a single material's sphere, light by light."""
    seen, truth = views(capture), capture.truth()
    assert truth is not None
    normal = capture.camera.normals_to_world(truth.normal[seen.mask])
    for index in range(len(capture)):
        direction, irradiance = seen.light(index)
        reflected = capture.image(index)[seen.mask] / irradiance
        lit = ((normal * direction).sum(axis=1) > 0) & (reflected > 0).any(axis=1)
        yield normal[lit], direction[lit], seen.to_viewer[lit], reflected[lit]


def table_errors(found: Bivariate, spheres: list[Capture]) -> tuple[Array, NDArray[np.int64], float]:
    """Compare basis BRDFs with the true materials, each on a sphere.

    Returns
    -------
    errors : (K,) float64
        ``material_rel_rms`` of each true material: RMS of the error of f cos(theta_i) over the RMS of f cos(theta_i),
        over the sphere's pixels, seen evenly, and its lights, where the basis was ever observed; each basis at the
        scale that fits best.
    basis : (K,) int64
        Which basis stands for each material, so that the errors' sum is smallest; where there are too few, K and
        more stand for a black one.
    seen : float
        Share of the samples that were ever observed.
    """
    count, sets = found.table.shape[2], found.weights.shape[3]
    errors, share = np.ones((len(spheres), max(count, len(spheres)))), 0.0
    for material, capture in enumerate(spheres):
        power, cross, own, known, total = (np.zeros(count) for _ in range(5))
        for normal, wi, wo, reflected in samples(capture):
            cosine = (normal * wi).sum(axis=1, keepdims=True)
            for basis in range(count):
                weight = np.broadcast_to(np.eye(count)[basis, :, None], (len(normal), count, sets))
                f, observed = found.evaluate(weight, normal, wi, wo)
                predicted, true = (f * cosine)[observed], reflected[observed]
                power[basis] += (predicted**2).sum()
                cross[basis] += (predicted * true).sum()
                own[basis] += (true**2).sum()
                known[basis] += observed.sum()
                total[basis] += len(observed)
        # At the best scale s = cross / power the squared error is own - s cross.
        errors[material, :count] = np.sqrt(np.maximum(own - cross**2 / np.maximum(power, 1e-300), 0) / own)
        share += float((known / total).mean()) / len(spheres)
    rows, columns = linear_sum_assignment(errors)
    return errors[rows, columns], columns, share


def as_one(found: Bivariate) -> Bivariate:
    """Return the usual pixel's BRDF as the only basis, for an object that is of one material."""
    usual = np.nanmedian(found.weights, axis=(0, 1))
    table = np.einsum("hdks,km->hdsm", found.table, usual).reshape(*found.table.shape[:2], 1, -1)
    seen = np.where(usual.max(axis=1) > 0, found.seen, np.inf).min(axis=2, keepdims=True)
    return dataclasses.replace(found, table=table, seen=seen, weights=found.weights[:, :, :1, :1])


def weight_correlation(weights: NDArray[np.float32], basis: NDArray[np.int64], true: Array) -> Array:
    """Return the correlation (K,) of each material's true weight map with its basis's, over the object's pixels."""
    both = np.isfinite(true).all(axis=-1) & np.isfinite(weights).all(axis=(2, 3))
    amount = weights[both].mean(axis=2)
    known = basis < amount.shape[1]
    found = np.zeros(len(basis))
    found[known] = [np.corrcoef(amount[:, b], true[both][:, k])[0, 1] for k, b in enumerate(basis) if known[k]]
    return found


def predicted(normal: Array, weights: Array, found: Bivariate, wi: Array, wo: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return f cos(theta_i) (N, 3) and where it was ever observed (N,)."""
    f, seen = found.evaluate(weights, normal, wi, wo)
    return f * np.maximum((normal * wi).sum(axis=1, keepdims=True), 0), seen


def held_out(
    normals: NDArray[np.float32], found: Bivariate, capture: Capture, lights: NDArray[np.int64], part: NDArray[np.int64]
) -> Array:
    """Return the relative RMS error of pictures that were left out, for each part of the object.

    Black pixels are left out: no light arrives there. ``part`` (H, W) numbers the pixels' parts from 0.
    """
    seen = views(capture)
    normal = capture.camera.normals_to_world(normals[seen.mask])
    weights, parts = found.weights[seen.mask].astype(np.float64), part[seen.mask]
    known = np.isfinite(normal).all(axis=1) & np.isfinite(weights).all(axis=(1, 2))
    error, power = np.zeros(parts.max() + 1), np.zeros(parts.max() + 1)
    for index in lights:
        direction, irradiance = seen.light(index)
        picture = capture.image(index)[seen.mask].astype(np.float64)
        lit = known & (picture > 0).any(axis=1)
        guess, _ = predicted(normal[lit], weights[lit], found, direction[lit], seen.to_viewer[lit])
        squared = ((guess * irradiance[lit] - picture[lit]) ** 2).sum(axis=1)
        error += np.bincount(parts[lit], squared, len(error))
        power += np.bincount(parts[lit], (picture[lit] ** 2).sum(axis=1), len(power))
    return np.sqrt(error / power)


def new_view(
    shape: Shape, found: Bivariate, first: Capture, other: Capture, lights: NDArray[np.int64]
) -> tuple[float, float]:
    """Return the relative RMS error of f cos from another camera over what was observed, and the observed share.

    Every pixel of the other camera is carried by its true place into the first, where normal and weights are taken
    between four pixels; places that the first camera does not see are left out.
    """
    seen, truth = views(other), first.truth()
    assert truth is not None
    corners, share = _between(first.camera, seen.points)
    depth = np.linalg.norm(seen.points - first.camera.to_world[:3, 3], axis=1)
    inside = ((corners >= 0) & (corners < first.camera.resolution[0])).all(axis=(1, 2))
    column, row = np.moveaxis(np.where(inside[:, None, None], corners, 0), -1, 0)
    normal = (first.camera.normals_to_world(shape.normal[row, column]) * share[..., None]).sum(axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    weights = (found.weights[row, column].astype(np.float64) * share[..., None, None]).sum(axis=1)
    visible = np.abs((truth.depth[row, column] * share).sum(axis=1) - depth) < VISIBLE * depth
    known = inside & visible & np.isfinite(normal).all(axis=1) & np.isfinite(weights).all(axis=(1, 2))
    error, power, observed, total = 0.0, 0.0, 0, 0
    for index in lights:
        direction, irradiance = seen.light(index)
        reflected = other.image(index)[seen.mask] / irradiance
        lit = known & (reflected > 0).any(axis=1)
        guess, covered = predicted(normal[lit], weights[lit], found, direction[lit], seen.to_viewer[lit])
        error += float(((guess - reflected[lit])[covered] ** 2).sum())
        power += float((reflected[lit][covered] ** 2).sum())
        observed, total = observed + int(covered.sum()), total + len(covered)
    return float(np.sqrt(error / power)), observed / total


def _between(camera: Camera, points: Array) -> tuple[NDArray[np.int64], Array]:
    """Return the four pixels (P, 4, 2), column and row, around points, and their bilinear shares (P, 4)."""
    local = (points - camera.to_world[:3, 3]) @ camera.to_world[:3, :3]
    place = np.array(camera.centre) + np.array(camera.focal) * local[:, :2] / -local[:, 2:] * [1, -1] - 0.5
    low = np.floor(place).astype(np.int64)
    part = place - low
    steps = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
    share = np.where(steps == 1, part[:, None], 1 - part[:, None]).prod(axis=-1)
    return low[:, None] + steps, share
