"""Photographs from files: by the OpenImageIO that Blender bundles, RAW by rawpy where it is installed.

No transfer curve, white balance, orientation or alpha is applied: the numbers are those in the file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..core import images
from ..core.errors import LightsphereError
from ..core.photographs.decode import decoded
from ..core.photographs.develop import FULL_FRAME
from ..core.photographs.files import RAW
from ..core.photographs.photographs import FLOAT_BITS, Picture
from ..core.photographs.shots import exposures
from .exr import openimageio

RESOLUTION_UNITS = {2: 25.4, 3: 10.0}  # of EXIF's focal plane: inch and centimetre [mm]
SAME_ASPECT = 0.02  # relative difference of aspects that rounding makes
BITS = {"uint8": 8, "uint16": 16, "uint32": 32}


def read(path: Path) -> Picture:
    """Read a photograph; one channel is gray, a fourth one (alpha) is left out.

    Raises
    ------
    LightsphereError
        When the file is missing, damaged or not a picture, or is RAW and rawpy is not installed.
    """
    if not path.is_file():
        raise LightsphereError(f"{path} is missing; put the photograph there")
    return _read_raw(path) if path.suffix.lower() in RAW else _read(path)


def merged(folder: Path, response: str) -> Picture:
    """Read exposures of one thing and merge them: linear floats, those that are saturated in all exposures NaN.

    Raises
    ------
    LightsphereError
        As :func:`read`, and for exposures of unknown or equal times.
    """
    one = decoded(exposures(folder, read), response)
    return Picture(np.where(one.linear >= one.saturation, np.float32(np.nan), one.linear), FLOAT_BITS)


def _read(path: Path) -> Picture:
    oiio = openimageio()
    wishes = oiio.ImageSpec()
    wishes.attribute("oiio:UnassociatedAlpha", 1)  # else colours are multiplied by alpha
    with images.quiet():
        file = oiio.ImageInput.open(str(path), wishes)
        if file is None:
            raise LightsphereError(f"{path} is not a readable picture ({_line(oiio.geterror())}); replace the file")
        spec = file.spec()
        images.check_size(path, spec.image_pixels() * spec.nchannels)
        pixels = file.read_image(0, 0, 0, spec.nchannels, "float")
        failure = file.geterror()
        file.close()
    if pixels is None or failure:
        raise LightsphereError(f"{path} is damaged ({_line(failure)}); copy it again from the camera")
    if spec.nchannels < 3:
        pixels = np.repeat(pixels[..., :1], 3, axis=-1)
    seconds = spec.get_float_attribute("ExposureTime", 0.0)
    bits = BITS.get(str(spec.format), FLOAT_BITS)
    return Picture(np.ascontiguousarray(pixels[..., :3]), bits, seconds if seconds > 0 else None, _focal(spec))


def _focal(spec: Any) -> float | None:
    """Return the focal length by EXIF, as if the picture's longer side were 36 mm; None for one that was cropped.

    The length as of 35 mm film is by the diagonal (CIPA DCG-001); else it is by the sensor's resolution.
    """
    taken = [
        spec.get_int_attribute(f"Exif:Pixel{axis}Dimension", size)
        for axis, size in (("X", spec.width), ("Y", spec.height))
    ]
    longer, shorter = max(taken), min(taken)
    if abs(longer / max(shorter, 1) / (max(spec.width, spec.height) / min(spec.width, spec.height)) - 1) > SAME_ASPECT:
        return None
    if equivalent := spec.get_int_attribute("Exif:FocalLengthIn35mmFilm", 0):
        return float(
            equivalent * np.hypot(longer, shorter) / longer * FULL_FRAME / np.hypot(FULL_FRAME, 2 / 3 * FULL_FRAME)
        )
    length = spec.get_float_attribute("Exif:FocalLength", 0.0)
    resolution = spec.get_float_attribute("Exif:FocalPlaneXResolution", 0.0)
    unit = RESOLUTION_UNITS.get(spec.get_int_attribute("Exif:FocalPlaneResolutionUnit", 2))
    if not (length > 0 and resolution > 0 and unit):
        return None
    return float(length * resolution / unit / longer * FULL_FRAME)


def _read_raw(path: Path) -> Picture:
    """Develop a RAW file linearly: black level taken off, demosaiced, in camera colours, not brightened or balanced."""
    try:
        import rawpy
    except ImportError as error:
        raise LightsphereError(
            f"{path} is a RAW photograph; install rawpy (pip install lightsphere[raw]) or export 16-bit linear TIFF"
        ) from error
    try:
        with rawpy.imread(str(path)) as raw:
            pixels = raw.postprocess(
                gamma=(1, 1),
                no_auto_bright=True,
                adjust_maximum_thr=0,  # else the scale would depend on the picture
                user_wb=[1, 1, 1, 1],
                output_color=rawpy.ColorSpace.raw,
                output_bps=16,
                user_flip=0,
            )
            seconds = float(raw.other.shutter_speed)
    except rawpy.LibRawError as error:
        raise LightsphereError(f"{path} cannot be developed ({error}); export it as 16-bit linear TIFF") from error
    return Picture(pixels.astype(np.float32) / np.float32(65535), 16, seconds if seconds > 0 else None)


def _line(text: str) -> str:
    return " ".join(text.split()) or "unknown format"
