"""How a worker process is started: which program, with which modules and caches."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from ..pipeline.blender import workers
from .preferences import user_folder

WITHOUT_BLENDER = ("shape", "profile", "reflectance", "relight-worker")  # stages that the solvers alone do


def command_line(words: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return the command and the environment that run ``lightsphere WORDS`` in a process of its own.

    A stage that needs no Blender is run by Blender's Python, never by Blender: the OpenEXR package of the solvers
    clashes with the library inside a Blender executable. Compiled kernels go where extensions may write.
    """
    command, environment = workers.command_line(*words)
    if not needs_blender(words):
        command = [sys.executable, "-m", "pipeline", *words]
        environment["PYTHONPATH"] = os.pathsep.join([str(workers.ROOT), *filter(None, sys.path)])
    environment.setdefault("NUMBA_CACHE_DIR", str(user_folder("kernels")))
    return command, environment


def first_words(words: Sequence[str]) -> str:
    """Return what to show until a worker tells how far it is: its first run compiles kernels for a minute or two."""
    compiled = needs_blender(words) or any(user_folder("kernels").rglob("*.nbi"))
    return "starting" if compiled else "compiling the solvers, once"


def needs_blender(words: Sequence[str]) -> bool:
    """Return whether a command needs Blender in its process."""
    return words[0] not in WITHOUT_BLENDER or "--mesh" in words
