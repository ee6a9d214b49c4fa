"""Diffuse reflectances of groups of surfaces in closed form, from what light each adds to what all show.

Radiosity of groups (Goral et al. 1984): with b the radiances of N groups, e the light that reaches them from lamps,
and K what a group gets of the radiance of another::

    b = rho (e + K b),      M = (1 - rho K)^-1

A render in which a group glows by itself shows its column of M, interreflections of all orders included. With b and
M of the reflectances now, e and K follow, and from the radiances of a photograph its reflectances. In units of what the
render shows (b = 1), for the photograph's r = b' / b, with k = 1 - M^-1, shares of a group's light that are others'::

    rho' / rho = r / (1 - sum k + k r)

Where no light goes from group to group, that is the ratio r (Boivin 2001, equation 4). Shares are not negative and come
to no more than 1, which noise does not know: what a group receives is a mean of 1 and of others' r then. Not modelled:
light that is spread otherwise over a group than its glow, which is even; what is left of that another round takes off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def corrections(gains: Array, ratios: Array) -> Array:
    """Return by what the reflectances of groups are to be multiplied, (N, 3).

    Parameters
    ----------
    gains : (N, N, 3) float64
        What a render shows of each group, where only the second glows as brightly as it does in the room, over what
        it shows of it in the room.
    ratios : (N, 3) float64
        Of a photograph to the render of the room.
    """
    factors = np.empty_like(ratios)
    for colour in range(3):
        ratio = ratios[:, colour]
        # pseudo, for a group whose glow does not show makes the gains singular
        shares = np.maximum(np.eye(len(ratio)) - np.linalg.pinv(gains[..., colour]), 0.0)
        shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1.0)
        factors[:, colour] = ratio / (1 - shares.sum(axis=1) + shares @ ratio)
    return factors
