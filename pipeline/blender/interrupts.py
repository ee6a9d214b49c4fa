"""Ctrl-C while Blender renders: kept until the render has returned.

Cycles' engine is called through Python. An interrupt raised in such a call is printed and forgotten by Blender.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


@contextlib.contextmanager
def deferred() -> Iterator[None]:
    """Hold an interrupt back for a while and let it act afterwards."""
    usual = signal.getsignal(signal.SIGINT)
    if usual is None or threading.current_thread() is not threading.main_thread():
        yield  # a Blender executable handles interrupts itself; other threads do not get them
        return
    came = []

    def keep(number: int, frame: FrameType | None) -> None:
        came.append(number)

    signal.signal(signal.SIGINT, keep)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
        if came:
            signal.raise_signal(signal.SIGINT)
