"""What Blender prints by itself, kept off the terminal."""

from __future__ import annotations

import contextlib
import ctypes
import io
import os
import sys
import tempfile
from collections.abc import Iterator
from typing import Any

LIBC = ctypes.CDLL(None if os.name == "posix" else "ucrtbase")


@contextlib.contextmanager
def caught_output() -> Iterator[Any]:
    """Keep Blender's own lines, which Python cannot catch, off standard output and error."""
    _flush()
    kept = [os.dup(stream) for stream in (1, 2)]
    try:
        # Blender's operators report errors through Python's own standard output.
        with tempfile.TemporaryFile() as caught, contextlib.redirect_stdout(io.StringIO()):
            for stream in (1, 2):
                os.dup2(caught.fileno(), stream)
            try:
                yield caught
            finally:
                _flush()
                for stream, copy in zip((1, 2), kept, strict=True):
                    os.dup2(copy, stream)
    finally:
        for copy in kept:
            os.close(copy)


def _flush() -> None:
    """Let nothing that Python or C still holds come out on the wrong side of a redirection."""
    sys.stdout.flush()
    sys.stderr.flush()
    LIBC.fflush(None)
