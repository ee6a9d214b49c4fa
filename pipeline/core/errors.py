"""The errors that commands and operators catch and show; every other exception is a bug."""

from __future__ import annotations

import tokenize
import zipfile
import zlib

#: The exit status of a command whose input is at fault.
INPUT_AT_FAULT = 2
#: What numpy raises for an .npz that is damaged, wherever the damage is.
BROKEN_NPZ: tuple[type[Exception], ...] = (
    *(OSError, ValueError, EOFError, KeyError, TypeError, RuntimeError, OverflowError, SyntaxError),
    *(NotImplementedError, MemoryError, zipfile.BadZipFile, zlib.error, tokenize.TokenError),
)
#: What is raised when a JSON file cannot be read, or its values are not what they should be.
BROKEN_JSON: tuple[type[Exception], ...] = (
    *(OSError, ValueError, KeyError, TypeError, IndexError, AttributeError, OverflowError, RecursionError),
)


class LightsphereError(Exception):
    """The input is at fault: the message says what is wrong, then what to do.

    Examples
    --------
    >>> raise LightsphereError("lights.lp lists 12 lights but 10 pictures exist; correct its first line")
    Traceback (most recent call last):
    ...
    pipeline.core.errors.LightsphereError: lights.lp lists 12 lights but 10 pictures exist; correct its first line
    """
