"""Programs in processes of their own with the lines they print, and a bus of python-can-remote that they share."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import threading
from collections.abc import Callable

SERVER = """
import sys
from can_remote.server import RemoteServer
RemoteServer.allow_reuse_address = True
server = RemoteServer("127.0.0.1", int(sys.argv[1]), interface="virtual", channel="shared")
print("serving", flush=True)
server.serve_forever()
"""
"""A server for a port of this machine, as a program."""


PATIENCE = 60.0
"""Longest time for a program to end, in s."""


class Program:
    """A running program; `took` is called with each line of its output, in a thread."""

    def __init__(self, *command: str, took: Callable[[str], object]) -> None:
        environment = os.environ | {"PYTHONUNBUFFERED": "1"}
        self.popen: subprocess.Popen[str] = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
        )
        self._took = took
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.popen.stdout is not None
        for text in self.popen.stdout:
            self._took(text.rstrip())

    def signal(self, number: signal.Signals) -> None:
        """Send the program a signal."""
        self.popen.send_signal(number)

    def wait(self, patience: float = PATIENCE) -> int:
        """Wait for the end and the last line, and return the exit status; raises subprocess.TimeoutExpired."""
        status = self.popen.wait(patience)
        self._reader.join(patience)
        return status

    def kill(self) -> None:
        """End the program at once, by SIGKILL."""
        self.popen.kill()
        self.wait()
        if self.popen.stdout is not None:
            self.popen.stdout.close()


def free_port() -> int:
    """Return an unused TCP port of this machine."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        port: int = server.getsockname()[1]
        return port
