"""Single keys from a terminal, without waiting for the end of a line.

Rule of this file: the terminal is left as it was found; without a terminal there are no keys.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

MOVING = {"\x1b[A": "k", "\x1b[B": "j", "\x1b[5~": 10 * "k", "\x1b[6~": 10 * "j"}
"""What terminals send for the keys up, down, page up and page down, and the letters that they stand for."""

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
        ready, _, _ = select.select([descriptor], [], [], pause)
        pressed = os.read(descriptor, 64).decode(errors="ignore") if ready else ""
        for sequence, letters in MOVING.items():
            pressed = pressed.replace(sequence, letters)
        return pressed

    try:
        tty.setcbreak(descriptor)
        yield wait
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _windows_keys(pause: float) -> str:
    import msvcrt

    time.sleep(pause)
    pressed = ""
    while msvcrt.kbhit():  # type: ignore[attr-defined,unused-ignore]
        pressed += msvcrt.getwch()  # type: ignore[attr-defined,unused-ignore]
    return pressed
