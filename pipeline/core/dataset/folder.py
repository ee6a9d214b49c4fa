"""A dataset on disk, and whether it is whole.

::

    recipe.json                 what was asked for, paths made whole
    capture/00000012/           a sample in each of the recipe's layouts
    diligent/00000012PNG/
    finished/00000012.sha256    its files in the format of sha256sum: the sample is there, and whole
    samples.jsonl               a line a sample: split, shape, material, camera, checksum of its list
    missing.json                samples that could not be made, and why; only where there are some

A sample is made beside the others, in a folder whose name ends in ``.part``, and moved into place when it is whole;
its list is written last. Whatever is not on a list belongs to no sample.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from .. import images
from ..errors import LightsphereError
from ..journal import Journal
from ..progress import Progress, Work
from .draw import Sample, draw, sample_name
from .recipe import FILES, Recipe

FORMAT, VERSION = "lightsphere-dataset", 1
RECIPE, MANIFEST, MISSING, FINISHED = "recipe.json", "samples.jsonl", "missing.json", "finished"
SHARED = "shared.sha256"  # lists the files that belong to many samples: shards, the data sheet
LOCK = ".lock"  # held by the run that is at work
PART = ".part"
AT_ONCE = 64  # samples that are checked between two reports


def begin(folder: Path, recipe: Recipe, made_by: dict[str, str]) -> None:
    """Write down what a dataset is to be, or go on with the one that is there.

    Files that it is made of may have changed (a mesh was mended) where no sample that is there was made of them.

    Parameters
    ----------
    folder : Path
    recipe : Recipe
    made_by : dict of str to str
        What else its bytes depend on: versions and device.

    Raises
    ------
    LightsphereError
        When the folder holds another dataset.
    """
    identity = json.loads(json.dumps(recipe.identity() | {"made_by": made_by}))
    described = {"format": FORMAT, "version": VERSION, "identity": identity, "recipe": recipe.as_json()}
    if (folder / RECIPE).is_file():
        before = _json(folder / RECIPE).get("identity")
        if not isinstance(before, dict):
            raise LightsphereError(f"{folder / RECIPE} is damaged; choose another folder")
        other = [key for key in identity if before.get(key) != identity[key]]
        mended = _without_checksums(before) == _without_checksums(identity)
        if other and not (mended and _are_unused(folder, recipe, before, identity)):
            raise LightsphereError(f"{folder} holds a dataset with another {', '.join(other)}; choose another folder")
    (folder / FINISHED).mkdir(parents=True, exist_ok=True)
    images.write_text(folder / RECIPE, json.dumps(described, indent=1))


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Keep other runs out of a dataset for a while; the system gives it free when this process ends, however it ends.

    Raises
    ------
    LightsphereError
        When another run is at work in it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / LOCK).open("w") as file:
        try:
            _lock(file.fileno())
        except OSError as error:
            raise LightsphereError(
                f"another run is at work in {folder}; wait for its end, or choose another folder"
            ) from error
        yield


def recipe_of(folder: Path) -> Recipe:
    """Return the recipe of a begun dataset; raise LightsphereError where there is none."""
    value = _json(folder / RECIPE)
    if value.get("format") != FORMAT or value.get("version") != VERSION:
        raise LightsphereError(f"{folder / RECIPE} is of another format; make the dataset again")
    return Recipe.of(value.get("recipe"))  # type: ignore[arg-type]


def finished_list(folder: Path, index: int) -> Path:
    """Return the path of a sample's list."""
    return folder / FINISHED / f"{sample_name(index)}.sha256"


def commit(made: Path, folder: Path, index: int) -> None:
    """Move a sample's files, which lie in a folder as they shall lie in the dataset's, into place, and list them.

    Of two processes that made the same sample, whose files are equal, both may do so.
    """
    files = sorted(path for path in made.rglob("*") if path.is_file())
    lines = [f"{images.checksum(path)}  {path.relative_to(made).as_posix()}\n" for path in files]
    for layout in sorted(made.iterdir()):
        (folder / layout.name).mkdir(exist_ok=True)
        for item in sorted(layout.iterdir()):
            place = folder / layout.name / item.name
            if place.is_dir():
                shutil.rmtree(place, ignore_errors=True)
            try:
                item.replace(place)
            except OSError:
                if not place.is_dir():  # else another process has put its equal folder there since
                    raise
    images.write_text(finished_list(folder, index), "".join(lines))


def intact(folder: Path, index: int) -> bool:
    """Return whether a sample is there and all its files are as they were written."""
    return not damages(folder, finished_list(folder, index))


