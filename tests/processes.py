"""Nodes and a bus server in processes of their own, and the lines that they print."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from queue import Empty, SimpleQueue

import pytest
from programs import PATIENCE, SERVER, Program, free_port

from tests.kit.devices import MOTOR

__all__ = ["PATIENCE", "Process", "bus_server", "free_port", "motor", "node", "process", "shared"]


class Process(Program):
    """A running program whose lines a test waits for; `said` are those that it has seen."""

    def __init__(self, *command: str) -> None:
        self.said: list[str] = []
        self._lines: SimpleQueue[str] = SimpleQueue()
        super().__init__(*command, took=self._lines.put)

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


@contextmanager
def bus_server(port: int) -> Iterator[Process]:
    """Run a server of python-can-remote on this machine."""
    with process(sys.executable, "-c", SERVER, str(port)) as running:
        running.line("serving")
        yield running


def motor(node_id: int = 5) -> tuple[str, ...]:
    """Return the words for `node` to run the documentation's motor."""
    return "--eds", f"{node_id}={MOTOR}"


def shared(port: int) -> tuple[str, ...]:
    """Return the options for a command to use the server's bus."""
    return "-i", "remote", "-c", f"ws://127.0.0.1:{port}/"
