"""BRDF files: the MERL database's ``.binary`` and an ``.npz`` of our own.

``.binary`` (Matusik, Pfister, Brand, McMillan 2003): three int32, 90, 90 and 180, the bins of theta_h, theta_d and
phi_d, then as many float64 for red, then for green and blue, phi_d running fastest. Bins of theta_h are even in its
square root, the others even; a value times 1/1500 (red), 1.15/1500 (green), 1.66/1500 (blue) is f [1/sr]; a negative
one was not measured. ``.npz``: an array ``model``, a word, and what that model needs (``docs/brdf_files.md``)::

    table              table (TH, TD, 3) or (TH, TD, PD, 3) [1/sr], theta_h (TH,), theta_d (TD,), phi_d (PD,) [rad];
                       NaN where f is not known; without model, too. Several materials on the same angles may stand
                       in one file, each table under a name of its own in place of ``table``
    torrance-sparrow   diffuse (3,), specular (3,), sigma
    ward               diffuse (3,), specular (3,), alpha_x, alpha_y
"""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import images
from ..arrays import read_npz
from ..errors import LightsphereError
from . import Brdf
from .parametric import MODELS, parameters
from .tabulated import Tabulated, directions, filled

MERL = (90, 90, 180)
MERL_SCALE = np.array([1.0, 1.15, 1.66]) / 1500
TABLE = "table"
BLOCK = 65536  # directions that are evaluated at once


def read_brdf(path: Path, name: str = TABLE) -> Brdf:
    """Read a BRDF from a ``.binary`` or ``.npz`` file; of one with many tables that of a name, see :func:`tables_in`.

    Raises
    ------
    LightsphereError
        When the file is missing, of another kind, damaged or without values; the message names it.
    """
    readers: dict[str, Callable[[Path], Brdf]] = {".binary": _read_merl, ".npz": partial(_read_npz, name=name)}
    if not path.is_file():
        raise LightsphereError(f"{path} is missing; give a BRDF file")
    if path.suffix.lower() not in readers:
        raise LightsphereError(f"{path} is no BRDF file; give a MERL .binary or a .npz")
    try:
        return readers[path.suffix.lower()](path)
    except LightsphereError as error:
        raise LightsphereError(f"{path}: {error}") from error
    except OSError as error:
        raise LightsphereError(f"{path} cannot be read ({error}); copy it again") from error


def tables_in(path: Path) -> list[str]:
    """Return the names of the tables of a file, sorted; that of a file of one BRDF is :data:`TABLE`."""
    if path.suffix.lower() != ".npz":
        return [TABLE]
    try:
        found = read_npz(path)
    except LightsphereError as error:
        raise LightsphereError(f"{path}: {error}") from error
    several = sorted(name for name, array in found.items() if array.ndim in (3, 4) and array.shape[-1] == 3)
    return [TABLE] if "model" in found or TABLE in found or not several else several


def write_merl(path: Path, brdf: Brdf) -> None:
    """Write an isotropic BRDF at the bins' centres; -1 where a direction lies below the horizon.

    Raises
    ------
    LightsphereError
        When the BRDF is not isotropic, or the file cannot be written.
    """
    if not brdf.isotropic:
        raise LightsphereError(f"{path}: a MERL table holds isotropic materials alone; write .npz")
    wi, wo = directions(*np.meshgrid(*merl_nodes(), indexing="ij"))
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    values = np.full((len(wi), 3), -1.0)
    for start in range(0, len(wi), BLOCK):
        part = np.flatnonzero(above[start : start + BLOCK]) + start
        values[part] = brdf.evaluate(wi[part], wo[part]) / MERL_SCALE
    images.write_bytes(path, np.array(MERL, "<i4").tobytes() + values.T.astype("<f8").tobytes())


def write_npz(path: Path, brdf: Brdf) -> None:
    """Write a :class:`.Tabulated` or parametric BRDF with its own parameters.

    Raises
    ------
    LightsphereError
        When the BRDF is of another kind, or the file cannot be written.
    """
    kinds: dict[str, type[Any]] = {TABLE: Tabulated, **MODELS}
    for name, kind in kinds.items():
        if isinstance(brdf, kind):
            data = io.BytesIO()
            np.savez_compressed(data, model=np.array(name), **{key: getattr(brdf, key) for key in parameters(kind)})
            images.write_bytes(path, data.getvalue())
            return
    raise LightsphereError(f"{path}: a {type(brdf).__name__} has no .npz form; write it as .binary")


def merl_nodes() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the centres of the bins of theta_h, theta_d and phi_d of a MERL table [rad]."""
    h, d, p = ((np.arange(bins) + 0.5) / bins for bins in MERL)
    return h**2 * np.pi / 2, d * np.pi / 2, p * np.pi


def _read_merl(path: Path) -> Brdf:
    data = path.read_bytes()
    sizes = tuple(np.frombuffer(data[:12], "<i4").tolist()) if len(data) >= 12 else ()
    if sizes != MERL:
        raise LightsphereError("the header does not say 90, 90, 180, so it is no MERL table; give one of that size")
    count = 3 * int(np.prod(MERL))
    if len(data) != 12 + 8 * count:
        raise LightsphereError(f"the file has {len(data)} bytes, a MERL table {12 + 8 * count}; copy it again")
    planes = np.frombuffer(data, "<f8", count, 12).reshape(3, *MERL)
    table, _ = filled(np.moveaxis(planes, 0, -1) * MERL_SCALE)
    return Tabulated(table, *merl_nodes())


def _read_npz(path: Path, name: str) -> Brdf:
    arrays = read_npz(path)
    if name != TABLE and name in arrays:
        arrays = {**arrays, TABLE: arrays[name]}
    model = str(arrays.get("model", TABLE))
    if model != TABLE and model not in MODELS:
        raise LightsphereError(f"the model {model!r} is unknown; choose one of table, {', '.join(MODELS)}")
    wanted = ("table", "theta_h", "theta_d") if model == TABLE else parameters(MODELS[model])
    if missing := [name for name in wanted if name not in arrays]:
        raise LightsphereError(f"{', '.join(missing)} is missing; docs/brdf_files.md says what the file needs")
    numbers = {name: _numbers(name, arrays[name]) for name in (*wanted, "phi_d") if name in arrays}
    if model != TABLE:
        chosen = [numbers[name] if numbers[name].ndim else float(numbers[name]) for name in wanted]
        return MODELS[model](*chosen)  # type: ignore[no-any-return]
    table = numbers[TABLE]
    if table.ndim == 3:
        table = table[:, :, None]
    if table.ndim != 4:
        raise LightsphereError(f"table has the shape {table.shape}; give theta_h, theta_d, phi_d, 3")
    known, _ = filled(table)
    return Tabulated(known, numbers["theta_h"], numbers["theta_d"], numbers.get("phi_d", np.array([np.pi / 2])))


def _numbers(name: str, array: NDArray[Any]) -> NDArray[np.float64]:
    if array.dtype.kind not in "fiu":
        raise LightsphereError(f"{name} holds no numbers but {array.dtype}; give real numbers")
    return np.asarray(array, np.float64)
