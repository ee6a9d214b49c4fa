"""Finished samples packed as WebDataset shards: tar files whose members are ``NAME.FILE``, those of a sample together.

A sample's number and split say which shard it is in, so that shards do not depend on the order in which samples came.
"""

from __future__ import annotations

import tarfile
from collections.abc import Sequence
from pathlib import Path

from ..errors import LightsphereError
from ..progress import Progress, Work
from . import folder as dataset
from .draw import Sample
from .recipe import CAPTURE, SHARDS, SPLITS


def write(folder: Path, samples: Sequence[Sample], size: int) -> Work[list[Path]]:
    """Pack the captures of finished samples, so many into each shard of a split; return the shards.

    Raises
    ------
    LightsphereError
        When the disk is full.
    """
    place = folder / SHARDS
    place.mkdir(exist_ok=True)
    made: list[Path] = []
    done = 0
    for split in SPLITS:
        chosen = [sample for sample in samples if sample.split == split]
        for number, start in enumerate(range(0, len(chosen), size)):
            shard = place / f"{split}-{number:06d}.tar"
            _pack(shard, folder, chosen[start : start + size])
            made.append(shard)
            done += len(chosen[start : start + size])
            yield Progress("pack", done, len(samples), "samples")
    for old in set(place.glob("*.tar")) - set(made):
        old.unlink()
    return made


def size_in_shard(folder: Path, index: int) -> int:
    """Return what a finished sample takes in a shard: whole blocks of every file, and one for its name [bytes]."""
    sizes = (path.stat().st_size for path in _members(folder, index))
    return sum(tarfile.BLOCKSIZE * (1 + -(-size // tarfile.BLOCKSIZE)) for size in sizes)


def _members(folder: Path, index: int) -> list[Path]:
    """Return the files of a finished sample that its shard holds."""
    return [path for name, path in dataset.files_of(folder, index) if name.startswith(f"{CAPTURE}/")]


def _pack(shard: Path, folder: Path, samples: Sequence[Sample]) -> None:
    partial = shard.with_name(f".{shard.name}{dataset.PART}")
    try:
        with tarfile.open(partial, "w", format=tarfile.USTAR_FORMAT) as tar:
            for sample in samples:
                for path in _members(folder, sample.index):
                    member = tarfile.TarInfo(f"{sample.name}.{path.name}")  # without time or owner
                    member.size = path.stat().st_size
                    with path.open("rb") as stream:
                        tar.addfile(member, stream)
        partial.replace(shard)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise LightsphereError(f"{shard} cannot be written ({error}); free space, then go on by --resume") from error
