"""SIGTERM as an exception, so that a program that is terminated cleans up as usual."""

from __future__ import annotations

import signal
import threading
from types import FrameType

TERMINATED = 128 + signal.SIGTERM
"""Exit status of a program that SIGTERM has ended, as shells write it."""


class Terminated(SystemExit):
    """Raised when SIGTERM has come, by which it differs from a program that calls `sys.exit`."""


class EndedBySigterm:
    """A context manager: SIGTERM raises Terminated in the block, unless the program has a handler of its own.

    It does so once, and no longer after `hold`: what the program does at its end is not to be cut short. One that
    comes then raises it at the end of the block. Outside the main thread, where Python takes no signals, it does
    nothing.
    """

    def __init__(self) -> None:
        self._held = self._missed = self._installed = False

    def __enter__(self) -> EndedBySigterm:
        in_main_thread = threading.current_thread() is threading.main_thread()
        self._installed = in_main_thread and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
        if self._installed:
            signal.signal(signal.SIGTERM, self._on_sigterm)
        return self

    def hold(self) -> None:
        """Raise nothing before the end of the block."""
        self._held = True

    def _on_sigterm(self, _signal: int, _frame: FrameType | None) -> None:
        if self._held:
            self._missed = True
        else:
            self._held = True
            raise Terminated(TERMINATED)

    def __exit__(self, cause: object, *_: object) -> None:
        if self._installed:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
        if self._missed and cause is None:
            raise Terminated(TERMINATED)
