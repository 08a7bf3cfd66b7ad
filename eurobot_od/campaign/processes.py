"""Processes of this machine as an executor: the standard library's, which end when they are not wanted any more.

Rule of this file: no process is left over, whether its work is done, is given up, or its parent is killed.

The standard library's processes wait for work for ever when their parent was killed, and finish what they have begun
when it does not want it any more. Each of ours therefore has a thread that waits for either, and ends the process.
"""

from __future__ import annotations

import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from typing import Any


class Processes(ProcessPoolExecutor):
    """So many processes; at the end of the `with` block they end at once, whatever they are doing.

    They are started anew, not forked: threads of other packages do not survive a fork.
    """

    def __init__(self, number: int) -> None:
        context = get_context("spawn")
        self._told, tell = context.Pipe(duplex=False)
        self._tell = tell
        super().__init__(number, context, _begin, (self._told,))

    def __exit__(self, *_: object) -> bool | None:
        self._tell.send_bytes(b"end")  # nobody takes it out, so that all see it
        self.shutdown(wait=True, cancel_futures=True)
        self._tell.close()
        self._told.close()
        return None


def _begin(told: Connection) -> None:
    """Set a new process up: Ctrl-C, which reaches all processes, is the parent's to act on."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    awaited: list[Any] = [told] if parent is None else [told, parent.sentinel]
    threading.Thread(target=_end_after, args=(awaited,), daemon=True).start()


def _end_after(awaited: list[Any]) -> None:
    wait(awaited)
    os._exit(0)
