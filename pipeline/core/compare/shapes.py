"""A recovered shape against the truth: error maps first, figures from them."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ..capture import Truth
from ..errors import LightsphereError
from ..lights import Lights
from ..shape import Shape, level


def depth_error_pct(shape: Shape, truth: Truth) -> NDArray[np.float64]:
    """Return the absolute depth error along the ray of every pixel.

    Parameters
    ----------
    shape : Shape
        The recovered surface.
    truth : Truth
        The true surface, of the same camera.

    Returns
    -------
    (H, W) float64
        ``100 |depth - true depth| / diameter`` [% of the object's diameter]; NaN where either is unknown. Where normals
        alone gave the surface (``notes["level"]`` is ``"open"``) its scale (pinhole) or shift (orthographic), which
        they do not tell, is first set to the true one in the median.

    Raises
    ------
    LightsphereError
        When the pictures differ in size.

    Examples
    --------
    A depth 12 mm off on an object of 2.4 m is an error of 0.5 %.
    """
    if shape.depth.shape != truth.depth.shape:
        raise LightsphereError(
            f"the shape has {shape.depth.shape[1]}x{shape.depth.shape[0]} pixels, the truth "
            f"{truth.depth.shape[1]}x{truth.depth.shape[0]}; compare a shape with the capture it was made from"
        )
    if shape.notes.get("level") == "open":
        shape = shape.levelled(truth.depth)
    error = np.abs(shape.depth.astype(np.float64) - truth.depth)
    return np.asarray(100.0 * error / truth.diameter)


def normal_error_deg(shape: Shape, truth: Truth) -> NDArray[np.float64]:
    """Return the angle between recovered and true normals (H, W) [degrees]; NaN where either is unknown."""
    return angles_deg(shape.normal.astype(np.float64), truth.normal.astype(np.float64))


def angles_deg(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angles between vectors (..., 3) [degrees].

    As ``atan2(|a x b|, a . b)``, which keeps its digits near zero where ``arccos`` loses them.
    """
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.degrees(np.arctan2(sine, (a * b).sum(axis=-1))))


def shape_errors(shape: Shape, truth: Truth, mask: NDArray[np.bool_]) -> dict[str, float]:
    """State how far a shape is from the truth.

    Parameters
    ----------
    shape : Shape
        The recovered surface.
    truth : Truth
        The true surface.
    mask : (H, W) bool
        The pixels of the object.

    Returns
    -------
    dict of str to float
        ``recovered_pct`` is the share of the object's pixels that are recovered: with a finite depth, or a finite
        normal where the truth holds normals alone. Every other figure is over those pixels alone:
        ``depth_median_pct``, ``depth_p95_pct`` [% of the diameter], ``normal_mae_deg``, ``normal_median_deg``
        [degrees], and ``confidence_high_p95_pct`` and ``confidence_low_p95_pct``, the depth's 95th percentile over
        the third of the pixels with the highest and with the lowest confidence. A figure that no pixel can give is
        NaN; figures of depth are left out where the true depth is not known.
    """
    by_depth = bool(np.isfinite(truth.depth).any())
    counted = mask & np.isfinite(truth.depth if by_depth else truth.normal[..., 2])
    recovered = counted & np.isfinite(shape.depth if by_depth else shape.normal[..., 2])
    depth = depth_error_pct(shape, truth)[recovered]
    normal = normal_error_deg(shape, truth)[recovered]
    normal = normal[np.isfinite(normal)]
    errors = {"recovered_pct": 100.0 * float(recovered.sum()) / max(int(counted.sum()), 1)}
    if by_depth:
        ascending = depth[np.argsort(shape.confidence[recovered], kind="stable")]
        third = -(-len(ascending) // 3)
        errors |= {
            "depth_median_pct": _percentile(depth, 50),
            "depth_p95_pct": _percentile(depth, 95),
            "confidence_high_p95_pct": _percentile(ascending[len(ascending) - third :], 95),
            "confidence_low_p95_pct": _percentile(ascending[:third], 95),
        }
    return errors | {
        "normal_mae_deg": float(normal.mean()) if len(normal) else np.nan,
        "normal_median_deg": _percentile(normal, 50),
    }


def _percentile(values: NDArray[np.float64], percent: float) -> float:
    return float(np.percentile(values, percent)) if len(values) else np.nan


def light_errors(found: Lights, true: Lights, shape: Shape, truth: Truth | None) -> dict[str, float]:
    """State how far recovered lights are from the true ones.

    Parameters
    ----------
    found, true : Lights
        Distant or near.
    shape : Shape
        The surface that was found with the lights.
    truth : Truth or None
        Near lights are moved with the surface to its level (:mod:`pipeline.core.shape.level`) first.

    Returns
    -------
    dict of str to float
        ``light_mae_deg``, the mean angle between directions from the object's centre [degrees]; of near lights also
        ``light_distance_pct``, the median error of distances from there, and ``light_power_pct``, the scatter of the
        powers' ratios [%]. Empty where true lights are unknown, or near without a true depth.
    """
    if true.kind == "unknown":
        return {}
    if truth is not None and np.isfinite(truth.depth).any():
        found = level.lights_at(shape.camera, found, level.change(shape.camera, shape.depth, truth.depth))
        shape = dataclasses.replace(shape, depth=truth.depth)
    elif true.kind == "near":
        return {}
    middle = shape.middle()
    here, there = (one.position - middle if one.kind == "near" else one.position for one in (found, true))
    errors = {"light_mae_deg": float(angles_deg(here, there).mean())}
    if found.kind == "near" and true.kind == "near":
        apart = np.linalg.norm(here, axis=1) / np.linalg.norm(there, axis=1) - 1.0
        ratio = found.intensity.mean(axis=1) / true.intensity.mean(axis=1)
        errors |= {
            "light_distance_pct": 100.0 * float(np.median(np.abs(apart))),
            "light_power_pct": 100.0 * float(np.std(np.log(ratio))),
        }
    return errors
