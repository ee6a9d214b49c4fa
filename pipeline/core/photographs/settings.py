"""What the stage import can be told."""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import setting

FORMATS = ("auto", "diligent", "lp", "folder", "near", "stack", "uncalibrated")


@dataclass(frozen=True)
class ImportSettings:
    """How photographs become a capture."""

    format: str = setting("auto", "what lies there, auto tells by the files", choices=FORMATS)
    lights: str = setting(
        "", "file of lights (.lp, .txt, .csv, .json), where none lies beside the photographs", path="file"
    )
    mask: str = setting(
        "", "picture that is bright where the object is, where none lies beside the photographs", path="file"
    )
    pictures: str = setting("", "pattern of the photographs' names, as in 'IMG_*.jpg', where other pictures lie there")
    response: str = setting(
        "auto",
        "linear, srgb, a gamma such as 2.2, a file of two columns (value as stored, light), or exposures, which "
        "measures it from several exposures; auto takes srgb for 8 bits and linear for more",
    )
    bracket: int = setting(1, "photographs of each light, one after the other at several exposures", low=1, high=100)
    focal: float = setting(
        0.0,
        "focal length as of a full frame (36 mm wide), where nothing else tells the camera; 0: as the photographs' "
        "EXIF says, else orthographic",
        unit="mm",
        low=0.0,
        high=10_000.0,
    )
    checkerboard: str = setting(
        "",
        "folder of photographs of a checkerboard from several sides by the same lens, in place of --focal",
        path="folder",
    )
    corners: str = setting("9x6", "inner corners of the checkerboard along its two sides")
    chrome: str = setting("", "folder of photographs of a mirror sphere under the same lights", path="folder")
    gray: str = setting("", "folder of photographs of a matt sphere under the same lights", path="folder")
