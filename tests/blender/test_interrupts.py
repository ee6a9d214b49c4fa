"""An interrupt during a render is neither lost nor raised inside of it."""

from __future__ import annotations

import signal
import threading

import pytest

from pipeline.blender import interrupts


def test_an_interrupt_waits_for_the_end() -> None:
    usual, reached = signal.getsignal(signal.SIGINT), []
    with pytest.raises(KeyboardInterrupt), interrupts.deferred():
        signal.raise_signal(signal.SIGINT)
        reached.append("the end")
    assert reached == ["the end"]
    assert signal.getsignal(signal.SIGINT) is usual


def test_it_comes_out_of_a_failure_too() -> None:
    with pytest.raises(KeyboardInterrupt), interrupts.deferred():
        signal.raise_signal(signal.SIGINT)
        raise ValueError


def test_nothing_happens_without_one() -> None:
    usual = signal.getsignal(signal.SIGINT)
    with interrupts.deferred():
        pass
    assert signal.getsignal(signal.SIGINT) is usual


def test_other_threads_may_render() -> None:
    done: list[str] = []

    def work() -> None:
        with interrupts.deferred():
            done.append("rendered")

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == ["rendered"]
