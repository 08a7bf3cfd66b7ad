"""A full SocketCAN bus: frames lost and CPU share of our live operation, compared with python-can's bare Notifier.

The sockets are real, and the sender is a process of its own (`programs/send_paced.py`). The readers are measured in
turns for some seconds each. `vcan0` carries 100 % of 1 Mbit/s although it has no bit rate: the sender counts the bits.
"""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import can

from bench.measure import Claim, Contender, Figures, NotHere, Quantity, Scale, Series, Way, Wrong
from bench.process import ENVIRONMENT, PROGRAMS, PYTHON, started
from bench.shared import protocol
from eurobot_od.bus.live import Live
from eurobot_od.controller import MessageQueue
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.gatekeeper import Gatekeeper

CHANNEL = "vcan0"
BITRATE = 1_000_000
BUFFER = 4 << 20
"""Bytes that a socket may hold: about 10 000 frames."""

SO_RCVBUFFORCE = 33
"""Linux's option for a larger buffer than ordinary users may have; for root."""

QUIET = 0.3
"""Silence after which no more frames are expected, in s."""

Count = Callable[[], int]
"""Returns how many frames have come so far."""


def new_bus() -> Any:
    """Open the bus, with a buffer large enough for a burst."""
    bus: Any = can.Bus(interface="socketcan", channel=CHANNEL)
    try:
        bus.socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, BUFFER)
    except PermissionError:
        bus.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
    return bus


@contextmanager
def live() -> Iterator[Count]:
    """Count typed messages in a queue of all of them, which keeps the newest."""
    keeper = Gatekeeper(protocol())
    queue: MessageQueue[Message] = keeper.add_queue(None, maxsize=100)
    with Live(new_bus(), keeper):
        yield lambda: queue.delivered


@contextmanager
def notifier() -> Iterator[Count]:
    """Count frames with a bare Notifier."""
    seen = [0]

    def hear(_: can.Message) -> None:
        seen[0] += 1

    with new_bus() as bus, can.Notifier(bus, [hear], timeout=0.1):
        yield lambda: seen[0]


def listened(reader: Callable[[], AbstractContextManager[Count]], shortest: int, seconds: int) -> Figures:
    """Measure a reader while the sender fills the bus, until no more frames come."""
    command = [PYTHON, str(PROGRAMS / "send_paced.py"), CHANNEL, str(BITRATE), str(seconds), str(shortest)]
    with reader() as count:
        begin = time.process_time()
        with started(command, ENVIRONMENT) as process:
            out, said = process.communicate()
        _wait_until_quiet(count)
        cpu = time.process_time() - begin
        came = count()
    if process.returncode:
        raise Wrong(f"the sender failed: {said.strip().rpartition(chr(10))[2]}")
    sent = json.loads(out)
    load = sent["bits"] / seconds / BITRATE
    return {Quantity.CPU: cpu / seconds, Quantity.COUNT: sent["frames"] - came, Quantity.LOAD: load}


def _wait_until_quiet(count: Count) -> None:
    before = -1
    while (now := count()) != before:
        before = now
        time.sleep(QUIET)


@contextmanager
def opened(shortest: int, scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield both readers for messages with at least `shortest` bytes; raises NotHere."""
    if not Path("/sys/class/net", CHANNEL).exists():
        raise NotHere(f"no {CHANNEL} here")
    seconds = scale.of(3, 1)
    readers = {"notifier": notifier, "ours": live}
    yield {name: partial(listened, reader, shortest, seconds) for name, reader in readers.items()}


def _full(messages: str, shortest: int) -> Series:
    """Return the rows of a bus that is full of such messages."""
    name = f"1 Mbit/s full of {messages}"
    claims = (
        Claim(f"{name}, frames lost", "ours", "notifier", Way.ALONE, 0, Quantity.COUNT),
        Claim(f"{name}, frames lost by a Notifier", "notifier", None, Way.ALONE, None, Quantity.COUNT),
        Claim(f"{name}, CPU: bare Notifier", "ours", "notifier", Way.RATIO, None, Quantity.CPU),
        Claim(f"{name}, load of the bus", "ours", "notifier", Way.ALONE, None, Quantity.LOAD),
    )
    return Series("socketcan", name, partial(opened, shortest), claims)


SERIES = (_full("messages of 8 bytes", 8), _full("all messages alike", 0))
"""About 8000 and 16 000 frames a second."""
