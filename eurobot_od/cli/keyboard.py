"""Single keys from a terminal, without waiting for the end of a line.

The terminal's settings are restored at the end; without a terminal there are no keys.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

UP, DOWN = "\x10", "\x0e"
"""The keys up and down, as Control-P and Control-N, which no text contains."""

PAGE = 10
"""Lines of a page."""

MOVING = {"\x1b[A": UP, "\x1b[B": DOWN, "\x1b[5~": PAGE * UP, "\x1b[6~": PAGE * DOWN}
"""What terminals send for the keys up, down, page up and page down."""

WaitForKey = Callable[[float], str]
"""Waits for a time in s, or less if a key was pressed, and returns the keys pressed."""


@contextmanager
def keys() -> Iterator[WaitForKey]:
    """Give the keys pressed while the context lasts."""
    if not sys.stdin.isatty():
        yield _no_keys
    elif os.name == "nt":
        yield _windows_keys
    else:
        with _posix_keys() as wait:
            yield wait


def _no_keys(pause: float) -> str:
    time.sleep(pause)
    return ""


@contextmanager
def _posix_keys() -> Iterator[WaitForKey]:
    import select
    import termios
    import tty

    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)

    def wait(pause: float) -> str:
        ready, _, _ = select.select([descriptor], [], [], pause)  # also the pause between two refreshes
        # By `os`, as `sys.stdin` would keep what it has read ahead, where `select` does not see it.
        pressed = os.read(descriptor, 64).decode(errors="ignore") if ready else ""
        for sequence, meant in MOVING.items():
            pressed = pressed.replace(sequence, meant)
        return pressed

    try:
        tty.setcbreak(descriptor)  # not raw: Ctrl-C has to stay an interrupt
        yield wait
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _windows_keys(pause: float) -> str:
    import msvcrt

    time.sleep(pause)  # `select` works on sockets only there
    pressed = ""
    while msvcrt.kbhit():  # type: ignore[attr-defined,unused-ignore]
        pressed += msvcrt.getwch()  # type: ignore[attr-defined,unused-ignore]
    return pressed
