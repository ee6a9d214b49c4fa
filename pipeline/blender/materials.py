"""The node material of whatever reflectance was recovered."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.material.surface import Surface
from ..core.reflectance import Reflectance
from .mixtures import mixture_material
from .single_lobe import single_lobe_material

Recovered = Reflectance | Surface


def surface_material(
    name: str, recovered: Recovered, normal_map: NDArray[np.float32] | None = None
) -> bpy.types.Material:
    """Make a material that shows a reflectance on a mesh with the capture's UVs.

    Parameters
    ----------
    name : str
    recovered : Reflectance or Surface
        Its maps become packed float images. Its figures become custom properties of the material.
    normal_map : (H, W, 3) float32, optional
        In tangent space, encoded 0 to 1.
    """
    if isinstance(recovered, Surface):
        return mixture_material(name, recovered, normal_map)
    return single_lobe_material(name, recovered, normal_map)
