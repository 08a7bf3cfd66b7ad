"""Commands in processes of their own, and a bus that they share."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

import pytest
from can_remote.server import RemoteServer

PATIENCE = 60.0
"""Time after which a hanging process is killed, in s."""


@contextmanager
def serve_bus(name: str) -> Iterator[str]:
    """Serve a bus to other processes, on this machine only and on a free port; yields its channel."""
    server = RemoteServer("127.0.0.1", 0, interface="virtual", channel=name)
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    yield f"ws://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()
    thread.join(PATIENCE)


@contextmanager
def killed_if_it_hangs(command: list[str], patience: float = PATIENCE) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        watchdog = threading.Timer(patience, process.kill)
        watchdog.start()
        try:
            yield process
        finally:
            watchdog.cancel()
            process.kill()


def in_background(*words: str) -> AbstractContextManager[subprocess.Popen[str]]:
    """Run a command as a script's `&` does: it ignores Ctrl-C."""
    ignoring = (
        "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); os.execv(sys.argv[1], sys.argv[1:])"
    )
    return killed_if_it_hangs([sys.executable, "-c", ignoring, sys.executable, "-m", "eurobot_od", *words])


def command(*words: str, patience: float = PATIENCE) -> AbstractContextManager[subprocess.Popen[str]]:
    """Run a command in a process of its own, and kill it if it hangs."""
    return killed_if_it_hangs([sys.executable, "-m", "eurobot_od", *words], patience)


def node(*words: str) -> AbstractContextManager[subprocess.Popen[str]]:
    """Run a node in a process of its own, and kill it if it hangs."""
    return command("node", *words)


def line(process: subprocess.Popen[str], what: str) -> str:
    """Wait for the line that says `what`, whatever is reported before it; a process that ends first fails the test."""
    assert process.stdout is not None
    for text in process.stdout:
        if what in text:
            return text.rstrip()
    pytest.fail(f"{process.args!r} ended and did not say {what!r}")
