"""`blender --command lightsphere STAGE ...`: the command line inside a Blender executable."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from typing import Any

import bpy

from . import preferences, worker

_registered: list[Any] = []


def register() -> None:
    """Add the command to Blender."""
    _registered.append(bpy.utils.register_cli_command("lightsphere", run))


def unregister() -> None:
    """Take the command back out of Blender."""
    bpy.utils.unregister_cli_command(_registered.pop())


def run(words: Sequence[str]) -> int:
    """Run the command and return its exit status: here, or in a process without Blender where it needs none."""
    if words and not worker.needs_blender(words):
        command, environment = worker.command_line(words)
        return subprocess.call(command, env=environment)
    os.environ.setdefault("NUMBA_CACHE_DIR", str(preferences.user_folder("kernels")))
    from ..pipeline import cli

    return cli.main(words)
