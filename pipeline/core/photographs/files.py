"""Which files of a folder are its photographs, in which order, and which of them is the mask."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path
from typing import Any

from ..errors import LightsphereError

RAW = frozenset({".dng", ".cr2", ".cr3", ".nef", ".arw", ".orf", ".rw2", ".raf", ".pef", ".srw"})
# From the most to the least faithful: where one series is there in several formats, the first is taken.
PREFERRED = (*sorted(RAW), ".exr", ".tif", ".tiff", ".png", ".hdr", ".tga", ".bmp", ".jpg", ".jpeg")
NOT_A_LIGHT = {
    "mask": re.compile(r"(^|[^a-z])masks?([^a-z]|$)"),
    "ambient": re.compile(r"(^|[^a-z])(ambient|dark)([^a-z]|$)"),
}
SECONDS = re.compile(r"[ _.-]*exp(?:osure)?[ _-]?(\d+(?:\.\d+)?(?:e-?\d+)?)(?:-(\d+))?s?$", re.IGNORECASE)
NUMBER = re.compile(r"\d+(\.\d+)?(e-?\d+)?")


def natural(path: Path) -> list[Any]:
    """Return a sort key that counts: ``img2`` before ``img10``."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in re.split(r"(\d+)", path.name.lower())]


def series(folder: Path, pattern: str) -> list[Path]:
    """Return the photographs of a folder in their natural order.

    These are the largest set of pictures whose names differ by their numbers alone; masks and pictures of the ambient
    light are left out. Where no names are numbered, they are all pictures of one type. A pattern takes the place of
    these rules.

    Raises
    ------
    LightsphereError
        When there is no picture, or two sets of the same size.
    """
    if pattern:
        found = sorted((path for path in folder.glob(pattern) if is_picture(path)), key=natural)
        if not found:
            raise LightsphereError(f"{folder} holds no picture named {pattern}; correct --pictures")
        return found
    groups: dict[tuple[str, str], list[Path]] = defaultdict(list)
    for path in pictures(folder):
        if not any(word.search(path.stem.lower()) for word in NOT_A_LIGHT.values()):
            stem = NUMBER.sub("#", SECONDS.sub("", path.stem.lower()))
            groups[stem, path.suffix.lower()].append(path)
    if not groups:
        raise LightsphereError(f"{folder} holds no photographs; give the folder that holds them")
    largest = max(map(len, groups.values()))
    if largest == 1:
        return _of_one_type(groups)
    equal = [key for key, paths in groups.items() if len(paths) == largest]
    best = min(PREFERRED.index(suffix) for _, suffix in equal)
    equal = [key for key in equal if PREFERRED.index(key[1]) == best]
    if len(equal) > 1:
        names = " and ".join(f"{stem}{suffix}" for stem, suffix in sorted(equal)[:2])
        raise LightsphereError(f"{folder} holds several series of pictures ({names}); choose one by --pictures")
    return sorted(groups[equal[0]], key=natural)


def _of_one_type(groups: dict[tuple[str, str], list[Path]]) -> list[Path]:
    suffixes = [suffix for _, suffix in groups]
    usual = max(set(suffixes), key=lambda suffix: (suffixes.count(suffix), -PREFERRED.index(suffix)))
    return sorted((paths[0] for (_, suffix), paths in groups.items() if suffix == usual), key=natural)


def pictures(folder: Path) -> list[Path]:
    """Return all pictures of a folder."""
    return sorted((path for path in folder.iterdir() if is_picture(path)), key=natural)


def is_picture(path: Path) -> bool:
    """Return whether a file is a picture by its name; hidden files are none."""
    return path.suffix.lower() in PREFERRED and path.is_file() and not path.name.startswith(".")


def special(folder: Path, kind: str) -> Path | None:
    """Return the picture of a folder that is its ``"mask"`` or ``"ambient"``, if there is one."""
    found = [path for path in pictures(folder) if NOT_A_LIGHT[kind].search(path.stem.lower())]
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise LightsphereError(f"{folder} holds several pictures named {kind} ({names}); keep one of them there")
    return found[0] if found else None
