"""The focal length of a camera from photographs of a checkerboard, by OpenCV (Zhang 2000)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import LightsphereError
from ..core.photographs import files
from ..core.photographs.develop import FULL_FRAME
from ..core.progress import Progress, Work
from .pictures import read

FEWEST = 3  # photographs in which the board is found
WHITE = 0.99  # quantile of a photograph that is shown as white
LINEAR_GAMMA = 0.45  # for files of more than 8 bits, which are mostly linear
SURE = 0.03  # relative deviation of the focal length beyond which it is not one
TILTED = 15.0  # angle [degrees] to the picture that the board has to reach: facing the camera it tells no focal length


@dataclass(frozen=True)
class Lens:
    """What the photographs told.

    Parameters
    ----------
    focal : float
        Focal length as if the picture's longer side were 36 mm [mm].
    deviation : float
        Its standard deviation [mm].
    seen : int
        Photographs in which the board was found.
    size : (int, int)
        Width and height of the photographs [px].
    """

    focal: float
    deviation: float
    seen: int
    size: tuple[int, int]


def lens(folder: Path, corners: str) -> Work[Lens]:
    """Return the lens by which a checkerboard was photographed from some sides.

    The optical axis is taken to meet the middle of the picture, pixels to be square; one coefficient of radial
    distortion is fitted, so that it does not bend the focal length, and left out.

    Parameters
    ----------
    folder : Path
    corners : str
        Inner corners of the board along its two sides, as in ``"9x6"``.

    Raises
    ------
    LightsphereError
        Where OpenCV is not installed, the board is found in too few photographs, they differ in size, or they show it
        from too few sides to tell a focal length.
    """
    try:
        import cv2
    except ImportError as error:
        raise LightsphereError(
            "a checkerboard needs OpenCV (pip install lightsphere[checkerboard]); or state the lens by --focal"
        ) from error
    across, along = _counts(corners)
    board = np.zeros((across * along, 3), np.float32)
    board[:, :2] = np.mgrid[:across, :along].T.reshape(-1, 2)
    paths, found, size = files.pictures(folder), [], (0, 0)
    for number, path in enumerate(paths):
        gray = _gray(path)
        if number and gray.shape[::-1] != size:
            raise LightsphereError(
                f"{path} is of another size than {paths[0].name}; photograph the board by one camera"
            )
        size = (gray.shape[1], gray.shape[0])
        seen, places = cv2.findChessboardCornersSB(gray, (across, along), flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
        if seen:
            found.append(places.astype(np.float32))
        yield Progress("checkerboard", number + 1, len(paths), "photographs")
    if len(found) < FEWEST:
        raise LightsphereError(
            f"a board of {across}x{along} inner corners was found in {len(found)} of {len(paths)} photographs of "
            f"{folder}; at least {FEWEST} must show all of it, sharp; --corners says how many it has"
        )
    held = cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST
    held |= cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
    square = np.array([[1.0, 0, (size[0] - 1) / 2], [0, 1.0, (size[1] - 1) / 2], [0, 0, 1]])
    told = cv2.calibrateCameraExtended([board] * len(found), found, size, square, np.zeros(5), flags=held)
    focal, deviation = float(told[1][1, 1]), float(told[5].ravel()[1])  # fy is the one that moves, fx goes with it
    tilts = [np.degrees(np.arccos(abs(cv2.Rodrigues(turn)[0][2, 2]))) for turn in told[3]]
    if not (deviation < SURE * focal and max(tilts) > TILTED):
        raise LightsphereError(
            f"{folder}: the board is seen from too few sides to tell the focal length; tilt it by 30 degrees and more, "
            "another way in each photograph"
        )
    unit = FULL_FRAME / max(size)
    return Lens(focal * unit, deviation * unit, len(found), size)


def _counts(corners: str) -> tuple[int, int]:
    """Return the two numbers of ``"9x6"``."""
    parts = corners.lower().split("x")
    if len(parts) != 2 or not all(part.strip().isdigit() and int(part) >= 3 for part in parts):
        raise LightsphereError(f"--corners {corners!r} is no board; give the inner corners of both sides, as in 9x6")
    return int(parts[0]), int(parts[1])


def _gray(path: Path) -> NDArray[Any]:
    """Return a photograph as 8 bits of gray."""
    picture = read(path)
    gray = np.nan_to_num(picture.pixels.mean(axis=2))
    gray = np.clip(gray / max(float(np.quantile(gray, WHITE)), 1e-9), 0.0, 1.0)
    return np.round(255 * (gray if picture.bits == 8 else gray**LINEAR_GAMMA)).astype(np.uint8)
