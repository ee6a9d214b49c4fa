"""`blender --command lightsphere STAGE ...`: the command line inside a Blender executable."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from typing import Any

import bpy

from . import worker

_registered: list[Any] = []


def register() -> None:
    """Add the command to Blender."""
    _registered.append(bpy.utils.register_cli_command("lightsphere", run))


def unregister() -> None:
    """Take the command back out of Blender."""
    bpy.utils.unregister_cli_command(_registered.pop())


def run(words: Sequence[str]) -> int:
    """Run the command and return its exit status: here, or in a process without Blender where it needs none.

    Blender's own library reads the pictures here: the OpenEXR package clashes with it inside a Blender executable.
    """
    if words and words[0] in worker.WITHOUT_BLENDER:
        command, environment = worker.command_line(words)
        return subprocess.call(command, env=environment)
    os.environ.setdefault("NUMBA_CACHE_DIR", str(worker.user_folder("kernels")))
    from ..pipeline import cli
    from ..pipeline.blender import exr
    from ..pipeline.core import images

    images.use_library(exr.read, exr.write)
    return cli.main(words)
