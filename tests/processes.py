"""Nodes and a bus server in processes of their own, and the lines that they print."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from queue import Empty, SimpleQueue

import pytest

PATIENCE = 60.0
"""Seconds after which a test gives up."""


class Process:
    """A running program; its lines, from standard output and error alike, are read as they come."""

    def __init__(self, *command: str) -> None:
        environment = os.environ | {"PYTHONUNBUFFERED": "1"}
        self.popen: subprocess.Popen[str] = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
        )
        self.said: list[str] = []
        self._lines: SimpleQueue[str] = SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.popen.stdout is not None
        for text in self.popen.stdout:
            self._lines.put(text.rstrip())

    def line(self, what: str, patience: float = PATIENCE) -> str:
        """Wait for the next line that says `what`; without one the test fails with what was said."""
        end = time.monotonic() + patience
        while (left := end - time.monotonic()) > 0:
            try:
                text = self._lines.get(timeout=left)
            except Empty:
                break
            self.said.append(text)
            if what in text:
                return text
        pytest.fail(f"{self.popen.args!r} did not say {what!r}, but:\n" + "\n".join(self.said))

    def told(self) -> list[str]:
        """Return all lines so far."""
        while not self._lines.empty():
            self.said.append(self._lines.get())
        return self.said

    def signal(self, number: signal.Signals) -> None:
        self.popen.send_signal(number)

    def wait(self) -> int:
        """Wait for the end, and return the exit status."""
        status = self.popen.wait(PATIENCE)
        self._reader.join(PATIENCE)
        return status

    def kill(self) -> None:
        self.popen.kill()
        self.wait()
        if self.popen.stdout is not None:
            self.popen.stdout.close()


@contextmanager
def process(*command: str) -> Iterator[Process]:
    """Run a program, and kill it at the end."""
    running = Process(*command)
    try:
        yield running
    finally:
        running.kill()


@contextmanager
def node(*words: str) -> Iterator[Process]:
    """Run `eurobot-od node`, and wait until it is on its bus."""
    with process(sys.executable, "-m", "eurobot_od", "node", *words) as running:
        running.line("Ctrl-C ends it")
        yield running


def free_port() -> int:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        port: int = server.getsockname()[1]
        return port


SERVER = """
import sys
from can_remote.server import RemoteServer
RemoteServer.allow_reuse_address = True
server = RemoteServer("127.0.0.1", int(sys.argv[1]), interface="virtual", channel="shared")
print("serving", flush=True)
server.serve_forever()
"""


@contextmanager
def bus_server(port: int) -> Iterator[Process]:
    """Run a server of python-can-remote on this machine."""
    with process(sys.executable, "-c", SERVER, str(port)) as running:
        running.line("serving")
        yield running


def shared(port: int) -> tuple[str, ...]:
    """Return the options for a command to use the server's bus."""
    return "-i", "remote", "-c", f"ws://127.0.0.1:{port}/"
