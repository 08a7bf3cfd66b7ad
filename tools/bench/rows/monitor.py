"""Watching a full bus: CPU share of our monitor beside python-can's viewer and a bare Notifier.

Each runs in a process on a terminal of its own, see `programs/watch.py`; its output is thrown away.
"""

from __future__ import annotations

import json
import os
import subprocess
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial

from bench.measure import Claim, Contender, Figures, NotHere, Quantity, Scale, Series, Way, Wrong
from bench.process import ENVIRONMENT, PROGRAMS, PYTHON, limited

READERS = ("monitor", "viewer", "notifier")
TERMINAL = {"TERM": "xterm-256color", "LINES": "50", "COLUMNS": "160"}


def on_terminal(reader: str, seconds: float) -> Figures:
    """Run a reader in a process on a terminal of its own; raises Wrong if it reported no figures."""
    import pty

    control, terminal = pty.openpty()
    result, report = os.pipe()
    command = [PYTHON, str(PROGRAMS / "watch.py"), reader, str(seconds), str(report)]
    with (
        subprocess.Popen(
            command,
            stdin=terminal,
            stdout=terminal,
            stderr=terminal,
            pass_fds=[report],
            env=ENVIRONMENT | TERMINAL,
            start_new_session=True,
        ) as process,
        limited(process),
    ):
        os.close(terminal)
        os.close(report)
        threading.Thread(target=_swallow, args=[control], daemon=True).start()
        with os.fdopen(result) as answer:
            told = answer.read()
    if not told:
        raise Wrong(f"the {reader} ended without a report")
    measured = json.loads(told)
    return {Quantity.CPU: measured["share"], Quantity.COUNT: measured["lost"]}


def _swallow(control: int) -> None:
    """Read and drop what a program writes to its terminal, so that it does not wait."""
    try:
        while os.read(control, 65536):
            pass
    except OSError:  # the program has ended
        os.close(control)


@contextmanager
def opened(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield the readers; raises NotHere without terminals."""
    if not hasattr(os, "openpty"):
        raise NotHere("no pseudo-terminals")
    yield {reader: partial(on_terminal, reader, scale.of(1500, 100) / 1000) for reader in READERS}


CLAIMS = (
    Claim("monitor at 9000 frames/s, CPU: python-can's viewer", "monitor", "viewer", Way.RATIO, 1.0, Quantity.CPU),
    Claim("monitor at 9000 frames/s, CPU: bare Notifier", "monitor", "notifier", Way.RATIO, None, Quantity.CPU),
    Claim("monitor at 9000 frames/s, frames lost", "monitor", None, Way.ALONE, 0, Quantity.COUNT),
)
SERIES = (Series("monitor", "monitor", opened, CLAIMS),)