def damages(folder: Path, listed: Path) -> list[str]:
    """Return what is wrong with the files on a list, in words; a list that is missing or empty is wrong, too."""
    files = Journal(listed).read()
    if not files:
        return [f"{listed.relative_to(folder).as_posix()} is missing or empty"]
    found = []
    for name, digest in files.items():
        try:
            if not (folder / name).resolve().is_relative_to(folder.resolve()):
                found.append(f"{name} lies outside of the dataset")
            elif not (folder / name).is_file():
                found.append(f"{name} is missing")
            elif images.checksum(folder / name) != digest:
                found.append(f"{name} is damaged")
        except (OSError, ValueError) as error:  # no name that a file can have, or one that may not be read
            found.append(f"{name!r} cannot be read ({error})")
    return found


def to_make(folder: Path, chosen: Sequence[int]) -> Work[list[int]]:
    """Return those of some samples that are not there or not whole."""
    wanted = []
    for done, index in enumerate(chosen, start=1):
        if not intact(folder, index):
            wanted.append(index)
        if done % AT_ONCE == 0 or done == len(chosen):
            yield Progress("check", done, len(chosen), "samples")
    return wanted


def remove_partial(folder: Path) -> None:
    """Remove what processes left that died; none may be at work."""
    for left in folder.glob(f"*{PART}"):
        if left.is_dir():
            shutil.rmtree(left, ignore_errors=True)
    for place in (folder, folder / FINISHED):
        for left in place.glob(f".*{PART}"):
            left.unlink(missing_ok=True)


def write_manifest(folder: Path, samples: Sequence[Sample], missing: dict[int, str]) -> None:
    """List the samples that are there, and why others are not."""
    partial = folder / f".{MANIFEST}{PART}"
    with partial.open("w", encoding="utf-8", newline="\n") as stream:
        for sample in samples:
            listed = {"sha256": images.checksum(finished_list(folder, sample.index))}
            stream.write(json.dumps(sample.as_json() | listed) + "\n")
    partial.replace(folder / MANIFEST)
    if missing:
        named = {sample_name(index): why for index, why in sorted(missing.items())}
        images.write_text(folder / MISSING, json.dumps(named, indent=1))
    else:
        (folder / MISSING).unlink(missing_ok=True)


def verify(folder: Path) -> Work[list[str]]:
    """Return everything that is wrong with a dataset, in words; nothing where it is complete and whole.

    Raises
    ------
    LightsphereError
        When the folder is no dataset.
    """
    count = recipe_of(folder).count
    wrong = damages(folder, folder / SHARED)
    manifest = folder / MANIFEST
    if manifest.is_file():
        with manifest.open(encoding="utf-8", errors="replace") as lines:
            listed = dict(found for line in lines if (found := _listed(line)))
    else:
        listed = {}
    for index in range(count):
        path = finished_list(folder, index)
        wrong += damages(folder, path)
        if path.is_file() and listed.get(index) != images.checksum(path):
            wrong.append(f"{path.relative_to(folder).as_posix()} is not the one that {MANIFEST} lists")
        yield Progress("verify", index + 1, count, "samples")
    return wrong


def list_shared(folder: Path, paths: Sequence[Path]) -> None:
    """List files that belong to many samples."""
    lines = [f"{images.checksum(path)}  {path.relative_to(folder).as_posix()}\n" for path in sorted(paths)]
    images.write_text(folder / SHARED, "".join(lines))


def files_of(folder: Path, index: int) -> Iterator[tuple[str, Path]]:
    """Yield name and path of the files of a finished sample."""
    for name in Journal(finished_list(folder, index)).read():
        yield name, folder / name


def _without_checksums(identity: dict[str, Any]) -> dict[str, Any]:
    """Return what samples depend on, files by their names alone."""
    return identity | {
        section: identity[section] | {"source": [_name(word) for word in identity[section]["source"]]}
        for section in FILES
        if isinstance(identity.get(section), dict) and isinstance(identity[section].get("source"), list)
    }


def _name(word: object) -> str:
    """Return the name of a file, of which its checksum is said, too; another word as it is."""
    return str(word).rpartition(" ")[0] or str(word)


def _are_unused(folder: Path, recipe: Recipe, before: dict[str, Any], now: dict[str, Any]) -> bool:
    """Return whether no sample that is there was made of a file that has changed since."""
    changed = {_name(word) for part in FILES for word in now[part]["source"] if word not in before[part]["source"]}
    there = (draw(recipe, index) for index in range(recipe.count) if finished_list(folder, index).is_file())
    return not any(Path(getattr(sample, part)).name in changed for sample in there for part in FILES)


def _lock(file: int) -> None:
    """Lock a file for this process; raise OSError when another one has it."""
    if os.name == "nt":
        import msvcrt

        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _listed(line: str) -> tuple[int, str] | None:
    """Return number and checksum of a sample from its line, None for a damaged one."""
    try:
        row = json.loads(line)
        return int(row["index"]), str(row["sha256"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _json(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise LightsphereError(f"{path.parent} is no dataset (it has no {path.name}); make one by lightsphere dataset")
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise LightsphereError(f"{path} is damaged ({error}); run lightsphere dataset --resume") from error
    if not isinstance(value, dict):
        raise LightsphereError(f"{path} is damaged; run lightsphere dataset --resume")
    return value
