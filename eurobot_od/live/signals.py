"""SIGTERM as an exception, so that a program that is told to end does what it does at its end."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

TOLD_TO_END = 128 + signal.SIGTERM
"""Exit status of a program that SIGTERM has ended, as shells write it."""


@contextmanager
def ended_by_sigterm() -> Iterator[None]:
    """Have SIGTERM raise SystemExit in the block, unless the program has a handler of its own.

    Outside the main thread, where Python takes no signals, it does nothing.
    """
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, _end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _end(_signal: int, _frame: FrameType | None) -> None:
    raise SystemExit(TOLD_TO_END)
